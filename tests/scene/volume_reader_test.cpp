// What RELIEF_volume means, and that whatever is wrong with one ends in one SceneError that says where and why.
#include "scene/graph/volume_reader.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/graph_scene.h"

namespace relief {
namespace {

using nlohmann::json;

test::GltfBuilder volume_scene(const json& volume, const json& nodes = json())
{
  test::GltfBuilder b = test::graph_scene({{"nodes", nodes}});
  json& extensions = b.json["materials"][0]["extensions"];
  if (nodes.is_null()) extensions.erase("RELIEF_graph");
  extensions["RELIEF_volume"] = volume;
  return b;
}

Scene volume_load(const json& volume, const json& nodes = json())
{
  const test::TemporaryFolder folder;
  return scene_load(folder.write("scene.gltf", volume_scene(volume, nodes).gltf()));
}

std::string failure_of(const json& volume, const json& nodes = json())
{
  try {
    static_cast<void>(volume_load(volume, nodes));
  } catch (const SceneError& error) {
    return error.what();
  }
  return "";
}

void expect_near(Vec3f a, Vec3f b)
{
  EXPECT_NEAR(a.x, b.x, 1e-5f);
  EXPECT_NEAR(a.y, b.y, 1e-5f);
  EXPECT_NEAR(a.z, b.z, 1e-5f);
}

TEST(VolumeReader, ClosuresSumToAMedium)
{
  const Scene scene = volume_load(
      {{"closures",
        {{{"type", "absorption"}, {"color", {0.75, 0.5, 1}}, {"density", 2}},
         {{"type", "scatter"}, {"weight", 0.5}, {"color", {1, 0.5, 0.25}}, {"density", 4}, {"anisotropy", -0.5}},
         {{"type", "emission"}, {"color", {1, 2, 3}}, {"strength", 0.5}}}}});
  ASSERT_EQ(scene.media.size(), 1u);
  EXPECT_EQ(scene.materials.at(0).medium_index, 0);
  const Medium& medium = scene.media[0];
  expect_near(medium.sigma_t, {0.5f + 2, 1 + 1, 0 + 0.5f});
  expect_near(medium.emission, {0.5f, 1, 1.5f});
  ASSERT_EQ(medium.num_phases, 1);
  expect_near(medium.phases[0].sigma_s, {2, 1, 0.5f});
  EXPECT_EQ(medium.phases[0].g, -0.5f);
}

TEST(VolumeReader, PhaseFunctionsOfOneMedium)
{
  const Scene scene = volume_load({{"closures",
                                    {{{"type", "rayleigh"}, {"color", {1, 1, 1}}},
                                     {{"type", "draine"}, {"color", {1, 1, 1}}, {"anisotropy", 0.3}, {"alpha", 0.7}},
                                     {{"type", "mie"}, {"color", {1, 1, 1}}, {"diameter", 12}}}}});
  const Medium& medium = scene.media.at(0);
  ASSERT_EQ(medium.num_phases, 4);
  expect_near(medium.sigma_t, {3, 3, 3});
  EXPECT_EQ(medium.phases[0].kind, PhaseKind::kDraine);
  EXPECT_EQ(medium.phases[0].shape, 1.0f);
  EXPECT_EQ(medium.phases[1].g, 0.3f);
  EXPECT_EQ(medium.phases[1].shape, 0.7f);
  expect_near(medium.phases[2].sigma_s + medium.phases[3].sigma_s, {1, 1, 1});
  EXPECT_EQ(medium.phases[2].kind, PhaseKind::kHenyeyGreenstein);
  EXPECT_GT(medium.phases[2].g, 0.9f);
  EXPECT_THROW(volume_load({{"closures", {{{"type", "mie"}}, {{"type", "mie"}}, {{"type", "scatter"}}}}}), SceneError);
}

TEST(VolumeReader, DefaultsAreBlenders)
{
  const Scene scene = volume_load({{"closures", {{{"type", "principled"}}}}});
  const Medium& medium = scene.media.at(0);
  expect_near(medium.phases[0].sigma_s, {0.5f, 0.5f, 0.5f});
  expect_near(medium.sigma_t, {1, 1, 1});
  expect_near(medium.emission, {});
}

TEST(VolumeReader, PrincipledAbsorbsByTheRootOfItsColorAndGlowsAsABlackBody)
{
  const Scene scene = volume_load({{"closures",
                                    {{{"type", "principled"},
                                      {"color", {0.2, 0.4, 1}},
                                      {"density", 3},
                                      {"absorptionColor", {0.25, 0, 1}},
                                      {"emissionStrength", 2},
                                      {"emissionColor", {1, 0.5, 0}},
                                      {"blackbodyIntensity", 1},
                                      {"temperature", 3000}}}}});
  const Medium& medium = scene.media.at(0);
  expect_near(medium.sigma_t, {3 * (0.2f + 0.8f * 0.5f), 3 * (0.4f + 0.6f), 3});
  const double law = 5.670373e-8 * 1e-6 / M_PI * std::pow(3000.0, 4);
  const Vec3f glow = blackbody_color(3000) * static_cast<float>(law);
  expect_near(medium.emission, Vec3f{2, 1, 0} + glow);
}

TEST(VolumeReader, NodesThatDependOnNothingGiveNumbers)
{
  const json nodes = {{{"type", "math"}, {"operation", "multiply"}, {"inputs", {{"a", 3}, {"b", 0.5}}}}};
  const Scene scene = volume_load(
      {{"closures", {{{"type", "scatter"}, {"color", {1, 1, 1}}, {"density", {{"node", 0}, {"output", "value"}}}}}}},
      nodes);
  expect_near(scene.media.at(0).sigma_t, {1.5f, 1.5f, 1.5f});
  // The nodes give nothing of the surface.
  EXPECT_EQ(scene.materials.at(0).graph_index, -1);
}

TEST(VolumeReader, WhatDependsOnThePlaceIsAProgram)
{
  const json nodes = {{{"type", "geometry"}}};
  const json closures = {{{"type", "scatter"}, {"color", {{"node", 0}, {"output", "position"}}}}};
  const Scene scene = volume_load({{"closures", closures}}, nodes);
  ASSERT_EQ(scene.media.size(), 1u);
  EXPECT_EQ(scene.media[0].num_phases, 0);
  ASSERT_EQ(scene.varying_media.size(), 1u);
  ASSERT_EQ(scene.varying_media[0].closures.size(), 1u);
  EXPECT_EQ(scene.varying_media[0].program.inputs.size(), 3u);
}

TEST(VolumeReader, UnknownTypesAndTooManyPhasesAreErrors)
{
  EXPECT_NE(failure_of({{"closures", {{{"type", "smoke"}}}}}).find("closures/0/type"), std::string::npos);
  EXPECT_NE(failure_of({{"closures", {json::object()}}}).find("closures/0/type"), std::string::npos);
  EXPECT_NE(failure_of({{"closures", 3}}).find("an array"), std::string::npos);
  json many = json::array();
  for (int i = 0; i < kMostPhases + 1; ++i) many.push_back({{"type", "scatter"}});
  EXPECT_NE(failure_of({{"closures", many}}).find("closures/4"), std::string::npos);
}

TEST(VolumeReader, NumbersThatMakeNoSenseAreTamed)
{
  const Scene scene = volume_load({{"closures",
                                    {{{"type", "scatter"}, {"color", {2, 1, 1}}, {"density", -3}},
                                     {{"type", "absorption"}, {"color", {3, 0, 0}}, {"density", 1e30}},
                                     {{"type", "scatter"}, {"density", 1}, {"anisotropy", 7}}}}});
  const Medium& medium = scene.media.at(0);
  EXPECT_TRUE(is_finite(medium.sigma_t));
  EXPECT_EQ(medium.sigma_t.x, 0.8f);
  EXPECT_EQ(medium.phases[1].g, kMostAnisotropy);
  bool is_told = false;
  for (const std::string& text : scene.warnings)
    is_told |= text.find("closures/0/density: below 0") != std::string::npos;
  EXPECT_TRUE(is_told);
}

TEST(VolumeReader, AMaterialWithoutASurfaceIsABoundary)
{
  test::GltfBuilder b = volume_scene({{"closures", {{{"type", "scatter"}}}}});
  const auto load = [&b] {
    const test::TemporaryFolder folder;
    return scene_load(folder.write("scene.gltf", b.gltf())).materials.at(0).is_boundary;
  };
  EXPECT_FALSE(load());
  b.json["materials"][0]["alphaMode"] = "BLEND";
  b.json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = {1, 1, 1, 0};
  EXPECT_TRUE(load());
  b.json["materials"][0]["emissiveFactor"] = {1, 1, 1};
  EXPECT_FALSE(load());
}

TEST(VolumeReader, TheWorldHasOne)
{
  test::GltfBuilder b = test::graph_scene({{"nodes", json::array()}, {"outputs", json::object()}});
  b.json["extensions"]["RELIEF_environment"] = {
      {"color", {0, 0, 0}},
      {"volume", {{"closures", {{{"type", "scatter"}, {"color", {1, 1, 1}}, {"density", 0.5}}}}}}};
  b.json["extensionsUsed"].push_back("RELIEF_environment");
  const test::TemporaryFolder folder;
  const Scene scene = scene_load(folder.write("scene.gltf", b.gltf()));
  ASSERT_TRUE(scene.environment.medium.has_value());
  EXPECT_EQ(scene.environment.medium->sigma_t.y, 0.5f);
  EXPECT_TRUE(scene.environment.varying_medium.closures.empty());
}

TEST(VolumeReader, TheWorldHasOneWithNodes)
{
  test::GltfBuilder b = test::graph_scene({{"nodes", json::array()}, {"outputs", json::object()}});
  const json closures = {{{"type", "scatter"}, {"color", {{"node", 0}, {"output", "position"}}}}};
  b.json["extensions"]["RELIEF_environment"] = {
      {"color", {0, 0, 0}}, {"volume", {{"nodes", {{{"type", "geometry"}}}}, {"closures", closures}}}};
  b.json["extensionsUsed"].push_back("RELIEF_environment");
  const test::TemporaryFolder folder;
  const Scene scene = scene_load(folder.write("scene.gltf", b.gltf()));
  ASSERT_TRUE(scene.environment.medium.has_value());
  EXPECT_EQ(scene.environment.varying_medium.program.inputs.size(), 3u);
  for (const std::string& text : scene.warnings) EXPECT_EQ(text.find("volume"), std::string::npos) << text;
}

}  // namespace
}  // namespace relief
