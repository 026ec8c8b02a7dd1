// Light by groups of lights: each layer against what its lights alone bring, and all against the picture.
#include <cmath>

#include "tests/support/render_scene.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

constexpr int kSize = 16;

/// A floor in the lower half of the picture, before the sky, lit by a sun, a lamp and something that glows, each of a group of
/// its own (1, 2 and 3), as the sky is (4).
Scene grouped_scene()
{
  Scene scene = empty_scene();
  scene.light_groups = {"sun", "lamp", "glow", "sky"};
  add_object(scene, quad_mesh({-9, -9, 0}, {18, 0, 0}, {0, 9, 0}), diffuse_material({0.5f, 0.5f, 0.5f}));
  Light sun;
  sun.kind = LightKind::kSun;
  sun.emission = {3, 2, 1};
  sun.light_group = 1;
  scene.lights.push_back(sun);
  Light lamp;
  lamp.kind = LightKind::kRectangle;
  lamp.P = {0.6f, 0.3f, 1};
  lamp.edge_u = {0.1f, 0, 0};
  lamp.edge_v = {0, -0.1f, 0};
  lamp.axis = {0, 0, -1};
  lamp.area = 0.04f;
  lamp.two_sided = true;
  lamp.emission = {5, 6, 7};
  lamp.light_group = 2;
  scene.lights.push_back(lamp);
  Material glow = diffuse_material({0.3f, 0.3f, 0.3f});
  glow.emission = {2, 4, 3};
  add_object(scene, sphere_mesh(0.3f, 16, 8, false), glow, {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {-0.7f, 0, 0.5f}});
  scene.instances.back().flags |= 3u << kLightGroupShift;
  scene.environment.color = {0.4f, 0.5f, 0.6f};
  scene.environment.light_group = 4;
  return scene;
}

Rendered rendered(const Scene& scene, int samples = 64)
{
  RenderOptions options = render_options(scene, kSize, samples);
  options.aov_mask = aov_bit(Aov::kBeauty) | aov_bit(Aov::kLightGroups);
  return render_scene(scene, options);
}

TEST(LightGroups, MakeThePictureTogether)
{
  const Rendered r = rendered(grouped_scene());
  ASSERT_EQ(r.image.view.layout.num_light_groups, 4);
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const float *groups = r.at(Aov::kLightGroups, x, y), *beauty = r.at(Aov::kBeauty, x, y);
      for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(groups[c] + groups[3 + c] + groups[6 + c] + groups[9 + c], beauty[c], 1e-4f * beauty[c] + 1e-6f);
      }
    }
  }
}

TEST(LightGroups, HaveWhatTheirLightsAloneBring)
{
  const Scene all = grouped_scene();
  const Rendered r = rendered(all, 1024);
  const auto mean_of = [](const Rendered& from, Aov aov, int channel) {
    double sum = 0;
    for (int y = 0; y < kSize; ++y) {
      for (int x = 0; x < kSize; ++x) sum += static_cast<double>(from.at(aov, x, y)[channel]);
    }
    return sum / (kSize * kSize);
  };
  for (int group = 0; group < 4; ++group) {
    Scene alone = all;
    if (group != 3) alone.environment.color = {};
    if (group != 2) alone.materials.back().emission = {};
    std::erase_if(alone.lights, [&](const Light& light) { return light.light_group != group + 1; });
    const Rendered expected = rendered(alone, 1024);
    for (int c = 0; c < 3; ++c) {
      const double found = mean_of(r, Aov::kLightGroups, 3 * group + c), wanted = mean_of(expected, Aov::kBeauty, c);
      EXPECT_GT(wanted, 0.01);
      EXPECT_NEAR(found, wanted, 0.01 * wanted) << group << " " << c;
    }
  }
}

TEST(LightGroups, OfASunIsItsIrradianceOnAFloor)
{
  Scene scene = grouped_scene();
  scene.instances.pop_back();
  scene.cameras[0].camera.projection = Projection::kOrthographic;
  const Rendered r = rendered(scene, 256);
  // Below the lamp's shadow.
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(static_cast<double>(r.at(Aov::kLightGroups, 8, 14)[c]), 0.5 * (3 - c) / 3.14159265358979, 0.02);
  }
}

}  // namespace
}  // namespace relief::test
