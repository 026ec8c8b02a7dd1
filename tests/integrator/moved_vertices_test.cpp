// Which meshes are displaced by moving vertices, and what rays then meet.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "integrator/scene_context.h"
#include "integrator/trace.h"
#include "tests/support/loaded_scene.h"

namespace relief::test {
namespace {

using nlohmann::json;

constexpr double kScale = 0.05, kWaves = 9;

/// Sine of one object coordinate; with `kWaves` 0 the same everywhere.
json heights(double waves)
{
  const auto of = [](int node, const char* output) { return json{{"node", node}, {"output", output}}; };
  if (waves == 0) {
    return {{"nodes", {{{"type", "math"}, {"operation", "add"}, {"inputs", {{"a", 0.25}, {"b", 0.5}}}}}},
            {"outputs", {{"height", of(0, "value")}}}};
  }
  return {{"nodes",
           {{{"type", "texture-coordinate"}},
            {{"type", "separate"}, {"inputs", {{"vector", of(0, "object")}}}},
            {{"type", "math"}, {"operation", "multiply"}, {"inputs", {{"a", of(1, "x")}, {"b", waves}}}},
            {{"type", "math"}, {"operation", "sine"}, {"inputs", {{"a", of(2, "value")}}}}}},
          {"outputs", {{"height", of(3, "value")}}}};
}

/// A square of 2 × 2 m of n × n quads, 5 m before a camera.
Scene square(int n, double waves, const json& more = json::object())
{
  std::vector<float> P, N;
  std::vector<std::uint32_t> triangles;
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i <= n; ++i) {
      P.insert(P.end(), {2.0f * static_cast<float>(i) / static_cast<float>(n) - 1,
                         2.0f * static_cast<float>(j) / static_cast<float>(n) - 1, 0});
      N.insert(N.end(), {0, 0, 1});
      if (i == n || j == n) continue;
      const auto a = static_cast<std::uint32_t>(j * (n + 1) + i), above = a + static_cast<std::uint32_t>(n) + 1;
      triangles.insert(triangles.end(), {a, a + 1, above + 1, a, above + 1, above});
    }
  }
  GltfBuilder b;
  const int position = b.accessor(P, "VEC3"), normal = b.accessor(N, "VEC3"), indices = b.accessor(triangles, "SCALAR");
  json displacement{{"heightGraph", heights(waves)}, {"scale", kScale}, {"midlevel", 0}, {"smoothing", true}};
  displacement.update(more);
  b.push("materials", {{"extensions", {{"RELIEF_displacement", displacement}}}});
  b.root_node({{"mesh", b.mesh({{"attributes", {{"POSITION", position}, {"NORMAL", normal}}},
                                {"indices", indices},
                                {"material", 0}})}});
  b.push("cameras", {{"type", "perspective"}, {"perspective", {{"yfov", 0.7}, {"znear", 0.1}}}});
  b.root_node({{"camera", 0}, {"translation", {0, 0, 5}}});
  return load(b);
}

DisplacementOptions options_of(const Scene& scene, int height)
{
  DisplacementOptions options;
  options.camera = scene.cameras[0].camera;
  options.picture_height = height;
  return options;
}

std::size_t num_moved_triangles(const SceneContext& context)
{
  return context.displacements.moved().empty()
             ? 0
             : context.meshes[static_cast<std::size_t>(context.instances[0].mesh_index)].num_triangles;
}

/// The largest difference of rays' hits from the heights that some function has.
template <typename Heights>
double farthest_from(const SceneContext& context, const Heights& expected)
{
  std::mt19937_64 random(3);
  std::uniform_real_distribution<float> unit(-0.99f, 0.99f);
  double most = 0;
  for (int k = 0; k < 4000; ++k) {
    const float x = unit(random), y = unit(random);
    const TraceHit hit = trace_rays(context, std::vector<TraceRay>{{{x, y, 3}, {0, 0, -1}}})[0];
    if (!hit.hit) return HUGE_VAL;
    most = std::max(most, std::abs(static_cast<double>(hit.P.z) - expected(static_cast<double>(x))));
  }
  return most;
}

/// Triangles of about a pixel are moved as they are: the surface is straight between their vertices, as in Cycles.
TEST(MovedVertices, AreThoseOfTheMeshWhereTrianglesAreSmall)
{
  constexpr int kQuads = 48;  // of four pixels
  const Scene scene = square(kQuads, kWaves);
  const SceneContext context(scene, options_of(scene, 180));
  EXPECT_EQ(context.displacements.size(), 0u);
  EXPECT_EQ(num_moved_triangles(context), 2u * kQuads * kQuads);
  const auto at_vertices = [](double x) {
    const double along = 0.5 * (x + 1) * kQuads, i = std::floor(along);
    const auto wave = [](double k) { return kScale * std::sin(kWaves * (2 * k / kQuads - 1)); };
    return wave(i) + (along - i) * (wave(i + 1) - wave(i));
  };
  EXPECT_LT(farthest_from(context, at_vertices), 1e-6);
}

/// Larger ones are divided to pixels, and have the heights between their vertices too.
TEST(MovedVertices, AreThoseOfDividedTrianglesWhereTheyAreLarge)
{
  const Scene scene = square(1, kWaves);
  const SceneContext context(scene, options_of(scene, 360));
  EXPECT_EQ(context.displacements.size(), 0u);
  // 2 m are 195 pixels; sides are one or two long.
  EXPECT_GE(num_moved_triangles(context), 2u * 97 * 97);
  EXPECT_LE(num_moved_triangles(context), 2u * 300 * 300);
  const double cell = 2 * 2.0 / 195;
  EXPECT_LT(farthest_from(context, [](double x) { return kScale * std::sin(kWaves * x); }),
            kScale * kWaves * kWaves * cell * cell / 8 + 1e-6);
}

TEST(MovedVertices, AreNoneWhereAMethodIsNamedOrRoomIsShort)
{
  const Scene named = square(48, kWaves, {{"method", "chord"}});
  const SceneContext by_method(named, options_of(named, 180));
  EXPECT_EQ(by_method.displacements.size(), 1u);
  EXPECT_TRUE(by_method.displacements.moved().empty());
  const Scene scene = square(1, kWaves);
  DisplacementOptions options = options_of(scene, 360);
  options.dicing_bytes = 1;
  const SceneContext short_of_room(scene, options);
  EXPECT_EQ(short_of_room.displacements.size(), 1u);
  EXPECT_LT(farthest_from(short_of_room, [](double x) { return kScale * std::sin(kWaves * x); }), 2e-4);
}

/// One height everywhere, by a graph that reads nothing, as a map or at points: a moved mesh, however coarse it is.
TEST(MovedVertices, AreThoseOfTheMeshWhereHeightsAreTheSame)
{
  for (const char* evaluate : {"auto", "points"}) {
    json graph = heights(0);
    graph["evaluate"] = evaluate;
    const Scene scene = square(2, 0, {{"heightGraph", graph}});
    const SceneContext context(scene, options_of(scene, 2000));
    EXPECT_EQ(num_moved_triangles(context), 8u) << evaluate;
    EXPECT_LT(farthest_from(context, [](double) { return kScale * 0.75; }), 1e-7) << evaluate;
  }
}

/// What a mesh is in the first picture of a sequence it stays.
TEST(MovedVertices, StayTheSameInASequence)
{
  const Scene scene = square(48, kWaves);
  DisplacementOptions far = options_of(scene, 180), near = far;
  near.camera->world_from_camera.p = {0, 0, 0.05f};
  near.picture_height = far.picture_height = 360;
  far.choices = near.choices = std::make_shared<DicingChoices>();
  const SceneContext first(scene, far), second(scene, near);
  EXPECT_EQ(num_moved_triangles(first), 2u * 48 * 48);
  EXPECT_EQ(num_moved_triangles(second), 2u * 48 * 48);
  far.choices = near.choices = std::make_shared<DicingChoices>();
  const SceneContext from_near(scene, near), then_far(scene, far);
  EXPECT_GT(num_moved_triangles(from_near), 3u * 48 * 48);
  EXPECT_EQ(then_far.displacements.size(), 0u);
}

}  // namespace
}  // namespace relief::test
