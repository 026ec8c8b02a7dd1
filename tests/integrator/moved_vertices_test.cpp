// Which meshes are displaced by moving vertices, and what rays then meet.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <vector>

#include "integrator/kept_context.h"
#include "integrator/scene_context.h"
#include "integrator/trace.h"
#include "tests/support/loaded_scene.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

using nlohmann::json;

constexpr double kScale = 0.05, kWaves = 9, kTiledWaves = 3 * std::numbers::pi;

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
  std::vector<float> P, N, uv;
  std::vector<std::uint32_t> triangles;
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i <= n; ++i) {
      const float u = static_cast<float>(i) / static_cast<float>(n), v = static_cast<float>(j) / static_cast<float>(n);
      P.insert(P.end(), {2 * u - 1, 2 * v - 1, 0});
      N.insert(N.end(), {0, 0, 1});
      uv.insert(uv.end(), {u, v});
      if (i == n || j == n) continue;
      const auto a = static_cast<std::uint32_t>(j * (n + 1) + i), above = a + static_cast<std::uint32_t>(n) + 1;
      triangles.insert(triangles.end(), {a, a + 1, above + 1, a, above + 1, above});
    }
  }
  GltfBuilder b;
  const int position = b.accessor(P, "VEC3"), normal = b.accessor(N, "VEC3"), at = b.accessor(uv, "VEC2"),
            indices = b.accessor(triangles, "SCALAR");
  json displacement{{"heightGraph", heights(waves)}, {"scale", kScale}, {"midlevel", 0}, {"smoothing", true}};
  displacement.update(more);
  b.push("materials", {{"extensions", {{"RELIEF_displacement", displacement}}}});
  b.root_node({{"mesh", b.mesh({{"attributes", {{"POSITION", position}, {"NORMAL", normal}, {"TEXCOORD_0", at}}},
                                {"indices", indices},
                                {"material", 0}})}});
  b.push("cameras", {{"type", "perspective"}, {"perspective", {{"yfov", 0.7}, {"znear", 0.1}}}});
  b.root_node({{"camera", 0}, {"translation", {0, 0, 5}}});
  return load(b);
}

/// The same under a map of such heights, which tile.
Scene mapped_square(int n)
{
  constexpr int kTexels = 1024;
  std::vector<std::uint16_t> texels;
  for (int k = 0; k < kTexels * kTexels; ++k) {
    const double x = 2 * (k % kTexels + 0.5) / kTexels - 1;
    texels.push_back(static_cast<std::uint16_t>(std::lround(65535 * (0.5 + 0.5 * std::sin(kTiledWaves * x)))));
  }
  Scene scene = square(n, kWaves);
  DisplacementSettings by_map = add_displacement(scene, kTexels, std::move(texels), 2 * static_cast<float>(kScale));
  by_map.smoothing = true;
  scene.displacements = {by_map};
  return scene;
}

/// Heights of a square at its vertices, and straight lines between them.
auto heights_at_vertices(int quads, double waves)
{
  return [=](double x) {
    const double along = 0.5 * (x + 1) * quads, i = std::floor(along);
    const auto wave = [=](double k) { return kScale * std::sin(waves * (2 * k / quads - 1)); };
    return wave(i) + (along - i) * (wave(i + 1) - wave(i));
  };
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
  EXPECT_LT(farthest_from(context, heights_at_vertices(kQuads, kWaves)), 1e-6);
}

/// So are those of a map, where triangles are no larger than two pixels, or than the error that is allowed, and many. (At 90 pixels a
/// side is .7 long in the mean.)
TEST(MovedVertices, AreThoseOfTheMeshWhereTrianglesUnderAMapAreSmall)
{
  constexpr int kQuads = 80;
  Scene scene = mapped_square(kQuads);
  const DisplacementOptions options = options_of(scene, 90);
  const SceneContext small(scene, options);
  EXPECT_EQ(num_moved_triangles(small), 2u * kQuads * kQuads);
  // A wave sags by 3e-4 between vertices.
  EXPECT_LT(farthest_from(small, heights_at_vertices(kQuads, kTiledWaves)), 1e-5);
  const auto exact = [](double x) { return kScale * std::sin(kTiledWaves * x); };
  const auto is_exact = [&](const Scene& traced, const DisplacementOptions& by) {
    const SceneContext context(traced, by);
    return context.displacements.size() == 1 && farthest_from(context, exact) < 1e-5;
  };
  EXPECT_TRUE(is_exact(scene, options_of(scene, 720)));
  EXPECT_TRUE(is_exact(mapped_square(48), options));
  DisplacementOptions named = options, without_picture = options, diced = options;
  named.method = DisplacementMethod::chord;
  EXPECT_TRUE(is_exact(scene, named));
  without_picture.camera.reset();
  EXPECT_TRUE(is_exact(scene, without_picture));
  diced.error = 0.05;
  EXPECT_EQ(SceneContext(scene, diced).displacements.moved().size(), 0u);
  diced.error = 1;
  EXPECT_EQ(SceneContext(scene, diced).displacements.moved().size(), 1u);
  // What the first picture of a sequence has the others have.
  for (const bool is_far : {true, false}) {
    DisplacementOptions sequence = options;
    sequence.choices = std::make_shared<DicingChoices>();
    sequence.camera->world_from_camera.p.z = is_far ? 5.0f : 0.5f;
    const std::size_t moved = SceneContext(scene, sequence).displacements.moved().size();
    EXPECT_EQ(moved, is_far ? 1u : 0u);
    sequence.camera->world_from_camera.p.z = is_far ? 0.5f : 5.0f;
    EXPECT_EQ(SceneContext(scene, sequence).displacements.moved().size(), moved);
  }
  scene.displacements[0].divide = true;
  EXPECT_TRUE(is_exact(scene, options));
}

/// Larger ones are divided into four or sixteen where surfaces may err by pixels: to cells of two of these.
TEST(MovedVertices, UnderAMapAreThoseOfHalvedSidesWhereItMayErr)
{
  constexpr int kQuads = 80;
  const Scene scene = mapped_square(kQuads);
  DisplacementOptions options = options_of(scene, 90);
  for (const auto& [error, halves] : {std::pair{0.25f, 2}, {0.12f, 4}}) {
    options.error = error;
    const SceneContext context(scene, options);
    EXPECT_EQ(num_moved_triangles(context), static_cast<std::size_t>(2 * kQuads * kQuads * halves * halves));
    EXPECT_LT(farthest_from(context, heights_at_vertices(halves * kQuads, kTiledWaves)), 1e-5);
    DisplacementOptions without_room = options;
    without_room.auto_bytes = 1;
    EXPECT_EQ(SceneContext(scene, without_room).displacements.moved().size(), 0u);
    // What the first picture of a sequence has the others have.
    DisplacementOptions sequence = options;
    sequence.choices = std::make_shared<DicingChoices>();
    for (const float z : {5.0f, 3.0f}) {
      sequence.camera->world_from_camera.p.z = z;
      EXPECT_EQ(num_moved_triangles(SceneContext(scene, sequence)), num_moved_triangles(context));
    }
  }
}

/// What is kept for the next picture stays where the camera moves, and is made anew for a picture of another height.
TEST(MovedVertices, UnderAMapAreChosenByTheHeightOfThePicture)
{
  const Scene scene = mapped_square(80);
  KeptContext kept;
  ContextOptions options;
  options.displacement = options_of(scene, 90);
  EXPECT_EQ(kept.get(scene, options).displacements.moved().size(), 1u);
  options.displacement.camera->world_from_camera.p.z = 0.5f;
  EXPECT_EQ(kept.get(scene, options).displacements.moved().size(), 1u);
  EXPECT_TRUE(kept.is_kept());
  options.displacement.picture_height = 720;
  EXPECT_EQ(kept.get(scene, options).displacements.moved().size(), 0u);
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

/// Where the divided triangles have no room but tiles of them do, rays meet the same surface in these, in all pictures of a sequence.
TEST(MovedVertices, AreThoseOfTilesWhereRoomIsShort)
{
  const Scene scene = square(1, kWaves);
  const DisplacementOptions options = options_of(scene, 720);
  const SceneContext whole(scene, options);
  EXPECT_GT(num_moved_triangles(whole), 2u * 150 * 150);
  DisplacementOptions short_of_room = options;
  short_of_room.dicing_bytes = 400'000;
  short_of_room.choices = std::make_shared<DicingChoices>();
  std::mt19937_64 random(3);
  std::uniform_real_distribution<float> unit(-0.9f, 0.9f);
  std::vector<TraceRay> rays;
  for (int k = 0; k < 2000; ++k)
    rays.push_back({{unit(random), unit(random), 3}, {0.3f * unit(random), 0.3f * unit(random), -1}});
  const std::vector<TraceHit> expected = trace_rays(whole, rays);
  for (int picture = 0; picture < 2; ++picture) {
    const SceneContext in_tiles(scene, short_of_room);
    EXPECT_EQ(in_tiles.displacements.method_names(), "tiles");
    EXPECT_TRUE(in_tiles.displacements.warnings().empty());
    const std::vector<TraceHit> hits = trace_rays(in_tiles, rays);
    for (std::size_t k = 0; k < rays.size(); ++k) {
      ASSERT_EQ(hits[k].hit, expected[k].hit) << k;
      if (!hits[k].hit) continue;
      ASSERT_LT(length(hits[k].P - expected[k].P), 1e-5f) << k;
      ASSERT_GT(dot(hits[k].Ng, expected[k].Ng), 1 - 1e-4f) << k;
      ASSERT_LE(hits[k].triangle_index, 1u) << k;
    }
    EXPECT_GT(in_tiles.displacements.tiles().made, 10u);
  }
  // With room for the mesh, the pictures after have it.
  short_of_room.dicing_bytes = std::uint64_t{1} << 30;
  EXPECT_EQ(SceneContext(scene, short_of_room).displacements.method_names(), "vertices");
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

/// However small triangles are, if that is asked for.
TEST(MovedVertices, AreThoseOfDividedTrianglesWhereTheFileSaysSo)
{
  const Scene scene = square(48, kWaves, {{"divide", true}});
  const SceneContext context(scene, options_of(scene, 360));
  EXPECT_GE(num_moved_triangles(context), 2u * 96 * 96);
}

/// A square of 2 × 2 m across z, with uv, under a displacement; its node is turned by 90° about x and scaled by (1, 2, 3).
Scene moved_square(const json& displacement, const json& node = json::object())
{
  const std::vector<float> P{-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0}, N{0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1};
  const std::vector<float> uv{0, 1, 1, 1, 1, 0, 0, 0};
  const std::vector<std::uint32_t> triangles{0, 1, 2, 0, 2, 3};
  GltfBuilder b;
  const int position = b.accessor(P, "VEC3"), normal = b.accessor(N, "VEC3"), at = b.accessor(uv, "VEC2"),
            indices = b.accessor(triangles, "SCALAR");
  // One pixel of .2, .4, .8.
  b.json["images"] = {
      {{"uri",
        "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGMwTjsDAAI1AWaKkkQy"
        "AAAAAElFTkSuQmCC"}}};
  b.json["textures"] = {{{"source", 0}}};
  b.push("materials", {{"extensions", {{"RELIEF_displacement", displacement}}}});
  json placed = node;
  placed["mesh"] = b.mesh({{"attributes", {{"POSITION", position}, {"NORMAL", normal}, {"TEXCOORD_0", at}}},
                           {"indices", indices},
                           {"material", 0}});
  b.root_node(placed);
  b.push("cameras", {{"type", "perspective"}, {"perspective", {{"yfov", 0.7}, {"znear", 0.1}}}});
  b.root_node({{"camera", 0}, {"translation", {0, 0, 5}}});
  return load(b);
}

/// Of a graph whose vectors bend the square sideways as well: where a ray from above meets it, the base point is found by iteration.
TEST(VectorDisplacement, BringsPointsWhereTheGraphSays)
{
  const auto of = [](int node, const char* output) { return json{{"node", node}, {"output", output}}; };
  const auto wave = [&](const char* of_axis, double by) {
    return json{{"type", "math"}, {"operation", "multiply"}, {"inputs", {{"a", of(1, of_axis)}, {"b", by}}}};
  };
  const auto sine = [&](int node) {
    return json{{"type", "math"}, {"operation", "sine"}, {"inputs", {{"a", of(node, "value")}}}};
  };
  // 3y, 9x and their sines
  const json nodes{{{"type", "texture-coordinate"}},
                   {{"type", "separate"}, {"inputs", {{"vector", of(0, "object")}}}},
                   wave("y", 3),
                   wave("x", 9),
                   sine(2),
                   sine(3),
                   {{"type", "combine"}, {"inputs", {{"x", of(4, "value")}, {"y", 0.5}, {"z", of(5, "value")}}}}};
  const Scene scene = moved_square({{"vectorGraph", {{"nodes", nodes}, {"outputs", {{"vector", of(6, "vector")}}}}},
                                    {"scale", 0.2},
                                    {"midlevel", 0.25},
                                    {"smoothing", true}});
  const SceneContext context(scene, options_of(scene, 720));
  EXPECT_EQ(context.displacements.size(), 0u);
  struct Base {
    double x, y, z;  // of the base, and the height that it is brought to
  };
  const auto base_of = [](double X, double Y) {
    const double y = Y - 0.2 * (0.5 - 0.25), x = X - 0.2 * (std::sin(3 * y) - 0.25);
    return Base{x, y, 0.2 * (std::sin(9 * x) - 0.25)};
  };
  std::mt19937_64 random(5);
  std::uniform_real_distribution<float> unit(-0.7f, 0.7f);
  double most = 0;
  for (int k = 0; k < 4000; ++k) {
    const float X = unit(random), Y = unit(random);
    const TraceHit hit = trace_rays(context, std::vector<TraceRay>{{{X, Y, 3}, {0, 0, -1}}})[0];
    ASSERT_TRUE(hit.hit);
    const Base base = base_of(static_cast<double>(X), static_cast<double>(Y));
    most = std::max(most, std::abs(static_cast<double>(hit.P.z) - base.z));
  }
  // Sides of a pixel or two are 5 to 10 mm long; sines of amplitude .2 and frequency 9 sag by .2 · 81 · l² / 8.
  EXPECT_LT(most, 3e-4);
  const MovedMesh& moved = context.displacements.moved()[0];
  ASSERT_EQ(moved.N.size(), moved.P.size());
  double most_slope = 0;
  for (std::size_t k = 0; k < moved.P.size(); ++k) {
    const Base base = base_of(static_cast<double>(moved.P[k].x), static_cast<double>(moved.P[k].y));
    EXPECT_NEAR(static_cast<double>(moved.P[k].z), base.z, 2e-6);
    if (std::max(std::abs(base.x), std::abs(base.y)) > 0.95) continue;  // one-sided there
    const double along_x = 1.8 * std::cos(9 * base.x), along_y = -along_x * 0.6 * std::cos(3 * base.y);
    const auto slope = [&](float c) { return -static_cast<double>(c / moved.N[k].z); };
    most_slope =
        std::max({most_slope, std::abs(slope(moved.N[k].x) - along_x), std::abs(slope(moved.N[k].y) - along_y)});
  }
  EXPECT_LT(most_slope, 0.05);
}

/// One vector everywhere, of a map: where it brings the middle of a square whose node is turned and stretched.
TEST(VectorDisplacement, HasTheAxesOfItsSpace)
{
  const json node{{"rotation", {std::sqrt(0.5), 0, 0, std::sqrt(0.5)}}, {"scale", {1, 2, 3}}};
  const double x = 0.2 - 0.1, y = 0.4 - 0.1, z = 0.8 - 0.1;
  struct Case {
    const char* space;
    double object[3];  // of the vector times a scale of 2
  };
  // glTF's world has x to the right, y up; that of vectors z up, which is its −z for y. About x by 90°: object y is world z, object z is world −y.
  // In the world the vector is (x, z, −y), in the space of the mesh so (x, −y/2, −z/3).
  const Case cases[] = {{"object", {x, y, z}}, {"world", {x, -y / 2, -z / 3}}, {"tangent", {x, z, y}}};
  for (const Case& c : cases) {
    const Scene scene = moved_square(
        {{"vectorTexture", {{"index", 0}}}, {"space", c.space}, {"scale", 2}, {"midlevel", 0.1}, {"cells", 4}}, node);
    const SceneContext context(scene, options_of(scene, 90));
    ASSERT_EQ(context.displacements.moved().size(), 1u) << c.space;
    const MovedMesh& moved = context.displacements.moved()[0];
    ASSERT_EQ(num_moved_triangles(context), 2u * 16) << c.space;
    const Mesh& mesh = scene.meshes[0];
    for (int axis = 0; axis < 3; ++axis) {
      const auto part = [&](Vec3f P) { return static_cast<double>(axis == 0 ? P.x : axis == 1 ? P.y : P.z); };
      EXPECT_NEAR(part(moved.P[0]) - part(mesh.P[mesh.triangles[0].v0]), 2 * c.object[axis], 1e-6) << c.space << axis;
    }
  }
}

/// Where the triangles have no room, rays meet the same surface in tiles; only where these have none either it is coarser, which is
/// said.
TEST(VectorDisplacement, IsInTilesWhereRoomIsShort)
{
  const auto displaced = [](const char* method) {
    json graph = heights(kWaves);
    graph["nodes"].push_back(
        {{"type", "combine"},
         {"inputs", {{"x", {{"node", 3}, {"output", "value"}}}, {"z", {{"node", 3}, {"output", "value"}}}}}});
    graph["outputs"] = {{"vector", {{"node", graph["nodes"].size() - 1}}}};
    return moved_square({{"vectorGraph", graph}, {"scale", kScale}, {"smoothing", true}, {"method", method}});
  };
  const Scene scene = displaced("auto"), forced = displaced("chord");
  DisplacementOptions options = options_of(scene, 720);
  const SceneContext whole(scene, options);
  EXPECT_GT(num_moved_triangles(whole), 2u * 150 * 150);
  DisplacementOptions short_of_room = options;
  short_of_room.dicing_bytes = 200'000;
  const SceneContext in_tiles(scene, short_of_room), by_method(forced, options);
  std::mt19937_64 random(3);
  std::uniform_real_distribution<float> unit(-0.9f, 0.9f);
  std::vector<TraceRay> rays;
  for (int k = 0; k < 2000; ++k)
    rays.push_back({{unit(random), unit(random), 3}, {0.3f * unit(random), 0.3f * unit(random), -1}});
  const std::vector<TraceHit> expected = trace_rays(whole, rays);
  for (const SceneContext* context : {&in_tiles, &by_method}) {
    EXPECT_EQ(context->displacements.method_names(), "tiles");
    EXPECT_TRUE(context->displacements.warnings().empty());
    const std::vector<TraceHit> hits = trace_rays(*context, rays);
    for (std::size_t k = 0; k < rays.size(); ++k) {
      ASSERT_EQ(hits[k].hit, expected[k].hit) << k;
      if (!hits[k].hit) continue;
      ASSERT_LT(length(hits[k].P - expected[k].P), 1e-5f) << k;
      ASSERT_GT(dot(hits[k].Ng, expected[k].Ng), 1 - 1e-4f) << k;
      ASSERT_LE(hits[k].triangle_index, 1u) << k;
    }
    EXPECT_GT(context->displacements.tiles().made, 10u);
  }
  short_of_room.dicing_bytes = 20'000;
  const SceneContext part(scene, short_of_room);
  EXPECT_EQ(part.displacements.method_names(), "tiles");
  ASSERT_EQ(part.displacements.warnings().size(), 1u);
  EXPECT_NE(part.displacements.warnings()[0].find("times as long"), std::string::npos);
  short_of_room.dicing_bytes = 1;
  EXPECT_EQ(num_moved_triangles(SceneContext(scene, short_of_room)), 2u);
}

}  // namespace
}  // namespace relief::test
