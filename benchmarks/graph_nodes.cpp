// What nodes of value graphs cost: nanoseconds a point, one thread, in each interpreter that this machine has.
//
//   relief_bench_graph_nodes [--points N] [--rounds N]
//
// Each node is a graph of its own over object coordinates, uniform in a cube of 20 units, whose values serve as emission.
// Rounds go through all nodes in turn, so that whatever else the machine does hits all alike; the best of each is printed.
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <random>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "integrator/stages.h"
#include "scene/load.h"

namespace relief {
namespace {

using nlohmann::json;

struct Case {
  const char* name;
  json node;           ///< reads node 0, the coordinates
  const char* output;  ///< that is shown
};

json ramp_table()
{
  json table = json::array();
  for (int i = 0; i < 1024; ++i) table.push_back(i / 1024.0);
  return table;
}

std::vector<Case> cases()
{
  const json at = {{"node", 0}, {"output", "object"}};
  const auto texture = [&](const char* type, const json& options = json::object()) {
    json node = {{"type", type}, {"inputs", {{"vector", at}}}};
    node.update(options, true);
    return node;
  };
  const auto math = [&](const char* operation) {
    return json{{"type", "math"}, {"operation", operation}, {"inputs", {{"a", at}, {"b", 1.7}}}};
  };
  return {
      {"coordinates alone", {{"type", "combine"}}, ""},
      {"math: add", math("add"), "value"},
      {"math: sine", math("sine"), "value"},
      {"math: power", math("power"), "value"},
      {"vector math: normalize",
       {{"type", "vector-math"}, {"operation", "normalize"}, {"inputs", {{"a", at}}}},
       "vector"},
      {"mapping", texture("mapping", {{"inputs", {{"rotation", {1, 2, 3}}, {"scale", {2, 3, 4}}}}}), "vector"},
      {"mix: overlay", {{"type", "mix-color"}, {"blend", "overlay"}, {"inputs", {{"a", at}, {"b", 0.3}}}}, "color"},
      {"hue, saturation", {{"type", "hue-saturation"}, {"inputs", {{"color", at}, {"hue", 0.6}}}}, "color"},
      {"ramp", {{"type", "color-ramp"}, {"inputs", {{"factor", at}}}, {"table", ramp_table()}}, "color"},
      {"noise, detail 0", texture("noise-texture", {{"inputs", {{"detail", 0}}}}), "factor"},
      {"noise", texture("noise-texture"), "factor"},
      {"noise: colour", texture("noise-texture"), "color"},
      {"noise, detail 15", texture("noise-texture", {{"inputs", {{"detail", 15}}}}), "factor"},
      {"noise, 4 dimensions", texture("noise-texture", {{"dimensions", 4}}), "factor"},
      {"Voronoi: F1", texture("voronoi-texture"), "distance"},
      {"Voronoi: F1, 2 dimensions", texture("voronoi-texture", {{"dimensions", 2}}), "distance"},
      {"Voronoi: smooth F1", texture("voronoi-texture", {{"feature", "smooth-f1"}}), "distance"},
      {"Voronoi: distance to edge", texture("voronoi-texture", {{"feature", "distance-to-edge"}}), "distance"},
      {"Musgrave: fBm", texture("musgrave-texture"), "factor"},
      {"wave", texture("wave-texture", {{"inputs", {{"distortion", 2}}}}), "factor"},
      {"magic", texture("magic-texture"), "color"},
      {"bricks", texture("brick-texture"), "color"},
      {"checker", texture("checker-texture"), "color"},
  };
}

GraphProgram compiled(const Case& c)
{
  json outputs = {{"emission", {{"node", 0}, {"output", "object"}}}};
  if (*c.output != '\0') outputs["emission"] = {{"node", 1}, {"output", c.output}};
  const float corners[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  const auto folder = std::filesystem::temp_directory_path() / "relief_bench_graph_nodes";
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "data.bin", std::ios::binary).write(reinterpret_cast<const char*>(corners), sizeof corners);
  const json file = {
      {"asset", {{"version", "2.0"}}},
      {"extensionsUsed", {"RELIEF_graph"}},
      {"scene", 0},
      {"scenes", {{{"nodes", {0}}}}},
      {"nodes", {{{"mesh", 0}}}},
      {"meshes", {{{"primitives", {{{"attributes", {{"POSITION", 0}}}, {"material", 0}}}}}}},
      {"accessors", {{{"bufferView", 0}, {"componentType", 5126}, {"count", 3}, {"type", "VEC3"}}}},
      {"bufferViews", {{{"buffer", 0}, {"byteLength", sizeof corners}}}},
      {"buffers", {{{"uri", "data.bin"}, {"byteLength", sizeof corners}}}},
      {"materials",
       {{{"extensions",
          {{"RELIEF_graph", {{"nodes", {{{"type", "texture-coordinate"}}, c.node}}, {"outputs", outputs}}}}}}}}};
  std::ofstream(folder / "scene.gltf") << file;
  GraphProgram program = scene_load(folder / "scene.gltf").graphs.at(0);
  std::filesystem::remove_all(folder);
  return program;
}

/// @return  seconds for all points
double run(GraphRun run_graph, const GraphProgram& program, const std::vector<F8>& points, float* sum)
{
  const GraphProgramView view = program.view();
  GraphRegisters registers;
  const auto start = std::chrono::steady_clock::now();
  for (std::size_t i = 0; i + 3 <= points.size(); i += 3) {
    for (std::uint32_t k = 0; k < view.num_inputs; ++k) {
      const auto axis =
          static_cast<std::size_t>(view.inputs[k].quantity) - static_cast<std::size_t>(GraphQuantity::object_x);
      registers.lanes[view.inputs[k].register_index] = points[i + axis % 3];
    }
    run_graph(view, nullptr, registers);
    *sum += graph_values({&view, &registers, 0}).of[static_cast<int>(GraphOutput::emission)].x;
  }
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

int bench(std::size_t num_points, int num_rounds)
{
  std::mt19937 random(1);
  std::uniform_real_distribution<float> coordinate(-10, 10);
  std::vector<F8> points(num_points / 8 * 3);
  for (F8& lanes : points) {
    for (int k = 0; k < 8; ++k) lanes[k] = coordinate(random);
  }
  struct Measured {
    std::string name;
    GraphProgram program;
    double best[2] = {1e9, 1e9};
  };
  std::vector<Measured> all;
  for (const Case& c : cases()) all.push_back({c.name, compiled(c)});
  const bool has_avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  float sum = 0;
  for (int round = 0; round < num_rounds; ++round) {
    for (Measured& m : all) {
      m.best[0] = std::min(m.best[0], run(graph_run_baseline, m.program, points, &sum));
      if (has_avx2) m.best[1] = std::min(m.best[1], run(graph_run_avx2, m.program, points, &sum));
    }
  }
  fmt::print("| node | ns a point, baseline | ns a point, AVX2 |\n| --- | --- | --- |\n");
  const double to_nanoseconds = 1e9 / static_cast<double>(points.size() / 3 * 8);
  for (const Measured& m : all) {
    const std::string avx2 = has_avx2 ? fmt::format("{:.2f}", m.best[1] * to_nanoseconds) : "–";
    fmt::print("| {} | {:.2f} | {} |\n", m.name, m.best[0] * to_nanoseconds, avx2);
  }
  // What nobody reads might not be computed.
  return sum == 12345.678f ? 1 : 0;
}

}  // namespace
}  // namespace relief

int main(int argc, char** argv)
{
  std::size_t num_points = 16384;
  int num_rounds = 20;
  CLI::App app{"Cost of nodes of value graphs"};
  app.add_option("--points", num_points)->check(CLI::Range(8u, 1u << 24));
  app.add_option("--rounds", num_rounds)->check(CLI::Range(1, 10000));
  CLI11_PARSE(app, argc, argv);
  return relief::bench(num_points, num_rounds);
}
