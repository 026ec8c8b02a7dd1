// What Ambient Occlusion asks of the scene: which part of a hemisphere is open.
#include <gtest/gtest.h>

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
  const GraphRays rays = graph_rays_make(*context.accel);
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

}  // namespace
}  // namespace relief::test
