// Filter Glossy and Clamp Direct: what paths see after unlikely bounces is that of rougher surfaces, what the camera sees is not.
#include "tests/support/render_scene.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

/// A floor, which fills the picture, beside a mirror wall that shows it a lamp.
Scene mirrored_floor(float roughness)
{
  Scene scene = empty_scene();
  add_object(scene, quad_mesh({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}), diffuse_material({0.8f, 0.8f, 0.8f}));
  Material mirror;
  mirror.base_color = {1, 1, 1};
  mirror.metallic = 1;
  mirror.roughness = roughness;
  add_object(scene, quad_mesh({1, -1, 0}, {0, 2, 0}, {0, 0, 2}), mirror);
  Light disk;
  disk.kind = LightKind::kDisk;
  disk.P = {-1.5f, 0, 1};
  disk.axis = {1, 0, 0};
  disk.edge_u = {0, 0.5f, 0};
  disk.edge_v = {0, 0, 0.5f};
  disk.area = kPi * 0.25f;
  disk.emission = {20, 20, 20};
  scene.lights.push_back(disk);
  scene.render.caustics.mode = CausticsMode::kOff;
  scene.cameras.front().camera.half_width = scene.cameras.front().camera.half_height = 0.2f;
  return scene;
}

/// Mean over the picture and its standard error.
Estimate estimate(float roughness, float filter)
{
  const Scene scene = mirrored_floor(roughness);
  RenderOptions options = render_options(scene, 16, 256);
  options.settings.filter_glossy = filter;
  return estimate_mean(scene, options, 8);
}

/// The wall's width when the floor's paths meet it is half of the root of 1 − pdf / filter: a half if that is large.
TEST(FilterGlossy, MirrorsThatFloorsSeeAreRough)
{
  const float half = std::sqrt(0.5f);
  const Estimate smooth = estimate(0, 0), rough = estimate(half, 0), filtered = estimate(0, 1e6f);
  EXPECT_NEAR(filtered.mean, rough.mean, 5 * (filtered.standard_error + rough.standard_error));
  EXPECT_GT(std::abs(smooth.mean - rough.mean), 10 * (smooth.standard_error + rough.standard_error));
  // Diffuse bounces are likelier than this.
  const Estimate hardly = estimate(0, 1e-4f);
  EXPECT_NEAR(hardly.mean, smooth.mean, 5 * (hardly.standard_error + smooth.standard_error));
}

TEST(FilterGlossy, MirrorsThatTheCameraSeesStaySharp)
{
  const Scene scene = mirrored_floor(0);
  RenderOptions options = render_options(scene, 16, 16);
  options.camera.world_from_camera = {{0, -1, 0}, {0, 0, 1}, {-1, 0, 0}, {0.5f, 0, 1}};
  options.settings.max_bounces = 1;
  const Rendered off = render_scene(scene, options);
  options.settings.filter_glossy = 1e6f;
  const Rendered on = render_scene(scene, options);
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 16; ++x) EXPECT_EQ(off.radiance(x, y), on.radiance(x, y));
  }
}

TEST(ClampDirect, BoundsWhatComesAfterOneBounceAndLeavesTheRest)
{
  Scene scene = mirrored_floor(0);
  scene.instances.pop_back();
  scene.meshes.pop_back();
  RenderOptions options = render_options(scene, 16, 16);
  const Rendered free = render_scene(scene, options);
  options.settings.clamp_direct = 0.1f;
  const Rendered clamped = render_scene(scene, options);
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 16; ++x) {
      EXPECT_GT(free.radiance(x, y).x, 0.1f);
      // What is sampled by lamps and what is met are two contributions.
      EXPECT_LE(clamped.radiance(x, y).x, 0.2f);
      EXPECT_GT(clamped.radiance(x, y).x, 0.05f);
    }
  }
  options.settings.clamp_direct = 0;
  options.settings.clamp_indirect = 0.1f;
  const Rendered indirect = render_scene(scene, options);
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 16; ++x) EXPECT_EQ(indirect.radiance(x, y), free.radiance(x, y));
  }
}

}  // namespace
}  // namespace relief::test
