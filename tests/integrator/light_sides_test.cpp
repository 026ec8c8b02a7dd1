// Sides of glowing meshes that shine on nothing but the mesh itself: which are found, and that no light is lost by it.
#include <algorithm>

#include "integrator/scene_context.h"
#include "tests/support/render_scene.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

constexpr int kRuns = 16;
constexpr double kQuantile = 5.2;  // of Student's t at 1e-4, as in analytic_scenes_test.cpp

Material glow(float radiance)
{
  Material material = diffuse_material({});
  material.emission = splat3(radiance);
  material.double_sided = true;
  return material;
}

Affine3 at(Vec3f P)
{
  Affine3 placed;
  placed.p = P;
  return placed;
}

void turn_inside_out(Mesh& mesh)
{
  for (TriangleIndices& triangle : mesh.triangles) std::swap(triangle.v1, triangle.v2);
}

/// A floor seen through a narrow window, and what glows above it.
Scene floor_under(Mesh mesh, const Material& material, Vec3f P = {1.5f, 0, 2})
{
  Scene scene = empty_scene();
  scene.cameras[0].camera.half_width = scene.cameras[0].camera.half_height = 0.01f;
  scene.render.max_bounces = scene.render.diffuse_bounces = 0;
  add_object(scene, quad_mesh({-8, -8, 0}, {16, 0, 0}, {0, 16, 0}), diffuse_material({0.6f, 0.6f, 0.6f}));
  add_object(scene, std::move(mesh), material, at(P));
  return scene;
}

/// Of all lights, if they agree.
int dark_side(const Scene& scene)
{
  const SceneContext context(scene);
  const std::vector<Light>& lights = context.lights.lights;
  EXPECT_FALSE(lights.empty());
  for (const Light& light : lights) EXPECT_EQ(light.dark_side, lights[0].dark_side);
  return lights[0].dark_side;
}

Mesh ball() { return sphere_mesh(0.5f, 24, 12, false); }

TEST(LightSides, OfClosedMeshesTheInnerOneIsDark)
{
  EXPECT_EQ(dark_side(floor_under(ball(), glow(1))), -2);
  Mesh turned = ball();
  turn_inside_out(turned);
  EXPECT_EQ(dark_side(floor_under(turned, glow(1))), 2);
  // Mirrored, the winding turns; the front is still outside.
  Scene mirrored = floor_under(ball(), glow(1));
  mirrored.instances[1].world_from_object.x.x = -1;
  mirrored.instances[1].flags |= kMirrored;
  EXPECT_EQ(dark_side(mirrored), -2);
}

TEST(LightSides, OfCopiesTheInnerOneIsDark)
{
  Scene scene = floor_under(ball(), glow(1));
  for (const float x : {-2.0f, -1.0f, 3.0f}) {
    scene.instances.push_back(scene.instances[1]);
    scene.instances.back().world_from_object.p.x = x;
  }
  EXPECT_EQ(dark_side(scene), -2);
  EXPECT_EQ(SceneContext(scene).lights.copies.size(), 4u);
}

/// Without its ends.
Mesh tube()
{
  Mesh mesh = sphere_mesh(1, 12, 24, false);
  for (Vec3f& P : mesh.P) {
    const float across = std::sqrt(P.x * P.x + P.z * P.z);
    if (across > 1e-3f) P = {0.03f * P.x / across, P.y, 0.03f * P.z / across};
  }
  std::erase_if(mesh.triangles, [&](const TriangleIndices& t) {
    return std::max({std::abs(mesh.P[t.v0].y), std::abs(mesh.P[t.v1].y), std::abs(mesh.P[t.v2].y)}) > 0.999f;
  });
  return mesh;
}

TEST(LightSides, OfTubesTheInnerOneIsNearlyDark) { EXPECT_EQ(dark_side(floor_under(tube(), glow(1))), -1); }

TEST(LightSides, OfWhatLightGetsOutOfNoneIs)
{
  Mesh open = ball();
  std::erase_if(open.triangles, [&](const TriangleIndices& t) { return open.P[t.v0].y > 0.4f; });
  EXPECT_EQ(dark_side(floor_under(open, glow(1))), 0);
  EXPECT_EQ(dark_side(floor_under(quad_mesh({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}), glow(1))), 0);
  Material clear = glow(1);
  clear.alpha_mode = AlphaMode::kBlend;
  clear.base_alpha = 0.5f;
  EXPECT_EQ(dark_side(floor_under(ball(), clear)), 0);
  Material glass = glow(1);
  glass.transmission = 1;
  EXPECT_EQ(dark_side(floor_under(ball(), glass)), 0);
  Scene shadowless = floor_under(ball(), glow(1));
  shadowless.instances[1].flags &= ~kCastsShadow;
  EXPECT_EQ(dark_side(shadowless), 0);
  // Something is within, or nothing is without.
  Scene holder = floor_under(ball(), glow(1));
  add_object(holder, sphere_mesh(0.2f, 8, 4, false), diffuse_material({1, 1, 1}),
             holder.instances[1].world_from_object);
  EXPECT_EQ(dark_side(holder), 0);
  EXPECT_EQ(dark_side(floor_under(sphere_mesh(30, 24, 12, false), glow(1))), 0);
}

/// Where lights alone are sampled, both sides are.
TEST(LightSides, LoseNoLight)
{
  for (const bool inside_out : {false, true}) {
    Mesh mesh = ball();
    if (inside_out) turn_inside_out(mesh);
    const Scene scene = floor_under(mesh, glow(3));
    RenderOptions options = render_options(scene, 8, 64);
    const Estimate found = estimate_mean(scene, options, kRuns);
    options.light_technique = LightTechnique::kLightSampling;
    const Estimate all = estimate_mean(scene, options, kRuns);
    EXPECT_NEAR(found.mean, all.mean, kQuantile * (found.standard_error + all.standard_error));
    // A ball's irradiance by the inverse square, at a distance of 2.5 m and .6 of the floor's cosine off; of the mesh's polygons.
    EXPECT_NEAR(all.mean, 3 * 0.6 * 0.25 / 6.25 * 0.8, 0.03 * all.mean);
    EXPECT_LT(found.standard_error, 0.7 * all.standard_error);
  }
}

TEST(LightSides, LoseNoLightOfTubes)
{
  const Scene scene = floor_under(tube(), glow(3), {0.3f, 0.2f, 0.5f});
  RenderOptions options = render_options(scene, 8, 64);
  const Estimate found = estimate_mean(scene, options, kRuns);
  options.light_technique = LightTechnique::kLightSampling;
  const Estimate all = estimate_mean(scene, options, kRuns);
  EXPECT_NEAR(found.mean, all.mean, kQuantile * (found.standard_error + all.standard_error));
  EXPECT_LT(found.standard_error, 0.7 * all.standard_error);
}

/// What is too small to be found within a closed mesh is lit all the same: by radiance 3 from everywhere.
TEST(LightSides, WithinAClosedMeshLightIsFound)
{
  Scene scene = floor_under(sphere_mesh(30, 24, 12, false), glow(3), {});
  scene.instances.erase(scene.instances.begin());
  add_object(scene, quad_mesh({-0.05f, -0.05f, 0}, {0.1f, 0, 0}, {0, 0.1f, 0}), diffuse_material({0.6f, 0.6f, 0.6f}));
  add_object(scene, quad_mesh({-500, -500, -100}, {1000, 0, 0}, {0, 1000, 0}), diffuse_material({0.6f, 0.6f, 0.6f}));
  ASSERT_EQ(dark_side(scene), -2);
  const Estimate estimate = estimate_mean(scene, render_options(scene, 8, 64), kRuns);
  EXPECT_NEAR(estimate.mean, 3 * 0.6, kQuantile * estimate.standard_error + 1e-5);
}

}  // namespace
}  // namespace relief::test
