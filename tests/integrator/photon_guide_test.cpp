// Photons go where the picture shows them, and nothing is lost elsewhere.
#include "integrator/photon_guide.h"

#include <gtest/gtest.h>

#include <cmath>

#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "kernel/sample/sobol.h"
#include "tests/support/caustic_scene.h"

namespace relief::test {
namespace {

/// Sources of equal chances, a metre apart, each with as many photons of one watt.
struct Row {
  PhotonSources sources;
  std::vector<std::size_t> groups{0};  ///< each by itself
  std::vector<std::vector<Photon>> photons;

  Row(std::uint32_t count, int photons_each)
  {
    for (std::uint32_t s = 0; s < count; ++s) {
      sources.sources.push_back({{}, s});
      sources.cdf.push_back(static_cast<double>(s) / count);
      const Photon photon{place(s), {splat3(1), 0, 0, 0}};
      photons.emplace_back(photons_each, photon);
      groups.push_back(s + 1);
    }
    sources.cdf.push_back(1);
  }
  static Vec3f place(std::uint32_t s) { return {static_cast<float>(s) + 0.4f, 0.1f, 0.4f}; }
  double guide(const std::vector<Vec3f>& looks)
  {
    return photon_sources_guide(sources, groups, photons, looks, 0.25f);
  }
  double chance(std::size_t s) const { return sources.cdf[s + 1] - sources.cdf[s]; }
};

TEST(PhotonGuide, HalfOfThePhotonsStartWhereTheyAreSeen)
{
  Row row(10, 8);
  EXPECT_NEAR(row.guide({Row::place(3)}), 0.5 + 0.5 * 10, 1e-9);
  for (std::size_t s = 0; s < 10; ++s) EXPECT_NEAR(row.chance(s), s == 3 ? 0.55 : 0.05, 1e-12) << s;
  EXPECT_EQ(row.sources.cdf.front(), 0);
  EXPECT_EQ(row.sources.cdf.back(), 1);
  EXPECT_EQ(row.sources.within, 120);
}

TEST(PhotonGuide, TellsGroupsApartAndKeepsSharesWithinThem)
{
  Row row(10, 8);
  row.sources.cdf = {0, 0.05, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1};
  row.groups = {0, 2, 10};
  row.photons = {row.photons[0], row.photons[5]};
  // A fifth has all that shows.
  EXPECT_NEAR(row.guide({Row::place(0)}), 0.5 + 0.5 * 5, 1e-9);
  EXPECT_NEAR(row.chance(0), 0.6 / 4, 1e-12);
  EXPECT_NEAR(row.chance(1), 0.6 * 3 / 4, 1e-12);
  EXPECT_NEAR(row.chance(9), 0.4 / 8, 1e-12);
}

TEST(PhotonGuide, LeavesThemWhereAllAreSeen)
{
  for (const int each : {2, 8}) {
    Row row(1000, each);
    // That some sources have one photon more or less is chance.
    std::vector<Vec3f> looks;
    for (std::uint32_t s = 0; s < 1000; ++s) {
      looks.push_back(Row::place(s));
      row.photons[s].resize(static_cast<std::size_t>(each) - hash_mix_32(s) % 2);
    }
    EXPECT_EQ(row.guide(looks), 1);
    EXPECT_NEAR(row.chance(500), 1e-3, 1e-12);
  }
  Row unseen(10, 8);
  EXPECT_EQ(unseen.guide({{90, 0, 0}}), 1);
  EXPECT_EQ(unseen.guide({}), 1);
}

/// Balls of glass in a row, of which the camera sees one, under a lamp that paths find through them.
Scene row_of_balls(int count, float lamp_half, float radiance)
{
  Scene scene = empty_scene();
  add_floor(scene, static_cast<float>(count));
  for (int i = 0; i < count; ++i) {
    Affine3 place;
    place.p = {static_cast<float>(i) * 1.5f, 0.42f, 0};
    add_caster(scene, sphere_mesh(0.4f, 48, 24, true), glass_material(), place);
  }
  scene.lights.push_back(square_light({0.4f, 4, 0.2f}, {0, -1, 0}, lamp_half, radiance));
  look_down(scene, {0, 0, 0}, 0.8f, 1.9f);
  return scene;
}

TEST(PhotonGuide, KeepsTheLight)
{
  const Scene scene = row_of_balls(24, 0.7f, 12);
  RenderOptions options = caustic_options(scene, CausticsMode::kOn, 32, 1);
  const std::string reason = render_scene(scene, options).stats.caustics.reason;
  EXPECT_NE(reason.find("times as dense where the picture shows them"), std::string::npos) << reason;
  expect_same(scene, 128, 8, 0.005, "one ball of a row");
}

TEST(PhotonGuide, IsTheSameForAnyNumberOfThreadsAndForMoreSamples)
{
  const Scene scene = row_of_balls(24, 0.05f, 500);
  const auto with = [&](int threads, int samples) {
    const RenderOptions options = caustic_options(scene, CausticsMode::kOn, 32, samples);
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
    tbb::task_arena arena(threads);
    return arena.execute([&] { return render_scene(scene, options); });
  };
  const Rendered one = with(1, 2);
  EXPECT_EQ(one.image.pixels, with(3, 2).image.pixels);
  EXPECT_EQ(one.stats.caustics.reason, with(2, 4).stats.caustics.reason);
}

}  // namespace
}  // namespace relief::test
