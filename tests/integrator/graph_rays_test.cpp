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
