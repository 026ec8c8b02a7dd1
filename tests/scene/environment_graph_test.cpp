// Surroundings by a value graph: what a direction is for it, how fine the map gets, and what is wrong with one.
#include "scene/environment_graph.h"

#include <gtest/gtest.h>

#include <algorithm>

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

}  // namespace
}  // namespace relief
