// Light that a value graph gives a lamp of closures: found by sampling lights as by following the BSDF.
#include <array>
#include <filesystem>
#include <fstream>

#include <nlohmann/json.hpp>

#include "scene/load.h"
#include "tests/image/render_runs.h"
#include "tests/support/gltf_builder.h"

namespace relief::test {

namespace {

using nlohmann::json;

json node(int index, const char* output) { return {{"node", index}, {"output", output}}; }

/// The Cornell box, whose lamp emits by a graph.
/// @param color  of its emission
Scene cornell_lit_by(const json& nodes, const json& color)
{
  const auto folder = std::filesystem::path(RELIEF_SOURCE_DIR) / "examples" / "cornell";
  std::ifstream file(folder / "cornell.gltf");
  json gltf = json::parse(file);
  gltf["buffers"][0]["uri"] = "cornell.bin";
  gltf["extensionsUsed"].push_back("RELIEF_surface");
  gltf["extensionsUsed"].push_back("RELIEF_graph");
  json& lamp = gltf["materials"][3];
  lamp["emissiveFactor"] = {0, 0, 0};
  lamp["extensions"] = {
      {"RELIEF_graph", {{"nodes", nodes}}},
      {"RELIEF_surface",
       {{"closures", {{{"type", "emission"}, {"color", color}}, {{"type", "diffuse"}, {"color", {0.5, 0.5, 0.5}}}}}}}};
  const TemporaryFolder copy;
  std::filesystem::copy(folder / "cornell.bin", copy / "cornell.bin");
  return scene_load(copy.write("scene.gltf", gltf.dump()));
}

RunOptions small_runs()
{
  RunOptions run;
  run.width = run.height = 32;
  run.samples = 256;
  return run;
}

TEST(GraphEmission, LightSamplingFindsWhatPathsFind)
{
  const json nodes = {
      {{"type", "geometry"}},
      {{"type", "checker-texture"},
       {"inputs",
        {{"vector", node(0, "position")}, {"scale", 8}, {"color1", {60, 40, 20}}, {"color2", {20, 40, 60}}}}}};
  const std::array<Picture, 3> pictures =
      expect_techniques_agree(cornell_lit_by(nodes, node(1, "color")), small_runs(), "checker");
  // Sampling the lamp has far less noise than meeting it.
  const auto variance = [](const Picture& picture) {
    double sum = 0;
    for (const float v : picture.find("variance.R")->values) sum += static_cast<double>(v);
    return sum;
  };
  EXPECT_LT(8 * variance(pictures[0]), variance(pictures[2]));
}

/// Red grows with the depth of the ray, green falls: light that is asked for counts as light that is met.
TEST(GraphEmission, DepthsAreTheSameForLightThatIsAskedForAndMet)
{
  const auto math = [](const char* operation, const json& a, const json& b) {
    return json{{"type", "math"}, {"operation", operation}, {"inputs", {{"a", a}, {"b", b}}}};
  };
  const json nodes = {{{"type", "light-path"}},
                      math("multiply", node(0, "depth"), 20),
                      math("add", node(0, "depth"), 1),
                      math("divide", 60, node(2, "value")),
                      {{"type", "combine"}, {"inputs", {{"x", node(1, "value")}, {"y", node(3, "value")}, {"z", 20}}}}};
  expect_techniques_agree(cornell_lit_by(nodes, node(4, "vector")), small_runs(), "depths");
}

}  // namespace

}  // namespace relief::test
