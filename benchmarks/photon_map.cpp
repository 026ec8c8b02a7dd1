// The photon map's hash grids beside a k-d tree: the same photons, radius and searches, one thread.
//
//   relief_bench_photon_map [--photons N] [--searches N] [--rounds N]
//
// Photons lie on a plane, denser towards a focus as 1/r. All have one radius, which is what a k-d tree searches best.
// Rounds alternate between both, so that whatever else the machine does hits both alike; the best of each is printed.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <vector>

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <CLI/CLI.hpp>
#include <nanoflann.hpp>

#include "integrator/photon_map.h"
#include "kernel/photon/gather.h"

namespace relief {

namespace {

/// What nanoflann reads points through.
struct PhotonCloud {
  std::vector<Photon> photons;
  std::size_t kdtree_get_point_count() const { return photons.size(); }
  float kdtree_get_pt(std::size_t i, std::size_t axis) const
  {
    const Vec3f& P = photons[i].P;
    return axis == 0 ? P.x : axis == 1 ? P.y : P.z;
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const
  {
    return false;
  }
};

using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, PhotonCloud>, PhotonCloud, 3>;

/// Adds photons up as the gather does: irradiance of one channel.
struct KernelSum {
  const PhotonCloud& cloud;
  Vec3f P;
  float radius_squared;
  double sum = 0;

  float worstDist() const { return radius_squared; }
  bool full() const { return true; }
  std::size_t size() const { return 0; }
  bool addPoint(float squared, std::size_t i)
  {
    const PhotonArrival& photon = cloud.photons[i].arrival;
    if (!(squared < radius_squared) || !(octahedral_decode(photon.Ng).y > 0.26f)) return true;
    if (!(octahedral_decode(photon.wi).y > 0.0f)) return true;
    sum += static_cast<double>((1.0f - squared / radius_squared) * photon.power.x);
    return true;
  }
};

double seconds_of(const std::function<void()>& work)
{
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

int run(int argc, char** argv)
{
  std::uint32_t num_photons = 1u << 17, num_searches = 1u << 17;
  int rounds = 9;
  CLI::App app("hash grids and k-d tree for photons");
  app.add_option("--photons", num_photons)->check(CLI::Range(1000, 100000000));
  app.add_option("--searches", num_searches)->check(CLI::Range(1, 100000000));
  app.add_option("--rounds", rounds)->check(CLI::Range(1, 1000));
  CLI11_PARSE(app, argc, argv);
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);

  const auto point = [](std::uint32_t seed, std::uint32_t i) {
    const Vec2f u = sample_2d(seed, i, 0);
    const float phi = 2.0f * kPi * u.y;
    return Vec3f{u.x * std::cos(phi), 0, u.x * std::sin(phi)};
  };
  PhotonCloud cloud;
  const std::uint32_t up = octahedral_encode({0, 1, 0});
  for (std::uint32_t i = 0; i < num_photons; ++i) cloud.photons.push_back({point(1, i), {splat3(1), up, up, 0}});
  const std::vector<std::vector<Photon>> chunks{cloud.photons};
  const float radius = photon_radius_for(chunks, 24);
  const std::vector<float> radii(num_photons, radius);
  std::vector<Vec3f> searches;
  for (std::uint32_t i = 0; i < num_searches; ++i) searches.push_back(point(2, i));

  PhotonMap map;
  double build[2] = {1e30, 1e30}, search[2] = {1e30, 1e30}, sums[2] = {};
  for (int round = 0; round < rounds; ++round) {
    build[0] = std::min(build[0], seconds_of([&] { map.build(chunks, radii); }));
    search[0] = std::min(search[0], seconds_of([&] {
                           sums[0] = 0;
                           const PhotonMapView view = map.view();
                           PhotonQuery query;
                           query.Ng = {0, 1, 0};
                           for (const Vec3f& P : searches) {
                             query.P = P;
                             sums[0] += static_cast<double>(photon_gather(view, query).irradiance.x);
                           }
                         }));
    Tree tree(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(16));
    build[1] = std::min(build[1], seconds_of([&] { tree.buildIndex(); }));
    search[1] = std::min(search[1], seconds_of([&] {
                           sums[1] = 0;
                           const double norm = 2.0 / (3.14159265358979 * static_cast<double>(sqr(radius)));
                           for (const Vec3f& P : searches) {
                             KernelSum found{cloud, P, sqr(radius)};
                             tree.findNeighbors(found, &P.x, nanoflann::SearchParams());
                             sums[1] += found.sum * norm;
                           }
                         }));
  }
  fmt::print("{} photons, radius {:.3g}, {} searches; ns a photon to build, ns a search, sum of irradiance\n",
             num_photons, radius, num_searches);
  const char* const names[] = {"hash grids", "k-d tree"};
  for (int i = 0; i < 2; ++i) {
    fmt::print("{:10} {:8.1f} {:8.1f} {:.6g}\n", names[i], build[i] / num_photons * 1e9, search[i] / num_searches * 1e9,
               sums[i]);
  }
  return std::abs(sums[0] / sums[1] - 1) < 1e-4 ? 0 : 1;
}

}  // namespace

}  // namespace relief

int main(int argc, char** argv) { return relief::run(argc, argv); }
