// Levels of detail in the renderer: rays that leave a surface see it as the ray that found it did.
#include <cmath>
#include <memory>
#include <numbers>
#include <utility>

#include "integrator/scene_displacement.h"
#include "tests/support/render_scene.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

constexpr int kSize = 512;

/// A height field, many texels a pixel, seen and lit from above.
/// @param scale  metres: the root of the slopes' mean square of noise is 74 times that
Scene noisy_plane(float scale, std::vector<std::uint16_t> texels = noise_texels(kSize, 3))
{
  Scene scene = empty_scene();
  Mesh plane = quad_mesh({-2, -2, 0}, {4, 0, 0}, {0, 4, 0});
  plane.uv[0] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  Material material = diffuse_material({1, 1, 1});
  material.displacement_index = 0;
  add_object(scene, plane, material);
  add_displacement(scene, kSize, std::move(texels), scale).lod = -1;
  Light sun;
  sun.kind = LightKind::kSun;
  sun.axis = {0, 0, -1};
  sun.emission = {1, 1, 1};
  scene.lights.push_back(sun);
  scene.render.max_bounces = scene.render.diffuse_bounces = 0;
  return scene;
}

/// Hills 64 texels wide, which all levels that rays choose have, with noise of a 250th of their height, which they lose.
std::vector<std::uint16_t> hill_texels()
{
  std::vector<std::uint16_t> texels = noise_texels(kSize, 3);
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      std::uint16_t& texel = texels[static_cast<std::size_t>(y * kSize + x)];
      const double phase = 2 * std::numbers::pi / 64;
      texel = static_cast<std::uint16_t>(32'000 + 15'000 * (std::sin(phase * x) + std::sin(phase * y)) + texel / 250.);
    }
  }
  return texels;
}

TEST(LevelOfDetail, OfShadowRaysIsThatOfTheSurfaceTheyLeave)
{
  // Nothing of a height field is in the shade of a sun straight above it, at any level; only a ray that starts on one
  // level and meets another is. A bounced ray's cone grows faster than the levels that it meets get coarser, so that after a
  // bounce it matters what the surface says of its level.
  Scene scene = noisy_plane(0.2f, hill_texels());
  scene.render.max_bounces = scene.render.diffuse_bounces = 2;
  const RenderOptions options = render_options(scene, 16, 256);
  const Rendered shaded = render_scene(scene, options);
  scene.instances[0].flags &= ~std::uint32_t{kCastsShadow};
  const Rendered unshaded = render_scene(scene, options);
  ASSERT_GT(unshaded.mean(), 0.05);
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 16; ++x) EXPECT_EQ(shaded.radiance(x, y), unshaded.radiance(x, y)) << x << ", " << y;
  }
  // The pixels did ask for other levels than the finest.
  RenderOptions finest = options;
  finest.displacement.lod = 0.0f;
  EXPECT_NE(unshaded.mean(), render_scene(scene, finest).mean());
}

TEST(LevelOfDetail, OfAHitIsWhatLeavingRaysStartWith)
{
  const Scene scene = noisy_plane(0.003f);
  DisplacementSet displacements = scene_displacement(scene, {});
  const int num_levels = displacements.geometry(0).lod.num_levels;
  ASSERT_GT(num_levels, 1);
  const float texel = displacements.texels()[0];
  for (int level = 0; level < num_levels; ++level) {
    const DisplacedPoint point = displacements.resolve(0, {}, 0, {0.2f, 0.3f, static_cast<float>(level)});
    EXPECT_EQ(point.width, lod_width_of_level(texel, level));
  }
}

TEST(LevelOfDetail, IsTheFinestWhereSlopesAreThePicture)
{
  EXPECT_FALSE(scene_displacement(noisy_plane(0.03f), {}).has_levels());
  // Half a pixel: a few spikes have little slope on the mean.
  Scene spikes = noisy_plane(0.1f);
  auto texels = std::make_shared<std::vector<std::uint16_t>>(512 * 512);
  for (std::size_t k = 0; k < texels->size(); k += 32'000) (*texels)[k] = 65535;
  spikes.height_maps[0].texels = std::shared_ptr<const void>(texels, texels->data());
  EXPECT_FALSE(scene_displacement(spikes, {}).has_levels());
}

TEST(LevelOfDetail, OfAnUnevenInstanceIsThatOfItsSteepestSlopes)
{
  const auto num_levels = [](const Scene& scene) { return scene_displacement(scene, {}).geometry(0).lod.num_levels; };
  Scene gentle = noisy_plane(0.001f), steep = noisy_plane(0.004f);
  ASSERT_GT(num_levels(gentle), 1);
  ASSERT_EQ(num_levels(steep), 1);
  // Four times as high, turned, and under a shear whose singular values are 4 and 1/4 (its columns are no longer than
  // 3.9): the same slopes as the steep one's, or possibly so.
  const Affine3 transforms[] = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 4}, {}},
                                {{0, 0, 1}, {1, 0, 0}, {0, 4, 0}, {}},
                                {{1, 0, 0}, {3.75f, 1, 0}, {0, 0, 1}, {}}};
  for (const Affine3& transform : transforms) {
    gentle.instances[0].world_from_object = transform;
    EXPECT_EQ(num_levels(gentle), 1);
  }
  for (const float size : {1e-12f, 1.0f, 1e12f}) {
    gentle.instances[0].world_from_object = {{size, 0, 0}, {0, 1.001f * size, 0}, {0, 0, size}, {}};
    EXPECT_GT(num_levels(gentle), 1) << size;
  }
  const Affine3 even{{0, 0, 300}, {300, 0, 0}, {0, -300, 0}, {1, 2, 3}};
  gentle.instances[0].world_from_object = even;
  EXPECT_GT(num_levels(gentle), 1);
  // The levels are those of all instances.
  gentle.instances.push_back(gentle.instances[0]);
  gentle.instances[1].world_from_object = transforms[0];
  EXPECT_EQ(num_levels(gentle), 1);
}

/// As much flatter as their instance is uneven, slopes are no steeper than the gentle ones, however little of the largest
/// stretch's square the squares of the others are: one or two of them are less than its rounding.
TEST(LevelOfDetail, KnowsTheLeastOfAnyStretches)
{
  for (const float most : {1e3f, 1e6f, 1e8f, 1e9f, 1e12f}) {
    const Affine3 transforms[] = {{{most, 0, 0}, {0, 1, 0}, {0, 0, 1}, {}},
                                  {{1, 0, 0}, {0, 0, most}, {0, -most, 0}, {}},
                                  {{0, 0, most}, {1, 0, 0.5f * most}, {0, 1, 0}, {}}};
    for (const Affine3& transform : transforms) {
      Scene gentle = noisy_plane(0.001f / most), steep = noisy_plane(0.004f / most);
      gentle.instances[0].world_from_object = steep.instances[0].world_from_object = transform;
      EXPECT_GT(scene_displacement(gentle, {}).geometry(0).lod.num_levels, 1) << most;
      EXPECT_EQ(scene_displacement(steep, {}).geometry(0).lod.num_levels, 1) << most;
    }
  }
  Scene line = noisy_plane(0.001f);
  line.instances[0].world_from_object = {{1, 0, 0}, {0, 0, 0}, {0, 0, 0}, {}};
  EXPECT_EQ(scene_displacement(line, {}).geometry(0).lod.num_levels, 1);
}

TEST(LevelOfDetail, AsksForTexelsAsAnInstanceStretchesThemAtMost)
{
  Scene scene = noisy_plane(0.001f);
  const float texel = scene_displacement(scene, {}).texels()[0];
  scene.instances[0].world_from_object = {{0, 0, 300}, {300, 0, 0}, {0, -300, 0}, {1, 2, 3}};
  EXPECT_FLOAT_EQ(scene_displacement(scene, {}).texels()[0], 300 * texel);
  // The columns' lengths are 1, 3.88 and 1.
  scene.instances[0].world_from_object = {{1, 0, 0}, {3.75f, 1, 0}, {0, 0, 1}, {}};
  EXPECT_FLOAT_EQ(scene_displacement(scene, {}).texels()[0], 4 * texel);
}

TEST(LevelOfDetail, ChangesThePictureByNoMoreThanItsTolerance)
{
  // From slopes that all levels may lose to some that none may, with bounces and a low sun, whose shadows they change.
  bool some_differ = false, some_agree = false;
  for (const float scale : {0.001f, 0.0025f, 0.004f, 0.006f, 0.01f, 0.03f}) {
    Scene scene = noisy_plane(scale);
    scene.lights[0].axis = normalize(Vec3f{-1, 0, -0.6f});
    scene.render.max_bounces = scene.render.diffuse_bounces = 3;
    RenderOptions options = render_options(scene, 16, 512);
    const double chosen = render_scene(scene, options).mean();
    options.displacement.lod = 0.0f;
    const double finest = render_scene(scene, options).mean();
    // An eighth of the square of the slopes lost, of which a third is the most.
    EXPECT_NEAR(chosen / finest, 1, 0.014) << scale;
    (chosen == finest ? some_agree : some_differ) = true;
  }
  EXPECT_TRUE(some_differ && some_agree);
}

}  // namespace
}  // namespace relief::test
