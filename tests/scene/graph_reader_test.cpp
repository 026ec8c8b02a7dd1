// What RELIEF_graph means, and that whatever is wrong with one ends in one SceneError that says where and why.
#include "scene/graph/graph_reader.h"

#include <gtest/gtest.h>

#include <cmath>

#include "scene/graph/graph_nodes.h"
#include "tests/support/graph_scene.h"

namespace relief {
namespace {

using nlohmann::json;
using Q = GraphQuantity;
using test::graph_at;
using test::graph_load;

json of(std::size_t node, const char* output = nullptr)
{
  json reference = {{"node", node}};
  if (output != nullptr) reference["output"] = output;
  return reference;
}

/// Quantities that are all different.
float numbered(Q quantity) { return 0.1f * static_cast<float>(static_cast<int>(quantity) + 1); }

GraphValues values_of(const json& nodes, const json& outputs)
{
  return graph_at(graph_load({{"nodes", nodes}, {"outputs", outputs}}).graphs.at(0), numbered);
}

/// What a graph gives as base colour.
Vec3f color_of(const json& nodes, const json& reference)
{
  return values_of(nodes, {{"baseColor", reference}}).of[static_cast<int>(GraphOutput::base_color)];
}

float number_of(const json& nodes, const json& reference)
{
  return values_of(nodes, {{"roughness", reference}}).of[static_cast<int>(GraphOutput::roughness)].x;
}

void expect_color(Vec3f found, Vec3f expected)
{
  EXPECT_FLOAT_EQ(found.x, expected.x);
  EXPECT_FLOAT_EQ(found.y, expected.y);
  EXPECT_FLOAT_EQ(found.z, expected.z);
}

TEST(GraphReader, NumbersDoForVectorsAndColours)
{
  expect_color(color_of({{{"type", "gamma"}, {"inputs", {{"color", 0.25}}}}}, of(0)), {0.25f, 0.25f, 0.25f});
  expect_color(color_of({{{"type", "vector-math"}, {"inputs", {{"a", {1, 2, 3}}, {"b", 1}}}}}, of(0, "vector")),
               {2, 3, 4});
}

TEST(GraphReader, ColoursBecomeNumbersByLuminanceAndVectorsByTheirMean)
{
  const json color = {{"type", "gamma"}, {"inputs", {{"color", {1, 2, 4}}}}};
  const json vector = {{"type", "mapping"}, {"inputs", {{"vector", {1, 2, 6}}}}};
  const json reads = {{"type", "math"}, {"inputs", {{"a", of(0)}, {"b", 0}}}};
  EXPECT_NEAR(number_of({color, reads}, of(1)), 0.2126729f + 2 * 0.7151522f + 4 * 0.0721750f, 1e-6f);
  EXPECT_NEAR(number_of({vector, reads}, of(1)), 3, 1e-6f);
  // So do outputs of materials.
  EXPECT_NEAR(number_of(json::array({vector}), of(0)), 3, 1e-6f);
  expect_color(color_of(json::array({vector}), of(0)), {1, 2, 6});
}

TEST(GraphReader, InputsThatAreNotGivenHaveTheirDefaults)
{
  EXPECT_EQ(number_of({{{"type", "math"}}}, of(0)), 1);
  EXPECT_EQ(number_of({{{"type", "math"}, {"inputs", json::object()}, {"operation", "multiply"}}}, of(0)), 0.25f);
  expect_color(color_of({{{"type", "mix-color"}, {"inputs", {{"b", {1, 0, 0}}}}}}, of(0)), {0.75f, 0.25f, 0.25f});
}

TEST(GraphReader, AnOutputNeedsNoNameWhereThereIsOne)
{
  EXPECT_EQ(number_of({{{"type", "math"}}}, of(0, "value")), number_of({{{"type", "math"}}}, of(0)));
}

TEST(GraphReader, NodesMayReferToLaterOnes)
{
  const json nodes = {{{"type", "math"}, {"inputs", {{"a", of(2)}, {"b", of(1)}}}, {"operation", "subtract"}},
                      {{"type", "math"}, {"inputs", {{"a", 3}, {"b", 4}}}},
                      {{"type", "math"}, {"inputs", {{"a", of(1)}, {"b", of(1)}}}, {"operation", "multiply"}}};
  EXPECT_EQ(number_of(nodes, of(0)), 42);
}

TEST(GraphReader, QuantitiesAreThoseOfTheirNames)
{
  const json nodes = {{{"type", "texture-coordinate"}}, {{"type", "geometry"}}, {{"type", "vertex-color"}}};
  const auto three = [](Q q) { return Vec3f{numbered(q), numbered(Q(int(q) + 1)), numbered(Q(int(q) + 2))}; };
  expect_color(color_of(nodes, of(0, "object")), three(Q::object_x));
  expect_color(color_of(nodes, of(0, "generated")), three(Q::generated_x));
  expect_color(color_of(nodes, of(0, "uv")), {numbered(Q::uv0_u), numbered(Q::uv0_v), 0});
  expect_color(color_of(nodes, of(0, "uv1")), {numbered(Q::uv1_u), numbered(Q::uv1_v), 0});
  expect_color(color_of(nodes, of(1, "position")), three(Q::position_x));
  expect_color(color_of(nodes, of(1, "normal")), three(Q::normal_x));
  expect_color(color_of(nodes, of(1, "trueNormal")), three(Q::true_normal_x));
  expect_color(color_of(nodes, of(1, "incoming")), three(Q::incoming_x));
  expect_color(color_of(nodes, of(2, "color")), three(Q::color_r));
  EXPECT_EQ(number_of(nodes, of(1, "backfacing")), numbered(Q::backfacing));
  EXPECT_EQ(number_of(nodes, of(2, "alpha")), numbered(Q::color_a));
}

TEST(GraphReader, TablesAreInterpolatedAndGoOnWhereTheySay)
{
  const auto curve = [](double x, bool goes_on) {
    return number_of({{{"type", "number-curve"},
                       {"inputs", {{"value", x}}},
                       {"table", {1, 2, 4}},
                       {"min", -1},
                       {"max", 3},
                       {"extrapolate", goes_on}}},
                     of(0));
  };
  EXPECT_FLOAT_EQ(curve(-1, true), 1);
  EXPECT_FLOAT_EQ(curve(0, true), 1.5f);
  EXPECT_FLOAT_EQ(curve(1, true), 2);
  EXPECT_FLOAT_EQ(curve(2, true), 3);
  EXPECT_FLOAT_EQ(curve(5, true), 6);
  EXPECT_FLOAT_EQ(curve(-3, true), 0);
  EXPECT_FLOAT_EQ(curve(5, false), 4);
  EXPECT_FLOAT_EQ(curve(-3, false), 1);
}

TEST(GraphReader, ATableOfOneEntryIsAConstant)
{
  const json ramp = {{"type", "color-ramp"}, {"inputs", {{"factor", of(1, "backfacing")}}}, {"table", {1, 2, 3, 4}}};
  expect_color(color_of({ramp, {{"type", "geometry"}}}, of(0, "color")), {1, 2, 3});
}

// Whole turns are cut off towards 0; a quarter turn below is the end of the wheel, or goes on from its other end.
TEST(GraphReader, BumpsAskForHeightsAsFarAwayAsTheirWidth)
{
  // Of x², seen along −z with footprints of half a metre.
  const float x = 0.3f, footprint = 0.5f;
  const json nodes = {
      {{"type", "geometry"}},
      {{"type", "separate"}, {"inputs", {{"vector", of(0, "position")}}}},
      {{"type", "math"}, {"operation", "multiply"}, {"inputs", {{"a", of(1, "x")}, {"b", of(1, "x")}}}}};
  json both = nodes;
  for (const double width : {1.0, 0.1}) {
    both.push_back({{"type", "bump"}, {"filterWidth", width}, {"inputs", {{"height", of(2)}}}});
  }
  const GraphProgram program =
      graph_load({{"nodes", both}, {"outputs", {{"baseColor", of(3)}, {"emission", of(4)}}}}).graphs.at(0);
  GraphRegisters registers;
  for (const GraphInput& input : program.inputs) {
    float value = 0;
    if (input.quantity == Q::position_x) value = x + (input.shift == GraphShift::kAlongX ? input.width * footprint : 0);
    if (input.quantity == Q::dpdx_x || input.quantity == Q::dpdy_y) value = footprint;
    if (input.quantity == Q::normal_z) value = 1;
    registers.lanes[input.register_index] = splat8(value);
  }
  const GraphProgramView view = program.view();
  graph_run(view, nullptr, registers);
  const GraphValues values = graph_values({&view, &registers, 0});
  const auto expected = [&](float width) { return normalize(Vec3f{-(2 * x + width * footprint), 0, 1}); };
  EXPECT_LT(length(values.of[static_cast<int>(GraphOutput::base_color)] - expected(1)), 1e-6f);
  EXPECT_LT(length(values.of[static_cast<int>(GraphOutput::emission)] - expected(0.1f)), 1e-5f);
}

// The mean of normals or heights is flat where they are not.
TEST(GraphReader, NormalsAndHeightsAreOfTheFinestLevelAndColoursAreNot)
{
  const auto has_width = [](const json& nodes, const char* socket, const json& value) {
    const json surface = {{"closures", {{{"type", "diffuse"}, {socket, value}}}}};
    test::GltfBuilder b = test::graph_scene({{"nodes", nodes}});
    b.json["materials"][0]["extensions"]["RELIEF_surface"] = surface;
    const test::TemporaryFolder folder;
    const Scene scene = scene_load(folder.write("scene.gltf", b.gltf()));
    for (const GraphInput& input : scene.graphs.at(0).inputs) {
      if (input.quantity == Q::uv0_width) return true;
    }
    return false;
  };
  const json image = {{"type", "image-texture"}, {"texture", {{"index", 0}}}, {"inputs", {{"vector", of(0, "uv")}}}};
  const json coordinate = {{"type", "texture-coordinate"}};
  EXPECT_TRUE(has_width({coordinate, image}, "color", of(1, "color")));
  EXPECT_FALSE(has_width({coordinate, image}, "normal", of(1, "color")));
  const json bump = {{"type", "bump"}, {"inputs", {{"height", of(1, "color")}}}};
  EXPECT_FALSE(has_width({coordinate, image, bump}, "normal", of(2, "normal")));
  const json map = {{"type", "normal-map"}, {"space", "world"}, {"inputs", {{"color", of(1, "color")}}}};
  EXPECT_FALSE(has_width({coordinate, image, map}, "normal", of(2, "normal")));
  EXPECT_FALSE(has_width({coordinate, image, map}, "color", of(2, "normal")));
}

TEST(GraphReader, NormalMapsStandOverNormalsOfAnyLengthOrOfOne)
{
  // A tangent along x, a normal of half the length along z, a colour that leans by 45 degrees between units.
  const auto normal_of = [](bool is_unit) {
    const json node = {{"type", "normal-map"}, {"unitNormals", is_unit}, {"inputs", {{"color", {1, 0.5, 1}}}}};
    const GraphProgram program =
        graph_load({{"nodes", json::array({node})}, {"outputs", {{"baseColor", of(0)}}}}).graphs.at(0);
    GraphRegisters registers;
    for (const GraphInput& input : program.inputs) {
      float value = 0;
      if (input.quantity == Q::attribute_x || input.quantity == Q::attribute_alpha) value = 1;
      if (input.quantity == Q::smooth_normal_z) value = 0.5f;
      if (input.quantity == Q::normal_z) value = 1;
      if (input.quantity == Q::object_from_world && input.index % 5 == 0) value = 1;
      registers.lanes[input.register_index] = splat8(value);
    }
    const GraphProgramView view = program.view();
    graph_run(view, nullptr, registers);
    return graph_values({&view, &registers, 0}).of[static_cast<int>(GraphOutput::base_color)];
  };
  EXPECT_LT(length(normal_of(false) - normalize(Vec3f{1, 0, 0.5f})), 1e-6f);
  EXPECT_LT(length(normal_of(true) - normalize(Vec3f{1, 0, 1})), 1e-6f);
}

TEST(GraphReader, NormalMapsStandOverADisplacedSurfaceOrOverThatOfBefore)
{
  // A mesh with a normal along z and a tangent along x, whose displaced surface leans towards x.
  const Vec3f displaced = normalize(Vec3f{0.6f, 0, 0.8f});
  const auto normal_of = [&](json options, Vec3f color, bool has_base = true) {
    options.update({{"type", "normal-map"}, {"inputs", {{"color", {color.x, color.y, color.z}}}}});
    const GraphProgram program =
        graph_load({{"nodes", json::array({options})}, {"outputs", {{"baseColor", of(0)}}}}).graphs.at(0);
    GraphRegisters registers;
    // Attributes are told apart by their places: tangents first.
    const std::uint16_t tangents = program.attributes.front();
    for (const GraphInput& input : program.inputs) {
      float value = 0;
      const bool is_tangent = input.index == tangents;
      if (input.quantity == Q::attribute_x) value = is_tangent ? 1 : 0;
      if (input.quantity == Q::attribute_z) value = is_tangent || !has_base ? 0 : 1;
      if (input.quantity == Q::attribute_alpha) value = 1;
      if (input.quantity == Q::smooth_normal_x) value = displaced.x;
      if (input.quantity == Q::smooth_normal_z || input.quantity == Q::normal_z) value = displaced.z;
      if (input.quantity == Q::normal_x) value = displaced.x;
      if (input.quantity == Q::object_from_world && input.index % 5 == 0) value = 1;
      registers.lanes[input.register_index] = splat8(value);
    }
    const GraphProgramView view = program.view();
    graph_run(view, nullptr, registers);
    return graph_values({&view, &registers, 0}).of[static_cast<int>(GraphOutput::base_color)];
  };
  const Vec3f even{0.5f, 0.5f, 1}, towards_x{1, 0.5f, 0.5f}, towards_y{0.5f, 1, 0.5f};
  EXPECT_LT(length(normal_of({}, even) - displaced), 1e-6f);
  EXPECT_LT(length(normal_of({{"base", "original"}}, even) - Vec3f{0, 0, 1}), 1e-6f);
  EXPECT_LT(length(normal_of({{"base", "original"}}, even, false) - displaced), 1e-6f) << "a flat mesh has none";
  // Tangents are the mesh's, or those of the displaced surface above it.
  EXPECT_LT(length(normal_of({}, towards_x) - Vec3f{1, 0, 0}), 1e-6f);
  EXPECT_LT(length(normal_of({{"displacedTangents", true}}, towards_x) - normalize(Vec3f{0.8f, 0, -0.6f})), 1e-6f);
  EXPECT_LT(length(normal_of({{"displacedTangents", true}}, towards_y) - Vec3f{0, 1, 0}), 1e-6f);
  EXPECT_LT(length(normal_of({{"displacedTangents", true}}, towards_x, false) - Vec3f{1, 0, 0}), 1e-6f);
}

TEST(GraphReader, HuesBelowNoneStayBelowOrGoRound)
{
  json node = {{"type", "hue-saturation"}, {"inputs", {{"hue", -1.75}, {"color", {0.8, 0.2, 0.2}}}}};
  expect_color(color_of(json::array({node}), of(0)), {0.8f, 0.2f, 0.5f});
  node["hueGoesRound"] = true;
  expect_color(color_of(json::array({node}), of(0)), {0.5f, 0.2f, 0.8f});
  node["inputs"]["hue"] = 0.25;
  expect_color(color_of(json::array({node}), of(0)), {0.5f, 0.2f, 0.8f});
  node.erase("hueGoesRound");
  expect_color(color_of(json::array({node}), of(0)), {0.5f, 0.2f, 0.8f});
}

TEST(GraphReader, TheLargestNumbersAreRead)
{
  EXPECT_EQ(number_of({{{"type", "math"}, {"inputs", {{"a", 3.4e38}, {"b", 0}}}}}, of(0)), 3.4e38f);
  EXPECT_EQ(number_of({{{"type", "math"}, {"inputs", {{"a", 1e-60}, {"b", 0}}}}}, of(0)), 0);
}

TEST(GraphReader, ConstantsThatAreNoNumbersStay)
{
  // ∞ − ∞.
  const json nodes = {{{"type", "math"}, {"inputs", {{"a", 3e38}, {"b", 3e38}}}},
                      {{"type", "math"}, {"inputs", {{"a", of(0)}, {"b", of(0)}}}, {"operation", "subtract"}}};
  EXPECT_TRUE(std::isnan(number_of(nodes, of(1))));
}

TEST(GraphReader, WhatNothingReadsIsWarnedOf)
{
  const Scene scene =
      graph_load({{"nodes", {{{"type", "math"}, {"inputs", {{"a", 1}, {"d", 2}}}, {"operatoin", "add"}}}},
                  {"outputs", {{"roughness", of(0)}, {"rougness", of(0)}}}});
  std::string all;
  for (const std::string& text : scene.warnings) all += text + '\n';
  for (const char* path : {"/nodes/0/inputs/d", "/nodes/0/operatoin", "/outputs/rougness"}) {
    EXPECT_NE(all.find(std::string("/materials/0/extensions/RELIEF_graph") + path), std::string::npos) << all;
  }
}

// Every kind, all of its inputs from the point: outputs exist, and none is forgotten in silence.
TEST(GraphReader, EveryKindReadsWithAllOfItsInputs)
{
  for (const auto kinds : {graph_input_nodes(), graph_texture_nodes(), graph_color_nodes(), graph_math_nodes()}) {
    for (const GraphNodeKind& kind : kinds) {
      SCOPED_TRACE(kind.name);
      json node = {{"type", kind.name}};
      for (const GraphSocket& socket : kind.inputs) node["inputs"][std::string(socket.name)] = of(1, "position");
      if (kind.name == "image-texture") node["texture"] = {{"index", 0}};
      if (kind.name == "ies-texture") node["uri"] = "profile.ies";
      if (kind.name == "voxel-texture") node.update({{"uri", "slices.exr"}, {"size", {1, 1, 1}}});
      if (kind.name == "attribute") node["name"] = "_SOMETHING";
      if (kind.name == "normal") node["direction"] = {0, 0, 1};
      if (kind.name == "transform") node["matrix"] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
      if (kind.name == "color-ramp") node["table"] = {0, 0, 0, 1};
      if (kind.name.find("curve") != std::string_view::npos) node["table"] = {0, 0, 0};
      try {
        graph_load({{"nodes", {node, {{"type", "geometry"}}}}, {"outputs", {{"roughness", of(0, "none")}}}});
        FAIL();
      } catch (const SceneError& error) {
        EXPECT_EQ(error.json_path, "/materials/0/extensions/RELIEF_graph/outputs/roughness") << error.what();
        EXPECT_NE(error.expected.find("an output of node 0 (\""), std::string::npos) << error.what();
      }
    }
  }
}

TEST(GraphReader, SixtyThousandDeepIsRead)
{
  json nodes = json::array({{{"type", "geometry"}}});
  nodes.push_back({{"type", "math"}, {"inputs", {{"a", of(0, "backfacing")}, {"b", 1}}}});
  for (std::size_t i = 2; i < 60'000; ++i)
    nodes.push_back({{"type", "math"}, {"inputs", {{"a", of(i - 1)}, {"b", 1}}}});
  const Scene scene = graph_load({{"nodes", nodes}, {"outputs", {{"roughness", of(nodes.size() - 1)}}}});
  EXPECT_LE(scene.graphs[0].num_registers, 2);
  EXPECT_EQ(graph_at(scene.graphs[0], [](Q) { return 1.0f; }).of[static_cast<int>(GraphOutput::roughness)].x, 60'000);
}

// Tables of ramps that are computed while they are read, or that nothing reads, are not the program's.
TEST(GraphReader, KnownRampsLeaveNoTables)
{
  json nodes = json::array();
  for (int i = 0; i < 20'000; ++i) nodes.push_back({{"type", "color-ramp"}, {"table", {i, i + 0.5, 0, 1}}});
  const Scene scene = graph_load({{"nodes", nodes}, {"outputs", {{"baseColor", of(7, "color")}}}});
  EXPECT_TRUE(scene.graphs[0].tables.empty());
  EXPECT_TRUE(scene.graphs[0].code.empty());
}

struct BrokenGraph {
  const char* name;
  json graph;
  const char* json_path;  ///< within the graph, exact
  const char* message;    ///< part of what()
};

json graph_of(const json& node) { return {{"nodes", {node}}, {"outputs", {{"baseColor", of(0)}}}}; }
json math_of(const json& inputs) { return graph_of({{"type", "math"}, {"inputs", inputs}}); }

/// Sines of multiples of a coordinate, each added twice to a chain: all of them are alive in its middle.
json all_alive(std::size_t count)
{
  json nodes = json::array({{{"type", "geometry"}}});
  for (std::size_t i = 0; i < count; ++i) {
    nodes.push_back(
        {{"type", "math"}, {"inputs", {{"a", of(0, "backfacing")}, {"b", 2.0 + double(i)}}}, {"operation", "power"}});
  }
  for (std::size_t i = 0; i < 2 * count; ++i) {
    const std::size_t before = nodes.size() - 1;
    nodes.push_back({{"type", "math"}, {"inputs", {{"a", of(before)}}}, {"operation", "sine"}});
    nodes.push_back({{"type", "math"}, {"inputs", {{"a", of(before + 1)}, {"b", of(1 + i % count)}}}});
  }
  return {{"nodes", nodes}, {"outputs", {{"roughness", of(nodes.size() - 1)}}}};
}

json many(std::size_t count)
{
  json graph = {{"nodes", json::array()}, {"outputs", json::object()}};
  graph["nodes"].get_ref<json::array_t&>().assign(count, json{{"type", "math"}});
  return graph;
}

json circle(std::size_t count)
{
  json nodes = json::array();
  for (std::size_t i = 0; i < count; ++i) {
    nodes.push_back({{"type", "math"}, {"inputs", {{"a", of((i + 1) % count)}}}});
  }
  return {{"nodes", nodes}, {"outputs", json::object()}};
}

std::vector<BrokenGraph> broken_graphs()
{
  const json table8 = {0, 0, 0, 1, 1, 1, 1, 1};
  return {
      {"graph is an array", json::array(), "", "an object"},
      {"no nodes", {{"outputs", json::object()}}, "/nodes", "expected an array, found nothing"},
      {"nodes are an object", {{"nodes", json::object()}, {"outputs", json::object()}}, "/nodes", "an array"},
      {"no outputs", {{"nodes", json::array()}}, "/outputs", "expected an object, found nothing"},
      {"outputs are an array", {{"nodes", json::array()}, {"outputs", json::array()}}, "/outputs", "an object"},
      {"node is a number", graph_of(3), "/nodes/0", "expected an object, found 3"},
      {"node without type", graph_of(json::object()), "/nodes/0/type", "found \"\""},
      {"type is a number", graph_of({{"type", 4}}), "/nodes/0/type", "a string"},
      {"type unknown", graph_of({{"type", "plasma"}}), "/nodes/0/type",
       "the type of a node (docs/graphs.md), found \"plasma\""},
      {"inputs are an array", math_of(json::array({1})), "/nodes/0/inputs", "an object"},
      {"number is a string", math_of({{"a", "1"}}), "/nodes/0/inputs/a", "a number, or {\"node\": …}, found \"1\""},
      {"number is true", math_of({{"a", true}}), "/nodes/0/inputs/a", "found true"},
      {"number is three", math_of({{"a", {1, 2, 3}}}), "/nodes/0/inputs/a", "found an array of 3"},
      {"number beyond float", math_of({{"a", 1e39}}), "/nodes/0/inputs/a", "found 1e+39"},
      {"number far below float", math_of({{"a", -1e300}}), "/nodes/0/inputs/a", "found -1e+300"},
      {"vector is a string", graph_of({{"type", "separate"}, {"inputs", {{"vector", "x"}}}}), "/nodes/0/inputs/vector",
       "three numbers, or {\"node\": …}, found \"x\""},
      {"vector of two", graph_of({{"type", "separate"}, {"inputs", {{"vector", {1, 2}}}}}), "/nodes/0/inputs/vector",
       "an array of 3 numbers"},
      {"vector of strings", graph_of({{"type", "separate"}, {"inputs", {{"vector", {1, "2", 3}}}}}),
       "/nodes/0/inputs/vector/1", "a number"},
      {"vector beyond float", graph_of({{"type", "separate"}, {"inputs", {{"vector", {1, 2, 1e39}}}}}),
       "/nodes/0/inputs/vector/2", "found 1e+39"},
      {"colour of four", graph_of({{"type", "gamma"}, {"inputs", {{"color", {1, 1, 1, 1}}}}}), "/nodes/0/inputs/color",
       "an array of 3 numbers"},
      {"reference without node", math_of({{"a", {{"output", "value"}}}}), "/nodes/0/inputs/a/node",
       "the index of a node"},
      {"reference out of range", math_of({{"a", of(1)}}), "/nodes/0/inputs/a/node", "found 1"},
      {"reference below range", math_of({{"a", {{"node", -1}}}}), "/nodes/0/inputs/a/node", "found -1"},
      {"reference to half a node", math_of({{"a", {{"node", 0.5}}}}), "/nodes/0/inputs/a/node", "found 0.5"},
      {"reference beyond 2^53", math_of({{"a", {{"node", 1e30}}}}), "/nodes/0/inputs/a/node", "found 1e+30"},
      {"reference by name", math_of({{"a", {{"node", "math"}}}}), "/nodes/0/inputs/a/node", "found \"math\""},
      {"output is a number", math_of({{"a", {{"node", 0}, {"output", 3}}}}), "/nodes/0/inputs/a/output", "a string"},
      {"node reads itself", math_of({{"a", of(0)}}), "/nodes/0/inputs", "nodes without a cycle"},
      {"cycle of three",
       {{"nodes",
         {{{"type", "rgb-to-bw"}},
          {{"type", "math"}, {"inputs", {{"a", of(3)}}}},
          {{"type", "math"}, {"inputs", {{"a", of(1)}}}},
          {{"type", "math"}, {"inputs", {{"a", of(0)}, {"b", of(2)}}}}}},
        {"outputs", {{"baseColor", of(0)}}}},
       "/nodes/1/inputs",
       "nodes without a cycle"},
      {"unknown output",
       {{"nodes", {{{"type", "geometry"}}, {{"type", "math"}, {"inputs", {{"a", of(0, "up")}}}}}},
        {"outputs", {{"baseColor", of(1)}}}},
       "/nodes/1/inputs/a",
       "an output of node 0 (\"backfacing\""},
      {"output that must be named",
       {{"nodes", {{{"type", "geometry"}}, {{"type", "math"}, {"inputs", {{"a", of(0)}}}}}},
        {"outputs", {{"baseColor", of(1)}}}},
       "/nodes/1/inputs/a",
       "found none named"},
      {"material's output is a number",
       {{"nodes", {{{"type", "math"}}}}, {"outputs", {{"alpha", 0.5}}}},
       "/outputs/alpha",
       "expected {\"node\": …}, found 0.5"},
      {"material's output of no node",
       {{"nodes", {{{"type", "math"}}}}, {"outputs", {{"alpha", of(1)}}}},
       "/outputs/alpha/node",
       "found 1"},
      {"material's output of an empty graph",
       {{"nodes", json::array()}, {"outputs", {{"alpha", of(0)}}}},
       "/outputs/alpha/node",
       "found 0"},
      {"material's output unknown",
       {{"nodes", {{{"type", "math"}}}}, {"outputs", {{"alpha", of(0, "color")}}}},
       "/outputs/alpha",
       "found \"color\""},
      {"operation unknown", graph_of({{"type", "math"}, {"operation", "root"}}), "/nodes/0/operation",
       "\"square-root\""},
      {"operation is a number", graph_of({{"type", "math"}, {"operation", 0}}), "/nodes/0/operation", "found 0"},
      {"option is no boolean", graph_of({{"type", "math"}, {"clamp", 1}}), "/nodes/0/clamp", "true or false"},
      {"noise in five dimensions", graph_of({{"type", "noise-texture"}, {"dimensions", 5}}), "/nodes/0/dimensions",
       "an integer within 1…4"},
      {"blend unknown", graph_of({{"type", "mix-color"}, {"blend", "over"}}), "/nodes/0/blend", "\"overlay\""},
      {"ramp without table", graph_of({{"type", "color-ramp"}}), "/nodes/0/table",
       "4 numbers for every entry, found 0"},
      {"ramp of an empty table", graph_of({{"type", "color-ramp"}, {"table", json::array()}}), "/nodes/0/table",
       "an array of 4 to 16384 numbers"},
      {"ramp of seven numbers", graph_of({{"type", "color-ramp"}, {"table", {0, 0, 0, 1, 1, 1, 1}}}), "/nodes/0/table",
       "4 numbers for every entry, found 7 numbers"},
      {"ramp of too many", graph_of({{"type", "color-ramp"}, {"table", json(json::array_t(16388, json(0)))}}),
       "/nodes/0/table", "an array of 4 to 16384 numbers, found an array of 16388"},
      {"ramp of words", graph_of({{"type", "color-ramp"}, {"table", {0, 0, 0, "1"}}}), "/nodes/0/table/3", "a number"},
      {"ramp beyond 1e30", graph_of({{"type", "color-ramp"}, {"table", {0, 0, 0, 1e31}}}), "/nodes/0/table/3", "1e+31"},
      {"ramp is an object", graph_of({{"type", "color-ramp"}, {"table", json::object()}}), "/nodes/0/table",
       "an array"},
      {"curves of four", graph_of({{"type", "color-curves"}, {"table", {0, 0, 0, 1}}}), "/nodes/0/table",
       "3 numbers for every entry, found 4 numbers"},
      {"curve over nothing", graph_of({{"type", "number-curve"}, {"table", {0, 1}}, {"min", 1}, {"max", 1}}),
       "/nodes/0/max", "a number > min"},
      {"curve over a range without end", graph_of({{"type", "number-curve"}, {"table", {0, 1}}, {"max", 1e9}}),
       "/nodes/0/max", "found 1000000000.0"},
      {"image of no texture", graph_of({{"type", "image-texture"}}), "/nodes/0/texture", "{\"index\": …}"},
      {"image out of range", graph_of({{"type", "image-texture"}, {"texture", {{"index", 1}}}}),
       "/nodes/0/texture/index", "one of 1 textures, found 1"},
      {"image by a number", graph_of({{"type", "image-texture"}, {"texture", 0}}), "/nodes/0/texture", "an object"},
      {"image in a colour space unknown",
       graph_of({{"type", "image-texture"}, {"texture", {{"index", 0}}}, {"colorSpace", "xyz"}}), "/nodes/0/colorSpace",
       "\"linear\""},
      {"bricks beyond a thousand rows", graph_of({{"type", "brick-texture"}, {"offsetFrequency", 1001}}),
       "/nodes/0/offsetFrequency", "an integer within 0…1000"},
      {"magic of depth 11", graph_of({{"type", "magic-texture"}, {"depth", 11}}), "/nodes/0/depth", "within 0…10"},
      {"65,537 nodes", many(65'537), "/nodes", "at most 65536, found 65537"},
      {"a million nodes", many(1'000'000), "/nodes", "at most 65536, found 1000000"},
      {"1,400 values at a time", all_alive(1400), "", "one that needs at most 512 values at a time"},
      {"sixty thousand in a circle", circle(60'000), "/nodes/0/inputs", "nodes without a cycle"},
  };
}

TEST(GraphReader, EveryBrokenGraphGivesOneClearError)
{
  for (const BrokenGraph& broken : broken_graphs()) {
    SCOPED_TRACE(broken.name);
    try {
      graph_load(broken.graph);
      ADD_FAILURE() << "was accepted";
    } catch (const SceneError& error) {
      const std::string text = error.what();
      EXPECT_EQ(error.json_path, std::string("/materials/0/extensions/RELIEF_graph") + broken.json_path) << text;
      EXPECT_NE(text.find(broken.message), std::string::npos) << text;
      EXPECT_EQ(text.find('\n'), std::string::npos) << text;
      EXPECT_LT(text.size(), 2000u) << text;
    }
  }
}

TEST(GraphReader, FiveHundredValuesAtATimeAreRead)
{
  EXPECT_LE(graph_load(all_alive(500)).graphs[0].num_registers, int{kMostGraphRegisters});
}

}  // namespace
}  // namespace relief
