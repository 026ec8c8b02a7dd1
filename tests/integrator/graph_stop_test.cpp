// The word to stop ends renders in the middle of value graphs that would take hours: of surfaces, lamps and computed heights. What
// would not end does not pass.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <thread>
#include <vector>

#include "integrator/render.h"
#include "tests/support/loaded_scene.h"

namespace relief::test {
namespace {

using nlohmann::json;

json reference(int node, const char* output) { return {{"node", node}, {"output", output}}; }

/// Nodes of the dearest kind, one after the other; the last one's number is theirs.
/// @param coordinate  output of Texture Coordinate that the first one looks at
json slow_nodes(int count, const char* coordinate)
{
  json nodes = {{{"type", "texture-coordinate"}}};
  for (int i = 0; i < count; ++i) {
    nodes.push_back({{"type", "voronoi-texture"},
                     {"dimensions", 4},
                     {"feature", "smooth-f1"},
                     {"inputs",
                      {{"vector", i == 0 ? reference(0, coordinate) : reference(i, "position")}, {"scale", 3}, {"detail", 15}}}});
  }
  return nodes;
}

/// A plane under a lamp and a camera.
/// @param extensions  of its material
/// @param light       the lamp
GltfBuilder plane(const json& extensions, const json& light)
{
  GltfBuilder b;
  const int P = b.accessor<float>({-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, -1, 0, 1, 1, 0, -1, 1, 0}, "VEC3");
  b.push("materials", {{"extensions", extensions}});
  b.root_node({{"mesh", b.mesh({{"attributes", {{"POSITION", P}}}, {"material", 0}})}});
  b.push("cameras", {{"type", "perspective"}, {"perspective", {{"yfov", 0.7}, {"znear", 0.1}}}});
  b.root_node({{"camera", 0}, {"translation", {0, 0, 3}}});
  b.root_node({{"translation", {0, 0, 2}}, {"extensions", {{"RELIEF_area_light", light}}}});
  return b;
}

/// Renders, and wishes to stop soon after the start.
Statistics stopped(const GltfBuilder& b, double time_limit)
{
  const Scene scene = load(b);
  RenderOptions options;
  options.settings = scene.render;
  options.settings.width = options.settings.height = 64;
  options.settings.samples = 4096;
  options.camera = scene.cameras.front().camera;
  options.time_limit_seconds = time_limit;
  std::atomic<bool> stop{false};
  std::thread wish([&] {
    if (time_limit > 0) return;
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    stop = true;
  });
  Statistics stats;
  render(scene, options, stop, {}, stats);
  wish.join();
  return stats;
}

TEST(GraphStop, EndsInTheMiddleOfSurfaces)
{
  const json graph = {{"nodes", slow_nodes(5000, "object")}, {"outputs", {{"baseColor", reference(5000, "position")}}}};
  EXPECT_EQ(stopped(plane({{"RELIEF_graph", graph}}, {{"power", 10}}), 0).stop_reason, "interrupted");
}

TEST(GraphStop, EndsWhenTheTimeIsUp)
{
  const json graph = {{"nodes", slow_nodes(5000, "object")}, {"outputs", {{"baseColor", reference(5000, "position")}}}};
  EXPECT_EQ(stopped(plane({{"RELIEF_graph", graph}}, {{"power", 10}}), 0.05).stop_reason, "time_limit");
}

TEST(GraphStop, EndsInTheMiddleOfLamps)
{
  const json graph = {{"nodes", slow_nodes(40, "uv")}, {"outputs", {{"emission", reference(40, "color")}}}};
  EXPECT_EQ(stopped(plane(json::object(), {{"power", 10}, {"graph", graph}}), 0).stop_reason, "interrupted");
}

TEST(GraphStop, EndsInTheMiddleOfHeights)
{
  const json graph = {{"nodes", slow_nodes(40, "object")}, {"outputs", {{"height", reference(40, "distance")}}}};
  const json displacement = {{"heightGraph", graph}, {"scale", 0.1}, {"cells", 4096}};
  EXPECT_EQ(stopped(plane({{"RELIEF_displacement", displacement}}, {{"power", 10}}), 0).stop_reason, "interrupted");
}

}  // namespace
}  // namespace relief::test
