// Levels of detail against the oracle: what a ray meets where its cone asks for one level after another.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "displacement/height_level.h"
#include "tests/displacement/closed_surfaces.h"

namespace relief {
namespace {

using oracle::HeightMap;
using oracle::Ray;

constexpr int kNumLevels = 3;

/// A level of the oracle's map, as the renderer averages it.
HeightMap level_of(const HeightMap& map, int level)
{
  if (level == 0) return map;
  const std::vector<float> heights(map.h.begin(), map.h.end());
  HeightMapView view;
  view.texels = heights.data();
  view.width = map.width;
  view.height = map.height;
  view.format = HeightFormat::kFloat;
  const HeightLevel coarse(view, level);
  HeightMap out = map;
  out.width = coarse.view().width;
  out.height = coarse.view().height;
  const auto* texels = static_cast<const float*>(coarse.view().texels);
  out.h.assign(texels, texels + out.width * out.height);
  return out;
}

/// A closed surface at all of its levels.
struct Levels {
  explicit Levels(const ClosedSurface& surface)
      : traced(surface.triangles, surface.map, HeightFormat::kFloat, kNumLevels, surface.weld_seams)
  {
    for (int k = 0; k < kNumLevels; ++k) maps.push_back(level_of(surface.map, k));
    for (const HeightMap& map : maps) meshes.emplace_back(surface.triangles, map);
  }

  TracedCase traced;
  std::vector<HeightMap> maps;
  std::vector<oracle::Mesh> meshes;
};

LodCone random_cone(std::mt19937_64& random, float texel)
{
  LodCone cone;
  cone.width = texel * static_cast<float>(random_between(random, 0, 4));
  cone.spread = random_index(random, 3) == 0 ? 0 : texel * static_cast<float>(random_between(random, 0, 6));
  return cone;
}

/// Where a ray must be stopped, by the roots of every level's surface where that level is seen, and at changes of level
/// that lead from outside of the one surface into the other or back (the surfaces are closed: parity of the roots beyond).
/// @param ambiguous  set where a root is uncertain, or too near to a change of level
/// @return           infinite: nowhere
double first_stop(const Levels& levels, const LodRule& rule, const LodCone& cone, const Ray& ray, bool* ambiguous)
{
  std::vector<double> changes;
  for (int level = lod_level(rule, cone, rule.texel, 0); level + 1 < kNumLevels; ++level) {
    const double change = lod_level_end(rule, cone, rule.texel, level, 0);
    if (change < HUGE_VAL && change > 0) changes.push_back(change);
  }
  double stop = HUGE_VAL;
  std::vector<std::vector<oracle::MeshHit>> roots;
  for (const oracle::Mesh& mesh : levels.meshes) roots.push_back(mesh.intersect_all(ray));
  for (int k = 0; k < kNumLevels; ++k) {
    for (const oracle::MeshHit& root : roots[static_cast<std::size_t>(k)]) {
      *ambiguous |= !root.hit.certain;
      for (const double change : changes) *ambiguous |= std::abs(change - root.hit.t) < 1e-6;
      if (lod_level(rule, cone, rule.texel, root.hit.t) == k) stop = std::min(stop, root.hit.t);
    }
  }
  for (const double change : changes) {
    const auto is_inside = [&](int level) {
      const auto& all = roots[static_cast<std::size_t>(level)];
      return std::count_if(all.begin(), all.end(), [&](const auto& root) { return root.hit.t > change; }) % 2 == 1;
    };
    const int after = lod_level(rule, cone, rule.texel, change * (1 + 1e-9));
    if (is_inside(after) != is_inside(after - 1)) stop = std::min(stop, change);
  }
  return stop;
}

class LevelsOfDetail : public testing::TestWithParam<DisplacementMethod> {};

TEST_P(LevelsOfDetail, AreMetWhereTheConeAsksForThem)
{
  const ClosedSurface surface = closed_torus();
  const Levels levels(surface);
  const DisplacedGeometry geometry = levels.traced.geometry(GetParam());
  DisplacedScene scene(geometry, best_table());
  std::mt19937_64 random(5);
  int num_judged = 0, num_walls = 0, num_by_level[kNumLevels] = {};
  for (int k = 0; k < 8000; ++k) {
    const Ray ray = k % 2 == 0 ? ray_from_inside(random, surface)
                               : ray_through(random_vector(random, 1, 2), random_vector(random, 0, 1.5));
    const LodCone cone = random_cone(random, geometry.lod.texel);
    bool ambiguous = false;
    const double expected = first_stop(levels, geometry.lod, cone, ray, &ambiguous);
    if (ambiguous) continue;
    ++num_judged;
    const RTCRayHit found = scene.hit(ray, cone);
    if (found.hit.geomID == RTC_INVALID_GEOMETRY_ID) {
      ASSERT_EQ(expected, HUGE_VAL) << ray_text(ray) << " cone " << cone.width << " " << cone.spread;
      continue;
    }
    const auto t = static_cast<double>(found.ray.tfar);
    ASSERT_NEAR(t, expected, 1e-6 * (1 + t)) << ray_text(ray) << " cone " << cone.width << " " << cone.spread;
    const int level = static_cast<int>(found.hit.Ng_x);
    ++num_by_level[level];
    const SurfacePoint point = displaced_surface_point(
        geometry, found.hit.primID, displaced_hit_decode({found.hit.u, found.hit.v, found.hit.Ng_x}));
    const double away =
        length(point.P - Vec3d{ray.O[0] + t * ray.D[0], ray.O[1] + t * ray.D[1], ray.O[2] + t * ray.D[2]});
    if (away > 1e-5) ++num_walls;
  }
  // Of each kind there were enough to fail.
  EXPECT_GE(num_judged, 2000);
  EXPECT_GE(num_walls, 20);
  for (const int count : num_by_level) EXPECT_GE(count, 100);
}

TEST_P(LevelsOfDetail, LetNoRayOutOfAClosedSurface)
{
  for (const ClosedSurface& surface : {closed_sphere(), closed_torus(), seamed_box()}) {
    const Levels levels(surface);
    const DisplacedGeometry geometry = levels.traced.geometry(GetParam());
    DisplacedScene scene(geometry, best_table());
    std::mt19937_64 random(6);
    std::string first;
    std::uint64_t num_leaks = 0, num_dark_leaks = 0;
    for (std::uint64_t k = 0; k < num_test_rays(90000) / 3; ++k) {
      const Ray ray = ray_from_inside(random, surface);
      const LodCone cone = random_cone(random, geometry.lod.texel);
      const bool leaks = !(scene.intersect(ray, cone) < HUGE_VALF), dark_leaks = !scene.occluded(ray, cone);
      if ((leaks || dark_leaks) && first.empty()) first = ray_text(ray);
      num_leaks += leaks ? 1 : 0;
      num_dark_leaks += dark_leaks ? 1 : 0;
    }
    EXPECT_EQ(num_leaks, 0u) << surface.name << " " << first;
    EXPECT_EQ(num_dark_leaks, 0u) << surface.name << " " << first;
  }
}

INSTANTIATE_TEST_SUITE_P(Displacement, LevelsOfDetail, testing::ValuesIn(traversing_methods()), method_test_name);

TEST(LodRule, LevelsEndWhereTheNextOneBegins)
{
  std::mt19937_64 random(7);
  for (int k = 0; k < 10000; ++k) {
    const LodRule rule{1 + random_index(random, 12), true, 0,
                       static_cast<float>(std::pow(10, random_between(random, -4, 2)))};
    LodCone cone;
    cone.width = rule.texel * static_cast<float>(std::pow(10, random_between(random, -2, 2)));
    cone.spread = random_index(random, 4) == 0 ? 0 : static_cast<float>(std::pow(10, random_between(random, -5, 0)));
    const double from = random_between(random, 0, 100);
    const int level = lod_level(rule, cone, rule.texel, from);
    const double end = lod_level_end(rule, cone, rule.texel, level, from);
    ASSERT_GE(end, from);
    if (end == HUGE_VAL) {
      EXPECT_EQ(lod_level(rule, cone, rule.texel, cone.spread > 0 ? 1e30 : 100.), level);
    } else {
      EXPECT_EQ(lod_level(rule, cone, rule.texel, from + .999999 * (end - from)), level);
      EXPECT_EQ(lod_level(rule, cone, rule.texel, end + 1e-6 * (end + 1)), level + 1);
    }
  }
}

TEST(LodRule, AFractionIsTheShareOfTheCoarserLevel)
{
  const LodRule rule{2, false, .3f, 1};
  LodCone cone;
  int num_coarse = 0;
  for (int k = 0; k < 1000; ++k) {
    cone.dither = (static_cast<float>(k) + .5f) / 1000;
    num_coarse += lod_level(rule, cone, 1, 0);
  }
  EXPECT_EQ(num_coarse, 300);
  EXPECT_EQ(lod_level_end(rule, cone, 1, 0, 0), HUGE_VAL);
}

TEST(LodRule, ARayThatLeavesASurfaceMeetsItOnTheSameLevel)
{
  std::mt19937_64 random(8);
  for (int k = 0; k < 10000; ++k) {
    const LodRule rule{8, true, 0, static_cast<float>(std::pow(10, random_between(random, -6, 6)))};
    const int level = random_index(random, 8);
    // The integrator keeps the width without the path's factor.
    const auto factor = static_cast<float>(random_between(random, .5, 1));
    LodCone cone;
    cone.width = factor * (lod_width_of_level(rule.texel, level) / factor);
    EXPECT_EQ(lod_level(rule, cone, rule.texel, 0), level);
  }
}

}  // namespace
}  // namespace relief
