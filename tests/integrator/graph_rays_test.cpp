// What Ambient Occlusion and Bevel ask of the scene: which part of a hemisphere is open, and what is around a point.
#include <gtest/gtest.h>

#include <cmath>

#include "integrator/graph_rays.h"
#include "integrator/scene_context.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

/// Share that is open over the middle of the first object, a floor at height 0. Z is up in questions.
float open_share(const Scene& scene, float distance, std::int32_t instance)
{
  const SceneContext context(scene);
  GraphOpenShare question{};
  question.Ng = question.N = {0, 0, 1};
  question.wo = {0.6f, 0, 0.8f};
  question.distance = distance;
  question.num_rays = 64;
  question.instance = instance;
  const GraphRays rays = graph_rays_make(context);
  return rays.open_share(rays.scene, question);
}

Mesh horizontal(float height) { return quad_mesh({-9, height, 9}, {18, 0, 0}, {0, 0, -18}); }

TEST(OpenShare, IsAllOverASurfaceThatIsAlone)
{
  // Where all coordinates along the normal are 0, nothing moves a ray's origin off the surface.
  Scene scene = empty_scene();
  add_object(scene, horizontal(0), diffuse_material({1, 1, 1}));
  EXPECT_EQ(open_share(scene, 5, -1), 1.0f);
  EXPECT_EQ(open_share(scene, 5, 0), 1.0f);
}

TEST(OpenShare, OfOneObjectLooksPastOthers)
{
  // A floor with a ceiling of its own, and another object's sheet in between.
  Scene scene = empty_scene();
  Mesh room = horizontal(0);
  const Mesh ceiling = horizontal(0.5f);
  const auto first = static_cast<std::uint32_t>(room.P.size());
  room.P.insert(room.P.end(), ceiling.P.begin(), ceiling.P.end());
  room.N.insert(room.N.end(), ceiling.N.begin(), ceiling.N.end());
  for (int set = 0; set < 2; ++set) {
    room.uv[set].insert(room.uv[set].end(), ceiling.uv[set].begin(), ceiling.uv[set].end());
  }
  for (const TriangleIndices& t : ceiling.triangles) {
    room.triangles.push_back({t.v0 + first, t.v1 + first, t.v2 + first});
  }
  add_object(scene, room, diffuse_material({1, 1, 1}));
  EXPECT_LT(open_share(scene, 9, 0), 0.1f);
  add_object(scene, horizontal(0.25f), diffuse_material({1, 1, 1}));
  EXPECT_LT(open_share(scene, 9, 0), 0.1f);
  EXPECT_EQ(open_share(scene, 0.4f, 0), 1.0f);
  EXPECT_LT(open_share(scene, 0.4f, -1), 1.0f);
}

TEST(OpenShare, OfOneObjectKnowsAllItsMaterials)
{
  Scene scene = empty_scene();
  add_object(scene, horizontal(0), diffuse_material({1, 1, 1}));
  add_object(scene, horizontal(0.5f), diffuse_material({1, 1, 1}));
  EXPECT_EQ(open_share(scene, 9, 0), 1.0f);
  for (Instance& instance : scene.instances) instance.object_index = 3;
  EXPECT_LT(open_share(scene, 9, 0), 0.1f);
}

/// Normal at (x, 0, 0) of the floor with Z up, by so many rays that it has hardly any noise.
Vec3f beveled(const Scene& scene, float x, float radius)
{
  const SceneContext context(scene);
  const GraphBevel question{{x, 0, 0}, {0, 0, 1}, {0.6f, 0, 0.8f}, radius, 1 << 17, 0, 0.0f};
  const GraphRays rays = graph_rays_make(context);
  return rays.bevel(rays.scene, question);
}

/// A floor for x < 0, and at x = 0 a cliff down from it that faces +x.
Scene cliff()
{
  Scene scene = empty_scene();
  add_object(scene, quad_mesh({-9, 0, 9}, {9, 0, 0}, {0, 0, -18}), diffuse_material({1, 1, 1}));
  add_object(scene, quad_mesh({0, 0, 9}, {0, -9, 0}, {0, 0, -18}), diffuse_material({1, 1, 1}));
  for (Instance& instance : scene.instances) instance.object_index = 0;
  return scene;
}

/// How much faces x to the floor's side, by sums over a fine grid of each half-plane.
double slope_by_sums(double x, double radius)
{
  constexpr int kSteps = 2000;
  const double step = 2 * radius / kSteps;
  double floor = 0, wall = 0;
  for (int i = 0; i < kSteps; ++i) {
    for (int k = 0; k < kSteps; ++k) {
      const double a = (i + 0.5) * step - radius, y = (k + 0.5) * step - radius;
      const auto weight = [&](double squared) {
        const double left = radius - std::sqrt(squared);
        return left > 0 ? left * left * left : 0.0;
      };
      if (x + a < 0) floor += weight(a * a + y * y);     // the place (x + a, y, 0)
      if (a < 0) wall += weight(x * x + a * a + y * y);  // (0, y, a)
    }
  }
  return wall / floor;
}

TEST(Bevel, DistancesAreThoseOfTheirShares)
{
  EXPECT_EQ(bevel_distance(1.0f), 0.0f);
  for (int i = 0; i <= 4000; ++i) {
    // Where r and 1 − r are small as well. Shares near 1 are rounded: what is asked for is another one.
    const double part = i / 4000.0, r = part * part * (3 - 2 * part);
    const auto share_of = [](double x) { return std::pow(1 - x, 4) * (1 + 4 * x); };
    const auto u = static_cast<float>(share_of(r));
    const double rounded =
        std::abs(static_cast<double>(u) - share_of(r)) / std::max(20 * r * std::pow(1 - r, 3), 1e-12);
    if (rounded < 1e-7) {
      EXPECT_NEAR(static_cast<double>(bevel_distance(u)), r, 2e-6) << r;
    }
  }
}

TEST(Bevel, IsTheSameBesideADisplacedObject)
{
  // Where something is displaced, a ray's hits are looked for one after the other: the same ones as otherwise at once.
  Scene scene = cliff();
  add_object(scene, quad_mesh({-9, -0.1f, 9}, {18, 0, 0}, {0, 0.2f, -18}), diffuse_material({1, 1, 1}));
  scene.instances.back().object_index = 0;
  const Vec3f at_once = beveled(scene, -0.1f, 0.5f);
  EXPECT_GT(at_once.x, 0.01f);
  add_object(scene, horizontal(-50), diffuse_material({1, 1, 1}));
  add_displacement(scene, 2, {0, 1, 2, 3}, 0.1f);
  scene.materials.back().displacement_index = 0;
  const Vec3f one_by_one = beveled(scene, -0.1f, 0.5f);
  for (const float difference : {at_once.x - one_by_one.x, at_once.y - one_by_one.y, at_once.z - one_by_one.z}) {
    EXPECT_NEAR(difference, 0.0f, 1e-5f);
  }
}

TEST(Bevel, IsTheSameOfInstances)
{
  // Meshes that occur twice have trees of their own; so small in so large a world those are not Embree's instances.
  Scene scene = cliff();
  const Vec3f in_place = beveled(scene, -0.1f, 0.5f);
  const std::vector<Instance> placed = scene.instances;
  for (const float away : {40.0f, 4e6f}) {
    scene.instances = placed;
    for (Instance instance : placed) {
      instance.world_from_object.p = {away, 0, 0};
      instance.object_index = 1;
      scene.instances.push_back(instance);
    }
    const Vec3f N = beveled(scene, -0.1f, 0.5f);
    EXPECT_NEAR(N.x, in_place.x, 1e-5f) << away;
    EXPECT_NEAR(N.z, in_place.z, 1e-5f) << away;
  }
}

TEST(Bevel, LooksFartherThanItsSceneIsWide)
{
  // Many rays start far away from the scene then, and nearness weighs floor and wall alike.
  const Vec3f N = beveled(cliff(), -0.1f, 400.0f);
  EXPECT_NEAR(N.x, std::sqrt(0.5f), 0.05f);
  EXPECT_NEAR(N.z, std::sqrt(0.5f), 0.05f);
}

TEST(Bevel, OfAPlaneIsThePlane)
{
  Scene scene = empty_scene();
  add_object(scene, horizontal(0), diffuse_material({1, 1, 1}));
  const Vec3f N = beveled(scene, 0.3f, 0.5f);
  EXPECT_NEAR(N.z, 1.0f, 1e-6f);
}

TEST(Bevel, IsTheMeanOfNormalsAround)
{
  const Scene scene = cliff();
  for (const float x : {-0.01f, -0.1f, -0.3f, -0.6f}) {
    const Vec3f N = beveled(scene, x, 0.5f);
    EXPECT_NEAR(N.x / N.z, slope_by_sums(static_cast<double>(x), 0.5), 0.01) << x;
    EXPECT_NEAR(N.y, 0.0f, 0.01f) << x;
  }
}

TEST(Bevel, LooksAtItsOwnObjectAlone)
{
  Scene scene = cliff();
  for (Instance& instance : scene.instances) instance.object_index = -1;
  EXPECT_NEAR(beveled(scene, -0.01f, 0.5f).z, 1.0f, 1e-6f);
  // Nothing is met within no distance.
  EXPECT_TRUE(is_zero(beveled(scene, -0.01f, 0.0f)));
}

}  // namespace
}  // namespace relief::test
