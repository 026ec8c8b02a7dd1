// Where no photon reaches, a search ends at once. That one never ends too early is PhotonMap.SearchesAgreeWithBruteForce.
#include <gtest/gtest.h>

#include "integrator/photon_map.h"
#include "kernel/sample/sobol.h"

namespace relief::test {
namespace {

TEST(PhotonMap, PlacesThatNoPhotonReachesAreToldByOneByte)
{
  // A dense patch and a few photons around.
  std::vector<std::vector<Photon>> chunks(1);
  std::vector<float> radii;
  constexpr std::uint32_t kCount = 20000;
  for (std::uint32_t i = 0; i < kCount; ++i) {
    const Vec2f u = sample_2d(3, i, 0);
    const float spread = i % 100 == 0 ? 2.0f : 1.0f;
    chunks[0].push_back({{spread * u.x, 0, spread * u.y}, {splat3(1), 0, 0, 0}});
    radii.push_back(i % 100 == 0 ? 0.1f : 0.02f);
  }
  PhotonMap map;
  map.build(chunks, radii);
  const PhotonMapView view = map.view();
  const auto octaves_at = [&](Vec3f P) {
    const float inverse = 1.0f / view.largest_radius;
    return view.near[photon_near(photon_cell(P.x, inverse), photon_cell(P.y, inverse), photon_cell(P.z, inverse),
                                 view.near_mask)];
  };
  int silent = 0, wide_alone = 0;
  constexpr std::uint32_t kQueries = 2000;
  for (std::uint32_t q = 0; q < kQueries; ++q) {
    const Vec2f u = sample_2d(4, q, 0);
    silent += octaves_at({3 + 20 * u.x, 0, 20 * u.y}) == 0 ? 1 : 0;
    wide_alone += octaves_at({1.2f + 0.7f * u.x, 0, 1.2f + 0.7f * u.y}) == 1 ? 1 : 0;
  }
  EXPECT_GT(silent, 0.9 * kQueries);
  EXPECT_GT(wide_alone, 0.5 * kQueries);
}

}  // namespace
}  // namespace relief::test
