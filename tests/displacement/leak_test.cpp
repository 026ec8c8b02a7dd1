// Rays from inside closed displaced surfaces have to hit something: no gap between neighbouring triangles, at poles, at
// seams of uv or in Embree's boxes is wide enough for a ray, wherever it is aimed at.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "displacement/embree.h"
#include "tests/displacement/hard_cases.h"
#include "tests/displacement/judge.h"
#include "tests/oracle/displaced_mesh.h"

namespace relief {
namespace {

using oracle::DisplacedTriangle;
using oracle::HeightMap;
using oracle::Ray;
using oracle::Vector2;
using oracle::Vector3;

struct ClosedSurface {
  std::string name;
  std::vector<DisplacedTriangle> triangles;
  HeightMap map;
  std::function<Vector3(std::mt19937_64&)> inside;  ///< a point within the surface
};

/// A globe with its poles on the z axis. The map repeats around it and is constant near the poles, where u is not
/// continuous.
ClosedSurface closed_sphere()
{
  constexpr int kNumU = 24, kNumV = 12, kWidth = 96, kHeight = 48;
  const auto P_of = [](int i, int j) -> Vector3 {
    if (j == 0 || j == kNumV) return {0, 0, j == 0 ? 1. : -1.};
    const double theta = hard_case_parts::kPi * j / kNumV, phi = 2 * hard_case_parts::kPi * (i % kNumU) / kNumU;
    return {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
  };
  ClosedSurface sphere{"sphere", hard_case_parts::grid_triangles(kNumU, kNumV, 1, 1, P_of, P_of),
                       hard_case_parts::noise_map(kWidth, kHeight, .2), [](std::mt19937_64& random) {
                         const double radius = random_index(random, 2) == 0 ? 0 : .5;
                         return random_vector(random, 0, radius);
                       }};
  sphere.map.wrap_v = oracle::Wrap::kClamp;
  constexpr std::size_t kConstantRows = 5;
  for (std::size_t row = 0; row < kHeight; ++row) {
    if (row >= kConstantRows && row < kHeight - kConstantRows) continue;
    for (std::size_t column = 0; column < kWidth; ++column) sphere.map.h[kWidth * row + column] = .5;
  }
  return sphere;
}

/// Periodic in u and v.
ClosedSurface closed_torus()
{
  constexpr int kNumAround = 20, kNumTube = 10;
  const auto angle_u = [](int i) { return 2 * hard_case_parts::kPi * (i % kNumAround) / kNumAround; };
  const auto angle_v = [](int j) { return -2 * hard_case_parts::kPi * (j % kNumTube) / kNumTube; };
  const auto N_of = [&](int i, int j) -> Vector3 {
    return {std::cos(angle_v(j)) * std::cos(angle_u(i)), std::cos(angle_v(j)) * std::sin(angle_u(i)),
            std::sin(angle_v(j))};
  };
  const auto P_of = [&](int i, int j) {
    return combination(.4, N_of(i, j), 1, {std::cos(angle_u(i)), std::sin(angle_u(i)), 0});
  };
  return {"torus", hard_case_parts::grid_triangles(kNumAround, kNumTube, 3, 2, P_of, N_of),
          hard_case_parts::noise_map(31, 17, .15), [](std::mt19937_64& random) {
            const double phi = random_between(random, 0, 2 * hard_case_parts::kPi);
            return combination(1, random_vector(random, 0, .1), 1, {std::cos(phi), std::sin(phi), 0});
          }};
}

/// Rays from inside in all directions; at corners, edges and next to them; along axes and along displacement lines.
Ray ray_from_inside(std::mt19937_64& random, const ClosedSurface& surface)
{
  const Vector3 O = surface.inside(random);
  const int num_triangles = static_cast<int>(surface.triangles.size());
  const DisplacedTriangle& triangle = surface.triangles[static_cast<std::size_t>(random_index(random, num_triangles))];
  const auto corner = static_cast<std::size_t>(random_index(random, 3));
  const double along = random_unit(random), beside = std::pow(10, random_between(random, -17, -5));
  const Vector2 edges[3] = {{along, 0}, {0, along}, {along, 1 - along}};
  const Vector2 corners[3] = {{0, 0}, {1, 0}, {0, 1}};
  switch (random_index(random, 8)) {
    case 0:
      return ray_through(O, oracle::surface_eval(triangle, surface.map, corners[corner]).P);
    case 1:
      return ray_through(O, oracle::surface_eval(triangle, surface.map, edges[corner]).P);
    case 2: {
      const Vector2 edge = edges[corner];
      const Vector2 b{edge[0] + beside * (1. / 3 - edge[0]), edge[1] + beside * (1. / 3 - edge[1])};
      return ray_through(O, oracle::surface_eval(triangle, surface.map, b).P);
    }
    case 3: {
      // Exactly along a corner's displacement line, which several triangles share.
      const Vector3 D = triangle.N[corner];
      return {float_rounded(combination(1, triangle.P[corner], -.25, D)), D, 0, HUGE_VAL};
    }
    case 4: {
      Vector3 D{};
      D[corner] = random_index(random, 2) == 0 ? 1 : -1;
      if (random_index(random, 2) == 0) D[(corner + 1) % 3] = float_rounded(random_between(random, -1, 1));
      return {float_rounded(O), D, 0, HUGE_VAL};
    }
    default:
      return ray_through(O, combination(1, O, 1, random_direction(random)));
  }
}

/// An Embree scene as the renderer makes it.
class DisplacedScene {
 public:
  DisplacedScene(const DisplacedGeometry& geometry, const TraversalTable& table) : geometry_(geometry)
  {
    device_ = rtcNewDevice(nullptr);
    scene_ = rtcNewScene(device_);
    rtcSetSceneBuildQuality(scene_, RTC_BUILD_QUALITY_HIGH);
    rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);
    RTCGeometry made = displaced_geometry_make(device_, geometry_, table);
    rtcCommitGeometry(made);
    rtcAttachGeometry(scene_, made);
    rtcReleaseGeometry(made);
    rtcCommitScene(scene_);
    embree_context_init(context_, false);
  }
  ~DisplacedScene()
  {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  DisplacedScene(const DisplacedScene&) = delete;
  DisplacedScene& operator=(const DisplacedScene&) = delete;

  /// @return  t of the nearest hit; infinite: none
  float intersect(const Ray& ray)
  {
    RTCRayHit query{};
    query.ray = embree_ray(ray);
    query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    embree_intersect1(scene_, context_, query);
    return query.hit.geomID != RTC_INVALID_GEOMETRY_ID ? query.ray.tfar : HUGE_VALF;
  }
  bool occluded(const Ray& ray)
  {
    RTCRay query = embree_ray(ray);
    embree_occluded1(scene_, context_, query);
    return query.tfar < 0;
  }

 private:
  static RTCRay embree_ray(const Ray& ray)
  {
    RTCRay result{};
    const Vec3f O = TracedCase::vector3(ray.O), D = TracedCase::vector3(ray.D);
    result.org_x = O.x;
    result.org_y = O.y;
    result.org_z = O.z;
    result.dir_x = D.x;
    result.dir_y = D.y;
    result.dir_z = D.z;
    result.tnear = static_cast<float>(ray.t_min);
    result.tfar = static_cast<float>(ray.t_max);
    result.mask = ~0u;
    return result;
  }

  DisplacedGeometry geometry_;
  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
  EmbreeContext context_;
};

std::string ray_text(const Ray& ray)
{
  std::ostringstream out;
  out.precision(9);
  out << "O " << ray.O[0] << " " << ray.O[1] << " " << ray.O[2] << " D " << ray.D[0] << " " << ray.D[1] << " "
      << ray.D[2] << " t in " << ray.t_min << " " << ray.t_max;
  return out.str();
}

const TraversalTable& best_table()
{
  const bool has_avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  return has_avx2 ? traversal_table_avx2() : traversal_table_baseline();
}

class ClosedDisplacedSurface : public testing::TestWithParam<TraversalMethodLabel> {};

TEST_P(ClosedDisplacedSurface, LetsNoRayOut)
{
  for (const ClosedSurface& surface : {closed_sphere(), closed_torus()}) {
    const TracedCase traced(surface.triangles, surface.map);
    DisplacedScene scene(traced.geometry(GetParam().method), best_table());
    std::mt19937_64 random(97);
    std::uint64_t num_leaks = 0, num_dark_leaks = 0;
    std::string first;
    const std::uint64_t num_rays = num_test_rays(100000) / 2;
    for (std::uint64_t k = 0; k < num_rays; ++k) {
      const Ray ray = ray_from_inside(random, surface);
      const bool leaks = !(scene.intersect(ray) < HUGE_VALF), dark_leaks = !scene.occluded(ray);
      if ((leaks || dark_leaks) && first.empty()) first = ray_text(ray);
      num_leaks += leaks ? 1 : 0;
      num_dark_leaks += dark_leaks ? 1 : 0;
    }
    EXPECT_EQ(num_leaks, 0u) << surface.name << " " << first;
    EXPECT_EQ(num_dark_leaks, 0u) << surface.name << " " << first;
  }
}

TEST_P(ClosedDisplacedSurface, ShadowRaysSeeWhatRaysHit)
{
  for (const ClosedSurface& surface : {closed_sphere(), closed_torus()}) {
    const TracedCase traced(surface.triangles, surface.map);
    DisplacedScene scene(traced.geometry(GetParam().method), best_table());
    std::mt19937_64 random(98);
    for (int k = 0; k < 30000; ++k) {
      // Segments between any two points, many of which end near the surface.
      Ray ray = k % 2 == 0 ? ray_from_inside(random, surface)
                           : ray_through(random_vector(random, 0, 2), random_vector(random, 0, 1.5));
      if (random_index(random, 2) == 0) ray.t_min = float_rounded(random_between(random, 0, .9));
      if (random_index(random, 2) == 0) ray.t_max = float_rounded(ray.t_min + random_between(random, 0, 1));
      const float t = scene.intersect(ray);
      ASSERT_EQ(scene.occluded(ray), t < HUGE_VALF) << surface.name << " " << ray_text(ray) << ": t " << t;
    }
  }
}

TEST_P(ClosedDisplacedSurface, IsFoundThroughEmbreeWhereAllTrianglesTogetherFindIt)
{
  for (const ClosedSurface& surface : {closed_sphere(), closed_torus()}) {
    const TracedCase traced(surface.triangles, surface.map);
    const DisplacedGeometry geometry = traced.geometry(GetParam().method);
    DisplacedScene scene(geometry, best_table());
    std::mt19937_64 random(99);
    TraversalCounters counters;
    for (int k = 0; k < 1000; ++k) {
      const Ray ray = k % 2 == 0 ? ray_from_inside(random, surface)
                                 : ray_through(random_vector(random, 2, 4), random_vector(random, 0, 1.5));
      float nearest = HUGE_VALF;
      for (std::uint32_t index = 0; index < geometry.mesh.num_triangles; ++index) {
        DisplacedHit hit;
        if (best_table().trace(geometry, index, TracedCase::vector3(ray.O), TracedCase::vector3(ray.D), ray.t_min,
                               ray.t_max, false, &hit, &counters)) {
          nearest = std::min(nearest, static_cast<float>(hit.t));
        }
      }
      ASSERT_EQ(scene.intersect(ray), nearest) << surface.name << " " << ray_text(ray);
    }
  }
}

TEST_P(ClosedDisplacedSurface, RootsOnSharedEdgesAreFoundByOneOfTheTriangles)
{
  std::uint64_t num_shared = 0;
  for (const HardCase& hard_case : hard_cases()) {
    if (hard_case.triangles.size() < 3) continue;
    const TracedCase traced(hard_case.triangles, hard_case.map);
    DisplacedScene scene(traced.geometry(GetParam().method), best_table());
    const oracle::Mesh mesh(hard_case.triangles, hard_case.map);
    for (const Ray& ray : hard_case.rays) {
      const std::vector<oracle::MeshHit> roots = mesh.intersect_all(ray);
      const float t = scene.intersect(ray);
      const auto cosine = [&](const oracle::MeshHit& root) {
        const Vector3& Ng = root.hit.Ng;
        return (Ng[0] * ray.D[0] + Ng[1] * ray.D[1] + Ng[2] * ray.D[2]) / vector_length(ray.D);
      };
      for (std::size_t k = 0; k + 1 < roots.size(); ++k) {
        const oracle::MeshHit &root = roots[k], &next = roots[k + 1];
        const bool on_edge = !root.hit.certain && !next.hit.certain && root.triangle_index != next.triangle_index;
        // Both sides of the edge are seen from the same side, and not just touched: the ray goes through.
        const bool crosses =
            cosine(root) * cosine(next) > 0 && std::abs(cosine(root)) > 1e-3 && std::abs(cosine(next)) > 1e-3;
        const double rounding = 1e-6 * std::abs(root.hit.t);
        if (!on_edge || !crosses || next.hit.t - root.hit.t > rounding) continue;
        ++num_shared;
        EXPECT_LE(t, next.hit.t_high + rounding) << hard_case.name << " " << ray_text(ray);
      }
    }
  }
  EXPECT_GE(num_shared, 100u);
}

INSTANTIATE_TEST_SUITE_P(Displacement,
                         ClosedDisplacedSurface,
                         testing::ValuesIn(kTraversalMethods),
                         [](const auto& each) {
                           std::string name(each.param.name);
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

}  // namespace
}  // namespace relief
