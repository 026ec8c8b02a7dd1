// Rays from inside closed displaced surfaces have to hit something: no gap between neighbouring triangles, at poles, at
// seams of uv or in Embree's boxes is wide enough for a ray, wherever it is aimed at.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "tests/displacement/closed_surfaces.h"

namespace relief {
namespace {

using oracle::Ray;
using oracle::Vector3;

class ClosedDisplacedSurface : public testing::TestWithParam<DisplacementMethod> {};

TEST_P(ClosedDisplacedSurface, LetsNoRayOut)
{
  for (const ClosedSurface& surface : {closed_sphere(), closed_torus(), seamed_box()}) {
    const TracedCase traced(surface.triangles, surface.map, HeightFormat::kFloat, 1, surface.weld_seams);
    DisplacedScene scene(traced.geometry(GetParam()), best_table());
    std::mt19937_64 random(97 + (test_part() << 32));
    Leaks leaks;
    const std::uint64_t num_rays = num_test_rays(150000) / 3;
    for (std::uint64_t k = 0; k < num_rays; ++k) {
      leaks.trace(scene, ray_from_inside(random, surface));
    }
    leaks.expect_none(surface.name);
  }
}

TEST_P(ClosedDisplacedSurface, ShadowRaysSeeWhatRaysHit)
{
  for (const ClosedSurface& surface : {closed_sphere(), closed_torus(), seamed_box()}) {
    const TracedCase traced(surface.triangles, surface.map, HeightFormat::kFloat, 1, surface.weld_seams);
    DisplacedScene scene(traced.geometry(GetParam()), best_table());
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
  for (const ClosedSurface& surface : {closed_sphere(), closed_torus(), seamed_box()}) {
    const TracedCase traced(surface.triangles, surface.map, HeightFormat::kFloat, 1, surface.weld_seams);
    const DisplacedGeometry geometry = traced.geometry(GetParam());
    DisplacedScene scene(geometry, best_table());
    std::mt19937_64 random(99);
    TraversalCounters counters;
    for (int k = 0; k < 1000; ++k) {
      const Ray ray = k % 2 == 0 ? ray_from_inside(random, surface)
                                 : ray_through(random_vector(random, 2, 4), random_vector(random, 0, 1.5));
      float nearest = HUGE_VALF;
      for (std::uint32_t index = 0; index < geometry.mesh.num_triangles; ++index) {
        DisplacedHit hit;
        if (best_table().trace(geometry, index, displaced_query(ray, false), &hit, &counters)) {
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
    DisplacedScene scene(traced.geometry(GetParam()), best_table());
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
                         testing::ValuesIn(traversing_methods()),
                         method_test_name);

}  // namespace
}  // namespace relief
