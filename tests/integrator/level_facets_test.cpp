// What levels of height maps have lost: facets of the map, and pictures that keep its light.
#include <algorithm>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "integrator/scene_displacement.h"
#include "tests/support/render_scene.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

constexpr int kSize = 512;

/// A square of 4 m of noise that a camera above sees whole.
/// @param scale  metres: the root of the slopes' mean square is 74 times that
/// @param lod    level of the map
Scene noisy_square(float scale, float lod, const Affine3& world_from_object = {})
{
  Scene scene = empty_scene();
  Mesh plane = quad_mesh({-2, -2, 0}, {4, 0, 0}, {0, 4, 0});
  plane.uv[0] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  Material material = diffuse_material({1, 1, 1});
  material.displacement_index = 0;
  add_object(scene, plane, material, world_from_object);
  add_displacement(scene, kSize, noise_texels(kSize, 3), scale).lod = lod;
  scene.render.max_bounces = scene.render.diffuse_bounces = 8;
  return scene;
}

void add_low_sun(Scene& scene)
{
  Light sun;
  sun.kind = LightKind::kSun;
  sun.axis = normalize(Vec3f{-1, 0, -0.6f});
  sun.emission = {1, 1, 1};
  scene.lights.push_back(sun);
}

InstanceView placement_of(const Scene& scene)
{
  InstanceView placement;
  placement.world_from_object = scene.instances[0].world_from_object;
  placement.object_from_world = inverse(placement.world_from_object);
  return placement;
}

/// A point in the square's first half, whose displacement normal is +z of object space.
DisplacedPoint point_of(const DisplacementSet& displacements, const Scene& scene, float u, float v)
{
  return displacements.resolve(0, placement_of(scene), 0, {u, v, 0.0f});
}

TEST(LevelFacets, LambdaIsTheAreaThatFacesAway)
{
  std::mt19937 random(1);
  std::normal_distribution<float> normal;
  for (int k = 0; k < 20; ++k) {
    const auto direction = [&] { return normalize(Vec3f{normal(random), normal(random), normal(random)}); };
    const FacetMoments m{direction(), {0.7f * direction(), 0.4f * direction()}};
    const Vec3f w = direction();
    double away = 0, away_squared = 0, all = dot(w, m.mean);
    constexpr int kCount = 400'000;
    for (int i = 0; i < kCount; ++i) {
      const double shown = dot(w, m.mean + normal(random) * m.deviation[0] + normal(random) * m.deviation[1]);
      if (shown < 0) away -= shown;
      if (shown < 0) away_squared += shown * shown;
    }
    away /= kCount;
    const double error = std::sqrt((away_squared / kCount - away * away) / kCount);
    // Of 20 such, one in 80,000 is beyond 5 standard errors by chance.
    EXPECT_NEAR(static_cast<double>(facet_lambda(m, w)) * all, away, 5 * error + 1e-5) << k;
  }
}

TEST(LevelFacets, LambdaOfFlatOnesIsThatOfASmoothSurface)
{
  const FacetMoments flat{{0, 0, 1}, {}};
  EXPECT_EQ(facet_lambda(flat, {0.6f, 0, 0.8f}), 0.0f);
  EXPECT_EQ(facet_lambda(flat, {0.6f, 0, -0.8f}), -1.0f);
  EXPECT_EQ(facets_leave_chance(0.3f, 0.0f), 1.0f);
  EXPECT_EQ(facets_leave_chance(0.3f, -1.0f), 0.0f);
}

/// What facets get together is what the level gets; where light comes from below the level or through a facet, none of those
/// that face it from above get any.
TEST(LevelFacets, ShareTheLightOfTheLevel)
{
  std::mt19937_64 random(3);
  std::normal_distribution<float> normal;
  std::uniform_real_distribution<float> uniform;
  FacetState f{};
  f.moments = {{0, 0, 1}, {{0.7f, 0.1f, 0}, {0, 0.4f, 0}}};
  for (const float side : {1.0f, -1.0f}) {
    f.side = side;
    for (const Vec3f above : {Vec3f{0, 0, 1}, normalize(Vec3f{1, 0.5f, 1}), normalize(Vec3f{-1, 0, 0.3f})}) {
      const Vec3f wi = side * above;
      double sum = 0, squares = 0;
      constexpr int kCount = 400'000;
      for (int i = 0; i < kCount; ++i) {
        const Vec3f facet =
            f.moments.mean + normal(random) * f.moments.deviation[0] + normal(random) * f.moments.deviation[1];
        f.height = 1.0f - uniform(random);
        f.normal = normalize(facet);
        const double light = static_cast<double>(length(facet) * facet_irradiance_factor(f, wi));
        if (dot(f.normal, above) <= 0.0f) {
          ASSERT_EQ(light, 0.0);
        }
        sum += light;
        squares += light * light;
      }
      const double mean = sum / kCount;
      // Six such: one in 300,000 is beyond 5 standard errors by chance.
      EXPECT_NEAR(mean, 1, 5 * std::sqrt(std::max(squares / kCount - mean * mean, 0.0) / kCount) + 1e-6);
    }
    // Over the facet, but from below the level; through the facet, from below it.
    f.height = 0.5f;
    f.normal = normalize(Vec3f{1, 0, 1});
    EXPECT_EQ(facet_irradiance_factor(f, side * normalize(Vec3f{1, 0, -0.2f})), 0.0f);
    EXPECT_NEAR(facet_irradiance_factor(f, side * Vec3f{0, 0, -1}), std::sqrt(0.5f), 1e-6f);
  }
}

/// Facets and level together have the slopes of the map, in all directions.
TEST(LevelFacets, HaveTheSlopesThatTheLevelLost)
{
  // Uneven and mirrored.
  const Affine3 placement{{-2, 0, 0}, {0, 1, 0}, {0, 0, 1}, {}};
  for (const float lod : {1.0f, 2.0f, 3.0f}) {
    const Scene coarse = noisy_square(0.006f, lod, placement), fine = noisy_square(0.006f, 0, placement);
    const DisplacementSet levels = scene_displacement(coarse, {}), map = scene_displacement(fine, {});
    const InstanceView instance = placement_of(coarse);
    std::mt19937 random(7);
    std::uniform_real_distribution<float> uniform;
    double expected[2] = {0, 0}, got[2] = {0, 0};
    for (int k = 0; k < 20'000; ++k) {
      const float u = 0.5f * uniform(random), v = 0.5f * uniform(random);
      const auto slope = [&](Vec3f n, int axis) { return static_cast<double>((axis == 0 ? n.x : n.y) / n.z); };
      const Vec3f n = transform_normal(instance.object_from_world, as_normal(point_of(map, fine, u, v).Ng));
      const DisplacedPoint point = point_of(levels, coarse, u, v);
      ASSERT_EQ(point.level, lod);
      LevelFacets facets;
      ASSERT_TRUE(levels.facets(0, {instance, 0, point.u, point.v, point.level, point.P, point.Ng},
                                {uniform(random), uniform(random)}, &facets));
      for (int axis = 0; axis < 2; ++axis) {
        expected[axis] += slope(n, axis) * slope(n, axis);
        for (int i = 0; i < kLevelFacets; ++i) {
          const double s = slope(facets.normal + facets.x[i] * facets.per_x + facets.y[i] * facets.per_y, axis);
          got[axis] += s * s / kLevelFacets;
        }
      }
    }
    for (int axis = 0; axis < 2; ++axis) EXPECT_NEAR(got[axis] / expected[axis], 1, 0.05) << lod << ", " << axis;
  }
}

TEST(LevelFacets, AreSeenByTheAreaThatTheyShow)
{
  LevelFacets facets{{0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {}, {}};
  for (int k = 0; k < kLevelFacets; ++k) facets.x[k] = k < 4 ? 3.0f : -1.0f;
  const Vec3f w{0.6f, 0, 0.8f};
  // 4 · (.8 + 1.8) of 4 · 2.6 + 12 · .2.
  Vec3f n;
  ASSERT_TRUE(facet_choose(facets, w, 0.80f, &n));
  EXPECT_GT(n.x, 0);
  ASSERT_TRUE(facet_choose(facets, w, 0.82f, &n));
  EXPECT_LT(n.x, 0);
  EXPECT_FALSE(facet_choose(facets, -w, 0.5f, &n));
}

/// White under white light from everywhere is white, whatever its facets do to each other.
TEST(LevelFacets, KeepAllEnergy)
{
  Scene scene = noisy_square(0.02f, 3);
  scene.environment.color = {1, 1, 1};
  scene.render.max_bounces = scene.render.diffuse_bounces = 200;
  const Rendered rendered = render_scene(scene, render_options(scene, 16, 1024));
  EXPECT_NEAR(rendered.mean(), 1, 0.003);
}

/// Light and shadow, one bounce on the other. Averaged heights alone change the mean by an eighth of the square of the slope
/// lost (docs/displacement.md); with facets it is a fifth of that, where noise of the picture is a thousandth.
TEST(LevelFacets, KeepTheMeanOfThePicture)
{
  for (const float scale : {0.003f, 0.006f, 0.01f}) {
    Scene scene = noisy_square(scale, 0);
    add_low_sun(scene);
    const RenderOptions options = render_options(scene, 16, 1024);
    const double exact = render_scene(scene, options).mean();
    const double slope = 74.0 * static_cast<double>(scale);
    for (const float lod : {1.0f, 1.5f, 2.0f, 4.0f}) {
      scene.displacements[0].lod = lod;
      EXPECT_NEAR(render_scene(scene, options).mean() / exact, 1, 0.001 + slope * slope / 40) << scale << ", " << lod;
    }
  }
}

TEST(LevelFacets, OfAFlatMapChangeNothing)
{
  Scene scene = noisy_square(0.01f, 0);
  add_low_sun(scene);
  scene.height_maps.clear();
  scene.displacements.clear();
  add_displacement(scene, 64, std::vector<std::uint16_t>(64 * 64, 1234), 0.01f);
  const RenderOptions options = render_options(scene, 8, 4);
  const double exact = render_scene(scene, options).mean();
  scene.displacements[0].lod = 2;
  EXPECT_NEAR(render_scene(scene, options).mean() / exact, 1, 1e-6);
}

}  // namespace
}  // namespace relief::test
