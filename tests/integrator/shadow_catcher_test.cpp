// Shadow catchers: what the picture shows of them, against closed forms.
#include <cmath>

#include "tests/support/render_scene.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

constexpr int kSize = 16;
constexpr AovMask kPicture = aov_bit(Aov::kBeauty);
constexpr AovMask kWithLayer = kPicture | aov_bit(Aov::kShadowCatcher) | aov_bit(Aov::kHoldout);

/// A floor that catches shadows, of 4 m around the origin, seen straight from above: 1.6 m of it are.
Scene catcher_scene(Vec3f color = {0.5f, 0.5f, 0.5f})
{
  Scene scene = empty_scene();
  scene.cameras[0].camera.projection = Projection::kOrthographic;
  scene.cameras[0].camera.half_width = scene.cameras[0].camera.half_height = 0.8f;
  scene.environment.color = {};
  scene.environment.visible_to_camera = false;
  add_object(scene, quad_mesh({-2, -2, 0}, {4, 0, 0}, {0, 4, 0}), diffuse_material(color));
  scene.instances.back().flags |= kShadowCatcher;
  return scene;
}

/// Adds something black that the camera does not see.
void add_hidden(Scene& scene, Vec3f P, Vec3f u, Vec3f v)
{
  Material black = diffuse_material({0, 0, 0});
  black.double_sided = true;
  add_object(scene, quad_mesh(P, u, v), black);
  scene.instances.back().flags &= ~std::uint32_t{kVisibleToCamera};
}

/// A lid over the left half of the floor.
void add_lid(Scene& scene) { add_hidden(scene, {-3, -3, 1}, {3, 0, 0}, {0, 6, 0}); }

void add_sun(Scene& scene, Vec3f irradiance, Vec3f axis = {0, 0, -1})
{
  Light sun;
  sun.kind = LightKind::kSun;
  sun.emission = irradiance;
  sun.axis = normalize(axis);
  scene.lights.push_back(sun);
}

Rendered rendered(const Scene& scene, AovMask mask, int samples = 16, float noise_threshold = 0)
{
  RenderOptions options = render_options(scene, kSize, samples);
  options.aov_mask = mask;
  options.settings.noise_threshold = noise_threshold;
  return render_scene(scene, options);
}

/// Mean of a channel over columns of the picture.
double mean(const Rendered& r, Aov aov, int channel, int first, int last)
{
  double sum = 0;
  for (int y = 0; y < kSize; ++y) {
    for (int x = first; x <= last; ++x) sum += static_cast<double>(r.at(aov, x, y)[channel]);
  }
  return sum / (kSize * (last - first + 1));
}

double alpha(const Rendered& r, int first, int last) { return mean(r, Aov::kBeauty, 3, first, last); }

TEST(ShadowCatcher, ABlockedSunLeavesAWholeShadowAndNoColour)
{
  Scene scene = catcher_scene();
  add_sun(scene, {3, 2, 1});
  add_lid(scene);
  for (const float threshold : {0.0f, 0.1f}) {
    const Rendered r = rendered(scene, kPicture, 64, threshold);
    for (int y = 0; y < kSize; ++y) {
      for (int x = 0; x < kSize; ++x) {
        for (int c = 0; c < 3; ++c) EXPECT_EQ(r.at(Aov::kBeauty, x, y)[c], 0.0f);
        EXPECT_EQ(r.at(Aov::kBeauty, x, y)[3], x < kSize / 2 ? 1.0f : 0.0f) << x << " " << y;
      }
    }
  }
}

TEST(ShadowCatcher, ItsLayerHasTheLightThatIsLeftByChannels)
{
  Scene scene = catcher_scene();
  add_sun(scene, {1, 1, 1});
  // As bright on the floor, and low enough to stand behind a wall beside it.
  add_sun(scene, {std::sqrt(101.0f), 0, 0}, {1, 0, -0.1f});
  add_hidden(scene, {-2.5f, -3, 0}, {0, 6, 0}, {0, 0, 0.5f});
  const Rendered layer = rendered(scene, kWithLayer, 256), picture = rendered(scene, kPicture, 256);
  EXPECT_NEAR(mean(layer, Aov::kShadowCatcher, 0, 0, kSize - 1), 0.5, 0.01);
  EXPECT_NEAR(mean(layer, Aov::kShadowCatcher, 1, 0, kSize - 1), 1, 1e-6);
  EXPECT_NEAR(mean(layer, Aov::kShadowCatcher, 2, 0, kSize - 1), 1, 1e-6);
  EXPECT_EQ(alpha(layer, 0, kSize - 1), 0.0) << "the picture is without the shadow then";
  EXPECT_EQ(mean(layer, Aov::kHoldout, 0, 0, kSize - 1), 1.0);
  EXPECT_NEAR(alpha(picture, 0, kSize - 1), 0.5 / 3, 0.01);
}

// A wall of height h at a distance d hides (1 − d/√(d² + h²))/2 of an even sky, weighted by the cosine.
TEST(ShadowCatcher, AWallTakesItsShareOfAnEvenSky)
{
  Scene scene = catcher_scene();
  scene.environment.color = {0.7f, 0.9f, 0.8f};
  constexpr float kFar = 1e3f;
  add_hidden(scene, {-1, -kFar, 0}, {0, 2 * kFar, 0}, {0, 0, 2});
  for (const bool shows_sky : {false, true}) {
    scene.environment.visible_to_camera = shows_sky;
    const Rendered r = rendered(scene, kPicture, 1024);
    for (int x = 0; x < kSize; ++x) {
      const double d = 1 + 1.6 * (x + 0.5) / kSize - 0.8;
      const double hidden = (1 - d / std::sqrt(d * d + 4)) / 2;
      EXPECT_NEAR(alpha(r, x, x), hidden, 0.01) << x;
      const double sky = shows_sky ? 0.9 * (1 - hidden) : 0.0;
      EXPECT_NEAR(mean(r, Aov::kBeauty, 1, x, x), sky, 0.01) << x;
    }
  }
}

TEST(ShadowCatcher, WhereNothingElseIsItLeavesThePictureAsItIs)
{
  Scene scene = catcher_scene();
  scene.environment.color = {0.7f, 0.9f, 0.8f};
  add_sun(scene, {3, 2, 1}, {1, 0.5f, -1});
  // Catchers shadow each other, and light each other up, in the footage.
  add_object(scene, sphere_mesh(0.4f, 16, 8, false), diffuse_material({0.9f, 0.2f, 0.2f}));
  scene.instances.back().flags |= kShadowCatcher;
  for (const bool shows_sky : {false, true}) {
    scene.environment.visible_to_camera = shows_sky;
    const Rendered r = rendered(scene, kPicture), layer = rendered(scene, kWithLayer);
    for (int y = 0; y < kSize; ++y) {
      for (int x = 0; x < kSize; ++x) {
        EXPECT_EQ(r.at(Aov::kBeauty, x, y)[3], 0.0f);
        EXPECT_NEAR(r.at(Aov::kBeauty, x, y)[0], shows_sky ? 0.7f : 0.0f, 1e-6f);
        for (int c = 0; c < 3; ++c) EXPECT_EQ(layer.at(Aov::kShadowCatcher, x, y)[c], 1.0f);
      }
    }
  }
}

TEST(ShadowCatcher, InTheDarkThereIsNoShadow)
{
  Scene scene = catcher_scene();
  add_lid(scene);
  const Rendered r = rendered(scene, kPicture), layer = rendered(scene, kWithLayer);
  EXPECT_EQ(alpha(r, 0, kSize - 1), 0.0);
  EXPECT_EQ(mean(layer, Aov::kShadowCatcher, 0, 0, kSize - 1), 1.0);
}

TEST(ShadowCatcher, LightThatIsNotOfTheFootageBrightens)
{
  for (const bool is_mesh : {false, true}) {
    Scene scene = catcher_scene();
    add_sun(scene, {1, 1, 1});
    if (is_mesh) {
      // A glowing sky of a square, which the floor sees π/2 of: irradiance 1 with a radiance of 1/(share · π).
      Material glow = diffuse_material({0, 0, 0});
      glow.emission = {1, 1, 1};
      glow.double_sided = true;
      add_object(scene, quad_mesh({-1e3f, -1e3f, 5}, {2e3f, 0, 0}, {0, 2e3f, 0}), glow);
      scene.instances.back().flags &= ~std::uint32_t{kVisibleToCamera | kCastsShadow};
    } else {
      add_sun(scene, {kPi, kPi, kPi});
      scene.lights.back().in_footage = false;
    }
    const Rendered layer = rendered(scene, kWithLayer, 256);
    EXPECT_NEAR(mean(layer, Aov::kShadowCatcher, 0, 0, kSize - 1), 1 + static_cast<double>(kPi), 0.03) << is_mesh;
    EXPECT_EQ(alpha(rendered(scene, kPicture), 0, kSize - 1), 0.0) << is_mesh;
  }
}

TEST(ShadowCatcher, WhatIsBehindIsNotSeenAndWhatIsBeforeIsWhole)
{
  Scene scene = catcher_scene();
  Material glow = diffuse_material({0, 0, 0});
  glow.emission = {2, 1, 3};
  add_object(scene, quad_mesh({-2, -2, -1}, {4, 0, 0}, {0, 4, 0}), glow);
  add_object(scene, quad_mesh({0, -2, 1}, {2, 0, 0}, {0, 4, 0}), glow);
  const Rendered r = rendered(scene, kPicture);
  EXPECT_EQ(mean(r, Aov::kBeauty, 0, 0, kSize / 2 - 1), 0.0);
  EXPECT_EQ(alpha(r, 0, kSize / 2 - 1), 0.0);
  EXPECT_EQ(mean(r, Aov::kBeauty, 2, kSize / 2, kSize - 1), 3.0);
  EXPECT_EQ(alpha(r, kSize / 2, kSize - 1), 1.0);
}

TEST(ShadowCatcher, APaneBeforeItTintsItsShadowAndCoversWhatItTakes)
{
  Scene scene = catcher_scene();
  add_sun(scene, {1, 1, 1}, {1, 0, -1});
  // Light comes by another way than the camera's rays.
  add_hidden(scene, {-4, -3, 1}, {2.5f, 0, 0}, {0, 6, 0});
  Material pane = diffuse_material({0, 0, 0});
  pane.base_alpha = 0.25f;
  pane.alpha_mode = AlphaMode::kBlend;
  add_object(scene, quad_mesh({-2, -2, 3}, {4, 0, 0}, {0, 4, 0}), pane);
  scene.instances.back().flags &= ~std::uint32_t{kCastsShadow};
  const Rendered r = rendered(scene, kPicture, 1024);
  // The lid's shadow ends at x = −0.5.
  EXPECT_NEAR(alpha(r, 0, 1), 1.0, 1e-3);
  EXPECT_NEAR(alpha(r, 8, kSize - 1), 0.25, 0.01);
}

TEST(ShadowCatcher, MirrorsAndHiddenOnesShowAnObject)
{
  Scene scene = catcher_scene();
  add_sun(scene, {kPi, kPi, kPi}, {0, 0, 1});
  // Seen by the camera in a mirror below alone: it is lit from there, too.
  scene.instances.back().flags &= ~std::uint32_t{kVisibleToCamera};
  Material mirror = diffuse_material({1, 1, 1});
  mirror.metallic = 1;
  mirror.roughness = 0;
  add_object(scene, quad_mesh({-2, -2, -1}, {4, 0, 0}, {0, 4, 0}), mirror);
  scene.instances.back().flags &= ~std::uint32_t{kCastsShadow};
  scene.materials[0].double_sided = true;
  // By the mirror to the floor, and no further.
  scene.render.max_bounces = 2;
  const Rendered r = rendered(scene, kPicture);
  EXPECT_NEAR(mean(r, Aov::kBeauty, 0, 0, kSize - 1), 0.5, 1e-3);
  EXPECT_EQ(alpha(r, 0, kSize - 1), 1.0);
}

}  // namespace
}  // namespace relief::test
