// Surroundings by a value graph: what a direction is for it, how fine the map gets, and what is wrong with one.
#include "scene/environment_graph.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "kernel/texture/texture.h"
#include "scene/texture_store.h"
#include "tests/support/graph_scene.h"

namespace relief {
namespace {

using nlohmann::json;
using test::GltfBuilder;

json environment(const json& nodes, const json& color)
{
  return {{"graph", {{"nodes", nodes}, {"outputs", {{"color", color}}}}}};
}

Scene load(const json& environment)
{
  GltfBuilder b = test::graph_scene({{"nodes", json::array()}, {"outputs", json::object()}});
  b.json["extensions"]["RELIEF_environment"] = environment;
  const test::TemporaryFolder folder;
  return scene_load(folder.write("scene.gltf", b.gltf()));
}

const TextureView& map_of(const Scene& scene)
{
  return scene.textures->views()[static_cast<std::size_t>(scene.environment.texture_index)];
}

/// Radiance at a place of the map, v down.
Vec3f radiance(const Scene& scene, float u, float v)
{
  const Vec4f texel = texture_sample(map_of(scene), {u, v}, 0);
  return scene.environment.color * Vec3f{texel.x, texel.y, texel.z};
}

void expect_radiance(Vec3f found, Vec3f expected, float tolerance = 0.01f)
{
  EXPECT_NEAR(found.x, expected.x, tolerance);
  EXPECT_NEAR(found.y, expected.y, tolerance);
  EXPECT_NEAR(found.z, expected.z, tolerance);
}

std::string error_of(const json& environment)
{
  try {
    load(environment);
  } catch (const SceneError& error) {
    return error.what();
  }
  return "";
}

TEST(EnvironmentGraph, PositionsAreDirectionsWithZUp)
{
  const json geometry = json::array({{{"type", "geometry"}}});
  const Scene scene = load(environment(geometry, {{"node", 0}, {"output", "position"}}));
  EXPECT_EQ(map_of(scene).width, 512);
  expect_radiance(radiance(scene, 0.5f, 0.5f), {0, 1, 0});
  expect_radiance(radiance(scene, 0.75f, 0.5f), {1, 0, 0});
  expect_radiance(radiance(scene, 0.5f, 0.0f), {0, 0, 1});
  for (const char* output : {"normal", "trueNormal", "incoming"}) {
    const Scene back = load(environment(geometry, {{"node", 0}, {"output", output}}));
    expect_radiance(radiance(back, 0.25f, 0.5f), {1, 0, 0});
    expect_radiance(radiance(back, 0.0f, 0.5f), {0, 1, 0});
    expect_radiance(radiance(back, 0.5f, 1.0f), {0, 0, 1});
  }
}

TEST(EnvironmentGraph, GeneratedAndObjectAreDirectionsToo)
{
  for (const char* output : {"generated", "object"}) {
    const Scene scene = load(environment({{{"type", "texture-coordinate"}}}, {{"node", 0}, {"output", output}}));
    expect_radiance(radiance(scene, 0.625f, 0.25f), {0.5f, 0.5f, 0.7071f});
  }
}

TEST(EnvironmentGraph, FineGraphsGetFineMaps)
{
  const json noise = {{{"type", "texture-coordinate"}},
                      {{"type", "noise-texture"},
                       {"inputs", {{"vector", {{"node", 0}, {"output", "generated"}}}, {"scale", 30}, {"detail", 0}}}}};
  json e = environment(noise, {{"node", 1}, {"output", "factor"}});
  EXPECT_GT(map_of(load(e)).width, 512);
  e["graph"]["resolution"] = 64;
  EXPECT_EQ(map_of(load(e)).width, 64);
  EXPECT_EQ(map_of(load(e)).height, 32);
}

TEST(EnvironmentGraph, RadiancesBeyondHalfPrecisionStay)
{
  for (const float value : {1e8f, 1e-8f}) {
    expect_radiance(radiance(load(environment(json::array(), {value, value / 2, 0})), 0.3f, 0.4f) * (1 / value),
                    {1, 0.5f, 0}, 0.001f);
  }
  // What is no radiance is none.
  expect_radiance(radiance(load(environment(json::array(), {-1, 2, 0})), 0.3f, 0.4f), {0, 2, 0});
}

TEST(EnvironmentGraph, StrengthAndColourMultiply)
{
  json e = environment(json::array(), {1, 2, 3});
  e["color"] = {1, 0.5, 0.25};
  e["strength"] = 2;
  expect_radiance(radiance(load(e), 0.1f, 0.5f), {2, 2, 1.5f});
}

TEST(EnvironmentGraph, ErrorsSayWhere)
{
  json both = environment(json::array(), {1, 1, 1});
  both["image"] = 0;
  EXPECT_NE(error_of(both).find("/extensions/RELIEF_environment"), std::string::npos);
  EXPECT_NE(error_of(both).find("either a graph or a map"), std::string::npos);
  const json without = {{"graph", {{"nodes", json::array()}, {"outputs", json::object()}}}};
  EXPECT_NE(error_of(without).find("/extensions/RELIEF_environment/graph/outputs/color"), std::string::npos);
  EXPECT_NE(error_of({{"graph", {{"nodes", json::array()}}}}).find("graph/outputs"), std::string::npos);
  EXPECT_NE(error_of(environment({{{"type", "nonsense"}}}, {1, 1, 1})).find("graph/nodes/0/type"), std::string::npos);
  json narrow = environment(json::array(), {1, 1, 1});
  narrow["graph"]["resolution"] = 1;
  EXPECT_NE(error_of(narrow).find("graph/resolution"), std::string::npos);
}

TEST(EnvironmentGraph, WhatDependsOnTheRayIsWarnedAbout)
{
  const Scene scene = load(environment({{{"type", "light-path"}}}, {{"node", 0}, {"output", "camera"}}));
  EXPECT_TRUE(std::any_of(scene.warnings.begin(), scene.warnings.end(), [](const std::string& text) {
    return text.find("all rays see the same surroundings") != std::string::npos;
  }));
  expect_radiance(radiance(scene, 0.3f, 0.4f), {0, 0, 0});
}

TEST(EnvironmentGraph, BackdropsAreWhatTheCameraSees)
{
  const json by_ray = environment({{{"type", "light-path"}}}, {{"node", 0}, {"output", "camera"}});
  json both = by_ray;
  both["backdrop"] = by_ray;
  both["backdrop"]["strength"] = 3;
  const Scene scene = load(both);
  EXPECT_TRUE(scene.warnings.empty()) << scene.warnings.front();
  expect_radiance(radiance(scene, 0.3f, 0.4f), {0, 0, 0});
  const Surroundings& seen = scene.environment.backdrop.value();
  const TextureView& map = scene.textures->views()[static_cast<std::size_t>(seen.texture_index)];
  EXPECT_NEAR(texture_sample(map, {0.3f, 0.4f}, 0).x * seen.color.x, 3.0f, 0.01f);
  both["backdrop"]["image"] = 0;
  EXPECT_NE(error_of(both).find("/extensions/RELIEF_environment/backdrop"), std::string::npos);
}

json sky(json options)
{
  options["type"] = "sky-texture";
  json e = environment(json::array({options}), {{"node", 0}});
  e["graph"]["resolution"] = 1024;
  return e;
}

/// Integral of red over the sphere.
double power(const Scene& scene)
{
  const TextureView& map = map_of(scene);
  double sum = 0;
  for (int y = 0; y < map.height; ++y) {
    const double v = (y + 0.5) / map.height;
    for (int x = 0; x < map.width; ++x) {
      const double u = (x + 0.5) / map.width;
      sum += std::sin(v * std::numbers::pi) *
             static_cast<double>(radiance(scene, static_cast<float>(u), static_cast<float>(v)).x);
    }
  }
  return sum * 2 * std::numbers::pi * std::numbers::pi / map.width / map.height;
}

TEST(EnvironmentGraph, SunsOfAnySizeHaveTheirPower)
{
  const json options = {{"sunElevation", 0.7}, {"sunRotation", 1}, {"sunIntensity", 1}};
  json without = options;
  without["sunDisc"] = false;
  const double rest = power(load(sky(without)));
  EXPECT_GT(rest, 1);
  double first = 0;
  for (const float size : {0.05f, 0.009512f}) {
    json with = options;
    with["sunSize"] = size;
    // Cycles computes the disk's solid angle in single precision.
    const float rounded = 1 - std::cos(size / 2);
    const double exact = 1 - std::cos(static_cast<double>(size) / 2);
    const double sun = (power(load(sky(with))) - rest) * static_cast<double>(rounded) / exact;
    if (first == 0) first = sun;
    EXPECT_NEAR(sun / first, 1, 0.01) << size;
  }
  EXPECT_GT(first, rest);
}

TEST(EnvironmentGraph, TheSunStandsWhereItIsToldTo)
{
  // Clockwise from north, +Y, which is the map's middle.
  const Scene scene = load(sky({{"sunElevation", 0.5}, {"sunRotation", 1}, {"sunSize", 0.02}}));
  const float u = 0.5f + 1 / (2 * std::numbers::pi_v<float>), v = 0.5f - 0.5f / std::numbers::pi_v<float>;
  const float sun = radiance(scene, u, v).x;
  EXPECT_GT(sun, 100 * radiance(scene, u + 0.02f, v).x);
  EXPECT_GT(sun, 100 * radiance(scene, u, v + 0.02f).x);
  // The ground is black from asin 0.4 below the horizon on.
  expect_radiance(radiance(scene, u, 0.65f), {0, 0, 0}, 1e-6f);
  EXPECT_GT(radiance(scene, u, 0.52f).x, 0);
}

TEST(EnvironmentGraph, ImagesAreLookedUpByDirection)
{
  for (const char* projection : {"equirectangular", "mirror-ball"}) {
    const json node = {{"type", "environment-texture"}, {"projection", projection}, {"texture", {{"index", 0}}}};
    const Vec3f grey = radiance(load(environment(json::array({node}), {{"node", 0}, {"output", "color"}})), 0.3f, 0.4f);
    EXPECT_GT(grey.x, 0.1f);
    EXPECT_LT(grey.x, 0.9f);
  }
  EXPECT_NE(
      error_of(environment({{{"type", "environment-texture"}}}, {{"node", 0}, {"output", "color"}})).find("texture"),
      std::string::npos);
}

}  // namespace
}  // namespace relief
