// What RELIEF_surface means, and that whatever is wrong with one ends in one SceneError that says where and why.
#include "scene/graph/closure_reader.h"

#include <gtest/gtest.h>

#include <limits>

#include "kernel/graph/graph_mixture.h"
#include "tests/support/graph_scene.h"

namespace relief {
namespace {

using nlohmann::json;

test::GltfBuilder closure_scene(const json& surface, const json& nodes = json::array())
{
  test::GltfBuilder b = test::graph_scene({{"nodes", nodes}});
  b.json["materials"][0]["extensions"]["RELIEF_surface"] = surface;
  return b;
}

Scene closure_load(const json& surface, const json& nodes = json::array())
{
  const test::TemporaryFolder folder;
  return scene_load(folder.write("scene.gltf", closure_scene(surface, nodes).gltf()));
}

/// A closure's inputs, where nothing depends on the point.
template <typename Inputs>
Inputs inputs_of(const GraphProgram& program, std::size_t closure)
{
  GraphRegisters registers;
  const GraphProgramView view = program.view();
  graph_run(view, nullptr, registers);
  return closure_inputs<Inputs>({&view, &registers, 0}, program.closures.at(closure));
}

float weight_of(const GraphProgram& program, std::size_t closure)
{
  GraphRegisters registers;
  const GraphProgramView view = program.view();
  graph_run(view, nullptr, registers);
  return graph_result({&view, &registers, 0}, program.closures.at(closure).first_result);
}

TEST(ClosureReader, EveryClosureHasItsOwnNumbers)
{
  const Scene scene = closure_load({{"closures",
                                     {{{"type", "diffuse"}, {"weight", 0.25}, {"color", {0.1, 0.2, 0.3}}},
                                      {{"type", "glossy"}, {"weight", 0.75}, {"roughness", 0.125}},
                                      {{"type", "principled"}, {"metallic", 0.5}, {"clearcoatNormal", {1, 2, 3}}}}}});
  const GraphProgram& program = scene.graphs.at(0);
  ASSERT_EQ(program.closures.size(), 3u);
  EXPECT_EQ(weight_of(program, 0), 0.25f);
  EXPECT_EQ(inputs_of<DiffuseInputs>(program, 0).color, (Vec3f{0.1f, 0.2f, 0.3f}));
  EXPECT_EQ(weight_of(program, 1), 0.75f);
  EXPECT_EQ(inputs_of<GlossyInputs>(program, 1).roughness, 0.125f);
  EXPECT_EQ(inputs_of<GlossyInputs>(program, 1).color, GlossyInputs{}.color);
  EXPECT_EQ(weight_of(program, 2), 1.0f);
  EXPECT_EQ(inputs_of<Principled3Inputs>(program, 2).metallic, 0.5f);
  EXPECT_EQ(inputs_of<Principled3Inputs>(program, 2).clearcoat_normal, (Vec3f{1, 2, 3}));
  EXPECT_TRUE(is_zero(inputs_of<Principled3Inputs>(program, 2).normal));
}

TEST(ClosureReader, InputsComeFromNodesOfTheGraph)
{
  const json nodes = {{{"type", "math"}, {"operation", "multiply"}, {"inputs", {{"a", 0.5}, {"b", 0.5}}}}};
  const Scene scene =
      closure_load({{"closures", {{{"type", "toon"}, {"weight", {{"node", 0}}}, {"size", {{"node", 0}}}}}}}, nodes);
  EXPECT_EQ(weight_of(scene.graphs.at(0), 0), 0.25f);
  EXPECT_EQ(inputs_of<ToonInputs>(scene.graphs.at(0), 0).size, 0.25f);
}

TEST(ClosureReader, VersionsOfThePrincipledAreToldApart)
{
  const Scene scene = closure_load({{"closures",
                                     {{{"type", "principled"}},
                                      {{"type", "principled"}, {"maths", "4.3"}, {"coatWeight", 0.5}},
                                      {{"type", "principled"}, {"maths", "5.2"}}}}});
  EXPECT_EQ(scene.graphs.at(0).closures.at(0).kind, ClosureKind::principled3);
  EXPECT_EQ(scene.graphs.at(0).closures.at(1).kind, ClosureKind::principled4);
  EXPECT_EQ(inputs_of<Principled4Inputs>(scene.graphs.at(0), 1).coat_weight, 0.5f);
  EXPECT_EQ(scene.graphs.at(0).closures.at(2).kind, ClosureKind::principled4);
  EXPECT_EQ(scene.graphs.at(0).closures.at(2).maths, Maths::k52);
  EXPECT_EQ(scene.graphs.at(0).closures.at(1).maths, Maths::k43);
}

TEST(ClosureReader, ModelsOfFibresAreToldApart)
{
  const Scene scene =
      closure_load({{"closures",
                     {{{"type", "fibre"}, {"radialRoughness", 0.7}},
                      {{"type", "fibre"}, {"model", "huang"}, {"aspect", 0.5}, {"secondaryReflection", 0.25}}}}});
  EXPECT_EQ(scene.graphs.at(0).closures.at(0).kind, ClosureKind::fibre);
  EXPECT_EQ(scene.graphs.at(0).closures.at(1).kind, ClosureKind::facet_fibre);
  EXPECT_EQ(inputs_of<FacetFibreInputs>(scene.graphs.at(0), 1).aspect, 0.5f);
  EXPECT_EQ(inputs_of<FacetFibreInputs>(scene.graphs.at(0), 1).gain_TRT, 0.25f);
}

TEST(ClosureReader, WhatWeighsNothingIsLeftOut)
{
  const Scene scene = closure_load({{"closures", {{{"type", "transparent"}, {"weight", 0}}, {{"type", "diffuse"}}}}});
  EXPECT_EQ(scene.graphs.at(0).closures.size(), 1u);
  EXPECT_EQ(scene.materials.at(0).transparency_index, -1);
  EXPECT_EQ(scene.materials.at(0).alpha_mode, AlphaMode::kOpaque);
}

TEST(ClosureReader, ShadowRaysRunTheTransparentClosuresAlone)
{
  const json nodes = {{{"type", "texture-coordinate"}},
                      {{"type", "noise-texture"}, {"inputs", {{"vector", {{"node", 0}, {"output", "uv"}}}}}}};
  const Scene scene = closure_load({{"closures",
                                     {{{"type", "glossy"}, {"roughness", {{"node", 1}, {"output", "factor"}}}},
                                      {{"type", "transparent"}, {"color", {0.5, 0.25, 0.125}}}}}},
                                   nodes);
  ASSERT_EQ(scene.materials.at(0).transparency_index, 1);
  const GraphProgram& program = scene.graphs.at(1);
  EXPECT_TRUE(program.code.empty());
  EXPECT_EQ(inputs_of<TransparentInputs>(program, 0).color, (Vec3f{0.5f, 0.25f, 0.125f}));
  EXPECT_FALSE(scene.graphs.at(0).code.empty());
}

TEST(ClosureReader, CausticsAreToldWhatBends)
{
  const Scene glass = closure_load({{"closures", {{{"type", "glass"}, {"roughness", 0.25}}}}});
  EXPECT_EQ(glass.materials.at(0).transmission, 1.0f);
  EXPECT_EQ(glass.materials.at(0).roughness, 0.25f);
  const Scene plastic = closure_load({{"closures", {{{"type", "principled"}}}}});
  EXPECT_EQ(plastic.materials.at(0).transmission, 0.0f);
  EXPECT_EQ(plastic.materials.at(0).metallic, 0.0f);
}

struct BrokenSurface {
  json surface;
  std::string path, expected;
};

TEST(ClosureReader, EveryBrokenSurfaceGivesOneClearError)
{
  json many = json::array();
  for (int i = 0; i < 10; ++i) many.push_back({{"type", "principled"}});
  const std::string at = "/materials/0/extensions/RELIEF_surface";
  const BrokenSurface broken[] = {
      {json::object(), at + "/closures", "an array"},
      {{{"closures", 1}}, at + "/closures", "an array"},
      {{{"closures", {{{"type", "plasma"}}}}}, at + "/closures/0/type", "the type of a closure"},
      {{{"closures", {{{"type", "principled3"}}}}}, at + "/closures/0/type", "the type of a closure"},
      {{{"closures", {{{"type", "diffuse"}, {"weight", {1, 2, 3}}}}}}, at + "/closures/0/weight", "a number"},
      {{{"closures", {{{"type", "diffuse"}, {"color", {1, 2}}}}}}, at + "/closures/0/color", "3"},
      {{{"closures", {{{"type", "diffuse"}, {"color", {{"node", 0}}}}}}}, at + "/closures/0/color/node", "nodes"},
      {{{"closures", {{{"type", "glossy"}, {"distribution", "phong"}}}}}, at + "/closures/0/distribution", "ggx"},
      {{{"closures", {{{"type", "glass"}, {"maths", "2.79"}}}}}, at + "/closures/0/maths", "3.4"},
      {{{"closures", {7}}}, at + "/closures/0", "an object"},
      {{{"closures", many}}, at + "/closures/7", "64"},
  };
  for (const BrokenSurface& one : broken) {
    try {
      closure_load(one.surface);
      ADD_FAILURE() << one.surface.dump();
    } catch (const SceneError& error) {
      const std::string what = error.what();
      EXPECT_NE(what.find(one.path), std::string::npos) << what;
      EXPECT_NE(what.find(one.expected), std::string::npos) << what;
    }
  }
}

}  // namespace
}  // namespace relief
