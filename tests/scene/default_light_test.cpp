// What lights a scene that says nothing of light: its own emission, or the soft studio.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "kernel/texture/half.h"
#include "scene/default_light.h"
#include "tests/support/loaded_scene.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

using nlohmann::json;

Material glowing(float radiance)
{
  Material m = diffuse_material({0.5f, 0.5f, 0.5f});
  m.emission = splat3(radiance);
  return m;
}

Affine3 at(Vec3f P, float scale = 1)
{
  Affine3 m;
  m.x = m.x * scale, m.y = m.y * scale, m.z = m.z * scale;
  m.p = P;
  return m;
}

bool is_lit(const Scene& scene)
{
  std::vector<Placement> placements;
  for (const Instance& i : scene.instances) {
    placements.push_back({i.mesh_index, i.material_index, i.world_from_object});
  }
  return emission_lights_scene(scene, placements, scene.textures->views());
}

/// A ball whose emission texture is black but for some texels of white.
Scene ball_with_lights(int num_white, float radiance)
{
  Scene scene = empty_scene();
  constexpr int kSide = 64;
  std::vector<float> rgb(3 * kSide * kSide, 0.0f);
  for (int i = 0; i < num_white; ++i) {
    const auto texel = static_cast<std::size_t>(i * 1021 % (kSide * kSide));
    std::fill_n(rgb.begin() + static_cast<std::ptrdiff_t>(3 * texel), 3, 1.0f);
  }
  Warnings warnings;
  auto store = std::make_shared<TextureStore>(std::vector<TextureRequest>{}, 0, warnings);
  Material material = glowing(radiance);
  material.emission_texture.texture_index = store->add_image("lights", kSide, kSide, rgb, Wrap::kRepeat, Wrap::kRepeat);
  scene.textures = store;
  Mesh ball = sphere_mesh(1, 48, 24, true);
  for (const Vec3f p : ball.P) {
    ball.uv[0].push_back({std::atan2(p.x, p.z) / (2 * kPi) + 0.5f, std::acos(std::clamp(p.y, -1.0f, 1.0f)) / kPi});
  }
  add_object(scene, std::move(ball), material);
  return scene;
}

TEST(DefaultLight, LightsOnAModelDoNotLightIt)
{
  EXPECT_FALSE(is_lit(ball_with_lights(80, 1)));      // 2 % of the surface, as on a helmet
  EXPECT_FALSE(is_lit(ball_with_lights(80, 20)));     // with KHR_materials_emissive_strength
  EXPECT_TRUE(is_lit(ball_with_lights(4096, 0.3f)));  // light is baked into all of it
}

TEST(DefaultLight, GlowingPartsOfAModelDoNotLightIt)
{
  Scene scene = empty_scene();
  add_object(scene, sphere_mesh(1, 48, 24, true), diffuse_material({0.5f, 0.5f, 0.5f}));
  add_object(scene, quad_mesh({-0.1f, -0.1f, 1}, {0.2f, 0, 0}, {0, 0.2f, 0}), glowing(5));
  EXPECT_FALSE(is_lit(scene));
}

TEST(DefaultLight, WhatGlowsAsDarkGreyDoesIsNoLamp)
{
  EXPECT_FALSE(is_lit(ball_with_lights(4096, 0.11f)));
}

TEST(DefaultLight, ALampInARoomLightsIt)
{
  Scene scene = empty_scene();
  for (const float side : {-1.0f, 1.0f}) {
    add_object(scene, quad_mesh({2 * side, -2, -2 * side}, {0, 0, 4 * side}, {0, 4, 0}),
               diffuse_material(splat3(0.5f)));
    add_object(scene, quad_mesh({-2, 2 * side, -2}, {4, 0, 0}, {0, 0, -4 * side}), diffuse_material(splat3(0.5f)));
  }
  add_object(scene, quad_mesh({-0.25f, 1.99f, -0.25f}, {0.5f, 0, 0}, {0, 0, 0.5f}), glowing(50));
  EXPECT_TRUE(is_lit(scene));
  // The same one as a copy, scaled unevenly.
  Scene copy = scene;
  copy.meshes.back() = quad_mesh({-1, 0, -1}, {2, 0, 0}, {0, 0, 2});
  copy.instances.back().world_from_object = at({0, 1.99f, 0});
  copy.instances.back().world_from_object.x = {0.25f, 0, 0};
  copy.instances.back().world_from_object.z = {0, 0, 0.25f};
  EXPECT_TRUE(is_lit(copy));
  // Turned over, it shines into the ceiling.
  copy.instances.back().world_from_object.x = {-0.25f, 0, 0};
  copy.instances.back().world_from_object.y = {0, -1, 0};
  EXPECT_FALSE(is_lit(copy));
  scene.materials.back().emission = splat3(2);
  EXPECT_FALSE(is_lit(scene));
}

TEST(DefaultLight, ALampOverAWideFloorLightsWhatIsNear)
{
  Scene scene = empty_scene();
  add_object(scene, quad_mesh({-1000, 0, 1000}, {2000, 0, 0}, {0, 0, -2000}), diffuse_material(splat3(0.5f)));
  for (const float x : {-2.0f, 0.0f, 2.0f}) {
    add_object(scene, sphere_mesh(1, 24, 12, true), diffuse_material(splat3(0.5f)), at({x, 1, 0}));
  }
  add_object(scene, sphere_mesh(0.5f, 24, 12, true), glowing(10), at({0, 4, 2}));
  EXPECT_TRUE(is_lit(scene));
}

TEST(DefaultLight, OneLargeLampAmongManySmallOnesCounts)
{
  Scene scene = empty_scene();
  add_object(scene, sphere_mesh(0.001f, 8, 4, true), glowing(1), at({50, 0, 0}));
  for (int i = 1; i < 3000; ++i) {
    Instance copy = scene.instances.front();
    copy.world_from_object = at({50, 0, static_cast<float>(i)});
    scene.instances.push_back(copy);
  }
  for (int i = 0; i < 4000; ++i) {
    add_object(scene, quad_mesh({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}), diffuse_material(splat3(0.5f)));
  }
  EXPECT_FALSE(is_lit(scene));
  add_object(scene, quad_mesh({-1, -1, 3}, {0, 2, 0}, {2, 0, 0}), glowing(5));
  EXPECT_TRUE(is_lit(scene));
}

bool has_studio(const Scene& scene)
{
  const bool has = scene.environment.texture_index >= 0 && !is_zero(scene.environment.color);
  EXPECT_EQ(has, has_warning(scene, "a soft studio lights it"));
  if (has) {
    EXPECT_EQ(scene.textures->label(scene.environment.texture_index), "studio");
    EXPECT_TRUE(scene.environment.visible_to_camera);
    EXPECT_TRUE(scene.environment.backdrop.has_value());
    if (scene.environment.backdrop) {
      EXPECT_EQ(scene.textures->label(scene.environment.backdrop->texture_index), "backdrop");
    }
  }
  return has;
}

GltfBuilder glowing_square(const json& material)
{
  GltfBuilder b = square_scene();
  b.push("materials", material);
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  return b;
}

TEST(DefaultLight, IsThereUnlessTheFileSaysOtherwise)
{
  EXPECT_TRUE(has_studio(load(square_scene())));
  GltfBuilder lamp = square_scene();
  lamp.json["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}, {"intensity", 0}}};
  EXPECT_TRUE(has_studio(load(lamp)));  // no node has it
  lamp.root_node({{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  EXPECT_FALSE(has_studio(load(lamp)));
  GltfBuilder area = square_scene();
  area.root_node({{"extensions", {{"RELIEF_area_light", {{"power", 1}}}}}});
  EXPECT_FALSE(has_studio(load(area)));
  // A black environment is one: the add-on writes it for worlds without strength.
  GltfBuilder black = square_scene();
  black.json["extensions"]["RELIEF_environment"] = {{"color", {0, 0, 0}}};
  EXPECT_FALSE(has_studio(load(black)));
  EXPECT_TRUE(is_zero(load(black).environment.color));
}

TEST(DefaultLight, EmissionIsEnoughWhereItIsAllThatIsSeen)
{
  EXPECT_FALSE(has_studio(load(glowing_square({{"emissiveFactor", {1, 1, 1}}}))));
  EXPECT_TRUE(has_studio(load(glowing_square({{"emissiveFactor", {0.01, 0.01, 0.01}}}))));
  const Scene dim = load(glowing_square({{"emissiveFactor", {0.01, 0.01, 0.01}}}));
  EXPECT_TRUE(has_warning(dim, "emission that leaves most of the scene dark"));
}

TEST(DefaultLight, NothingIsThereForWhatIsUnlit)
{
  const Scene unlit = load(glowing_square({{"extensions", {{"KHR_materials_unlit", json::object()}}}}));
  EXPECT_FALSE(has_studio(unlit));
  // Beside something that reflects it is there for that.
  GltfBuilder both = glowing_square({{"extensions", {{"KHR_materials_unlit", json::object()}}}});
  json mesh = both.json["meshes"][0];
  mesh["primitives"][0].erase("material");
  both.root_node({{"mesh", both.push("meshes", mesh)}, {"translation", {2, 0, 0}}});
  EXPECT_TRUE(has_studio(load(both)));
}

TEST(DefaultLight, IsTheSameInEveryFrame)
{
  // The lamp, and the glowing square, shrink to nothing within a second.
  const auto shrinking = [](GltfBuilder b, int node) {
    const int times = b.accessor<float>({0, 1}, "SCALAR");
    const int scales = b.accessor<float>({1, 1, 1, 0, 0, 0}, "VEC3");
    b.json["animations"] = {{{"samplers", {{{"input", times}, {"output", scales}}}},
                             {"channels", {{{"sampler", 0}, {"target", {{"node", node}, {"path", "scale"}}}}}}}};
    return b;
  };
  GltfBuilder lamp = square_scene();
  lamp.json["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}}};
  const int node = lamp.root_node({{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  GltfBuilder glow = glowing_square({{"emissiveFactor", {1, 1, 1}}});
  glow.root_node({{"mesh", 0}, {"translation", {1, 0, 0}}});
  GltfBuilder dark = square_scene();
  dark.root_node({{"mesh", 0}, {"translation", {1, 0, 0}}});
  for (const int frame : {0, 12, 24, 48}) {
    LoadOptions options;
    options.has_frame = true;
    options.frame = frame;
    EXPECT_FALSE(has_studio(load(shrinking(lamp, node), options))) << frame;
    EXPECT_FALSE(has_studio(load(shrinking(glow, 0), options))) << frame;
    EXPECT_TRUE(has_studio(load(shrinking(dark, 0), options))) << frame;
  }
}

TEST(EnvironmentChoice, TakesTheSceneSurroundingsPlace)
{
  GltfBuilder b = square_scene();
  b.json["images"] = {{{"uri", kPixelPng}}};
  b.json["extensions"]["RELIEF_environment"] = {{"image", 0}, {"strength", 9}, {"visibleToCamera", false}};
  LoadOptions options;
  const auto with = [&](EnvironmentSource source) {
    options.environment = EnvironmentChoice{source, "", 2};
    return load(b, options);
  };
  const Scene sky = with(EnvironmentSource::kSky);
  EXPECT_EQ(sky.environment.color, (Vec3f{2, 2, 2}));
  EXPECT_TRUE(sky.environment.visible_to_camera);
  EXPECT_EQ(sky.textures->views().size(), 1u);  // what it stands for is not read
  EXPECT_EQ(sky.textures->label(0), "sky");
  EXPECT_TRUE(with(EnvironmentSource::kStudio).environment.visible_to_camera);
  EXPECT_EQ(with(EnvironmentSource::kNone).environment.color, (Vec3f{0, 0, 0}));
  options.environment_visible = true;
  EXPECT_TRUE(with(EnvironmentSource::kStudio).environment.visible_to_camera);
  options.environment.reset();
  EXPECT_TRUE(load(b, options).environment.visible_to_camera);
}

TEST(EnvironmentPresets, WhiteIsWhiteAndShapesShow)
{
  for (const EnvironmentSource source : {EnvironmentSource::kStudio, EnvironmentSource::kSky}) {
    const EnvironmentMap map = environment_preset_make(source);
    ASSERT_EQ(map.rgb.size(), static_cast<std::size_t>(3 * map.width * map.height));
    EXPECT_TRUE(std::all_of(map.rgb.begin(), map.rgb.end(), [](float v) { return v > 0 && v < kHalfMax; }));
    // Irradiance by π of surfaces that look up, down, and where the lamp or the sun is.
    const auto irradiance = [&](Vec3f n) {
      n = normalize(n);
      double sum = 0;
      for (int y = 0; y < map.height; ++y) {
        const double theta = (y + 0.5) * M_PI / map.height;
        for (int x = 0; x < map.width; ++x) {
          const double phi = ((x + 0.5) / map.width - 0.5) * 2 * M_PI;
          const double cosine = static_cast<double>(n.x) * std::sin(theta) * std::sin(phi) +
                                static_cast<double>(n.y) * std::cos(theta) -
                                static_cast<double>(n.z) * std::sin(theta) * std::cos(phi);
          const auto texel = static_cast<std::size_t>(3 * (y * map.width + x));
          if (cosine > 0) sum += static_cast<double>(map.rgb[texel + 1]) * cosine * std::sin(theta);
        }
      }
      return sum * (M_PI / map.height) * (2 * M_PI / map.width) / M_PI;
    };
    EXPECT_NEAR(irradiance({-0.6f, 0.7f, 0.7f}), 1, 0.2);
    EXPECT_NEAR(irradiance({0, 1, 0}), 0.87, 0.1);
    EXPECT_LT(irradiance({0, -1, 0}), 0.3);
    EXPECT_LT(irradiance({1, 0, -0.2f}), 0.6);
  }
}

}  // namespace
}  // namespace relief::test
