// Heights of value graphs over any coordinates, from the file to the hit.
#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <random>
#include <vector>

#include "displacement/lattice_split.h"
#include "displacement/vec3d.h"
#include "integrator/computed_heights.h"
#include "integrator/scene_context.h"
#include "integrator/trace.h"
#include "scene/memory.h"
#include "tests/support/image_bytes.h"
#include "tests/support/loaded_scene.h"
#include "tests/support/test_rays.h"

namespace relief::test {
namespace {

using nlohmann::json;

json reference(int node, const char* output) { return {{"node", node}, {"output", output}}; }

/// Noise over some coordinates.
json noise(const json& coordinates, double scale, double detail)
{
  return {{"nodes",
           {{{"type", "texture-coordinate"}},
            {{"type", "noise-texture"}, {"inputs", {{"vector", coordinates}, {"scale", scale}, {"detail", detail}}}}}},
          {"outputs", {{"height", reference(1, "factor")}}}};
}

/// A ball of triangles, each with vertices of its own, in Generated coordinates from 0 to 1.
GltfBuilder ball(const json& displacement, int num_instances = 1)
{
  std::vector<float> P, generated;
  constexpr int kAround = 14, kUp = 7;
  const auto at = [](int i, int j) -> Vec3f {
    if (j == 0 || j == kUp) return {0, j == 0 ? 1.0f : -1.0f, 0};
    const double theta = M_PI * j / kUp, phi = 2 * M_PI * (i % kAround) / kAround;
    return to_float(Vec3d{std::sin(theta) * std::cos(phi), std::cos(theta), -std::sin(theta) * std::sin(phi)});
  };
  const auto add = [&](Vec3f a, Vec3f b, Vec3f c) {
    if (a == b || b == c || c == a) return;
    for (const Vec3f& v : {a, b, c}) {
      P.insert(P.end(), {v.x, v.y, v.z});
      generated.insert(generated.end(), {0.5f + 0.5f * v.x, 0.5f + 0.5f * v.y, 0.5f + 0.5f * v.z});
    }
  };
  for (int j = 0; j < kUp; ++j) {
    for (int i = 0; i < kAround; ++i) {
      add(at(i, j), at(i, j + 1), at(i + 1, j + 1));
      add(at(i, j), at(i + 1, j + 1), at(i + 1, j));
    }
  }
  GltfBuilder b;
  const int position = b.accessor(P, "VEC3"), normal = b.accessor(P, "VEC3"), where = b.accessor(generated, "VEC3");
  b.push("materials", {{"name", "ball"}, {"extensions", {{"RELIEF_displacement", displacement}}}});
  const int mesh =
      b.mesh({{"attributes", {{"POSITION", position}, {"NORMAL", normal}, {"_GENERATED", where}}}, {"material", 0}});
  for (int k = 0; k < num_instances; ++k) b.root_node({{"mesh", mesh}, {"translation", {3.0 * k, 0, 0}}});
  b.push("cameras", {{"type", "perspective"}, {"perspective", {{"yfov", 0.7}, {"znear", 0.1}}}});
  b.root_node({{"camera", 0}, {"translation", {0, 0, 5}}});
  return b;
}

Vec3f random_direction(std::mt19937_64& random)
{
  std::uniform_real_distribution<double> unit(-1, 1);
  const double z = unit(random), phi = M_PI * unit(random), r = std::sqrt(1 - z * z);
  return to_float(Vec3d{r * std::cos(phi), r * std::sin(phi), z});
}

TEST(ComputedHeights, OfAnyCoordinatesLetNoRayOut)
{
  const json over_noise = {
      {"nodes",
       {{{"type", "texture-coordinate"}},
        {{"type", "noise-texture"}, {"inputs", {{"vector", reference(0, "object")}, {"scale", 2}, {"detail", 1}}}},
        {{"type", "noise-texture"}, {"inputs", {{"vector", reference(1, "color")}, {"scale", 5}, {"detail", 3}}}}}},
      {"outputs", {{"height", reference(2, "factor")}}}};
  const json position = {
      {"nodes",
       {{{"type", "geometry"}},
        {{"type", "noise-texture"}, {"inputs", {{"vector", reference(0, "position")}, {"scale", 4}, {"detail", 4}}}}}},
      {"outputs", {{"height", reference(1, "factor")}}}};
  for (const json& graph :
       {noise(reference(0, "generated"), 6, 8), noise(reference(0, "object"), 3, 12), over_noise, position}) {
    for (const bool curved : {false, true}) {
      const Scene scene = load(ball({{"heightGraph", graph}, {"scale", 0.5}, {"curved", curved}, {"method", "chord"}}));
      const SceneContext context(scene);
      ASSERT_EQ(context.displacements.size(), 1u);
      EXPECT_TRUE(context.displacements.warnings().empty()) << context.displacements.warnings().front();
      std::mt19937_64 random(11);
      std::vector<TraceRay> rays;
      for (std::uint64_t k = 0; k < num_test_rays(40000) / 8; ++k) {
        const Vec3f O = random_direction(random) * 0.3f;
        Vec3f D = random_direction(random);
        // Through vertices and sides of the mesh too.
        const MeshView mesh = scene.meshes[0].view();
        const TriangleIndices t = mesh.triangles[random() % mesh.num_triangles];
        const float along = static_cast<float>(random() % 65) / 64;
        if (k % 2 == 0) D = mesh.P[t.v0] * (1 - along) + mesh.P[t.v1] * along - (k % 4 == 0 ? O : Vec3f{});
        rays.push_back({k % 4 == 2 ? Vec3f{} : O, D});
      }
      int num_leaks = 0;
      for (const TraceHit& hit : trace_rays(context, rays)) num_leaks += hit.hit ? 0 : 1;
      EXPECT_EQ(num_leaks, 0) << graph;
    }
  }
}

/// A telescope sees a thousandth of a ball. As fine all over, it would be millions of parts.
TEST(ComputedHeights, AreFewWhereATelescopeDoesNotLook)
{
  const Scene scene =
      load(ball({{"heightGraph", noise(reference(0, "object"), 3, 2)}, {"scale", 0.1}, {"method", "chord"}}));
  DisplacementOptions options;
  options.camera = scene.cameras[0].camera;
  options.camera->half_width *= 1e-3f;
  options.camera->half_height *= 1e-3f;
  options.picture_height = 270;
  const SceneContext narrow(scene, options);
  EXPECT_LT(narrow.displacements.num_triangles(), 200'000u);
  std::cout << "[ figures  ] " << narrow.displacements.num_triangles() << " parts\n";
  // Where there is no room for them either.
  options.picture_height = 27000;
  memory_limit_set(memory_limit().bytes - memory_left() + (std::uint64_t{64} << 20));
  EXPECT_THROW(SceneContext(scene, options), OutOfMemory);
  memory_limit_reset();
}

/// Steps of a graph by hand: hits lie where its height says.
TEST(ComputedHeights, PutPointsWhereTheGraphSays)
{
  const json graph = {
      {"nodes",
       {{{"type", "texture-coordinate"}},
        {{"type", "separate"}, {"inputs", {{"vector", reference(0, "generated")}}}},
        {{"type", "math"}, {"operation", "multiply"}, {"inputs", {{"a", reference(1, "x")}, {"b", 2}}}}}},
      {"outputs", {{"height", reference(2, "value")}}}};
  const Scene scene = load(ball({{"heightGraph", graph}, {"scale", 0.25}, {"midlevel", 0.5}, {"cells", 16}}, 2));
  const SceneContext context(scene);
  // One surface for both instances.
  EXPECT_EQ(context.displacements.size(), 1u);
  std::mt19937_64 random(12);
  int num_hits = 0;
  for (int k = 0; k < 2000; ++k) {
    const Vec3f D = random_direction(random), middle{k % 2 == 0 ? 0.0f : 3.0f, 0, 0};
    const std::vector<TraceHit> hits = trace_rays(context, std::vector<TraceRay>{{middle, D}});
    ASSERT_TRUE(hits[0].hit);
    const TraceHit& hit = hits[0];
    const Mesh& mesh = scene.meshes[0];
    const TriangleIndices t = mesh.triangles[hit.triangle_index];
    const Vec3f base = mesh.P[t.v0] * (1 - hit.u - hit.v) + mesh.P[t.v1] * hit.u + mesh.P[t.v2] * hit.v;
    // Heights are linear in the weights here, as the lattice's are; normals are the positions.
    const float d = 0.25f * (2 * (0.5f + 0.5f * base.x) - 0.5f);
    EXPECT_LT(length(base + normalize(base) * d + middle - hit.P), 2e-5f);
    ++num_hits;
  }
  EXPECT_EQ(num_hits, 2000);
}

/// Heights that are linear over each triangle of a ball: its lattice has no error, and normals are those of the derivatives
/// of P + d(P)·P/|P|, by hand.
TEST(ComputedHeights, HaveTheNormalsOfLinearOnes)
{
  const json graph = {
      {"nodes",
       {{{"type", "texture-coordinate"}}, {{"type", "separate"}, {"inputs", {{"vector", reference(0, "generated")}}}}}},
      {"outputs", {{"height", reference(1, "x")}}}};
  constexpr double kScale = 0.5, kMidlevel = 0.3;
  const Scene scene = load(ball({{"heightGraph", graph}, {"scale", kScale}, {"midlevel", kMidlevel}, {"cells", 16}}));
  const SceneContext context(scene);
  std::mt19937_64 random(14);
  for (int k = 0; k < 2000; ++k) {
    const TraceHit hit = trace_rays(context, std::vector<TraceRay>{{{}, random_direction(random)}})[0];
    ASSERT_TRUE(hit.hit);
    const Mesh& mesh = scene.meshes[0];
    const TriangleIndices t = mesh.triangles[hit.triangle_index];
    const Vec3d P0 = to_double(mesh.P[t.v0]), u = to_double(mesh.P[t.v1]) - P0, v = to_double(mesh.P[t.v2]) - P0;
    const Vec3d P = P0 + static_cast<double>(hit.u) * u + static_cast<double>(hit.v) * v, n = P * (1 / length(P));
    const double d = kScale * (0.5 + 0.5 * P.x - kMidlevel);
    const auto along = [&](Vec3d w) { return w + n * (kScale * 0.5 * w.x) + (w - n * dot(n, w)) * (d / length(P)); };
    const Vec3d expected = cross(along(u), along(v)), Ng = to_double(hit.Ng);
    // Heights are floats, of a few roundings of 6e-8, and the least cells are 0.012 wide.
    EXPECT_LT(length(cross(expected, Ng)) / length(expected), 5e-5);
    EXPECT_GT(dot(expected, Ng), 0);
  }
}

/// Of waves of one direction the slope is known; that of a cell is off by half its width times the curvature at most.
TEST(ComputedHeights, HaveTheGradientsOfTheGraphAsCellsShrink)
{
  constexpr double kWaves = 6, kScale = 0.25;
  const json graph = {
      {"nodes",
       {{{"type", "texture-coordinate"}},
        {{"type", "separate"}, {"inputs", {{"vector", reference(0, "object")}}}},
        {{"type", "math"}, {"operation", "multiply"}, {"inputs", {{"a", reference(1, "x")}, {"b", kWaves}}}},
        {{"type", "math"}, {"operation", "sine"}, {"inputs", {{"a", reference(2, "value")}}}}}},
      {"outputs", {{"height", reference(3, "value")}}}};
  for (const int cells : {16, 64, 256}) {
    GltfBuilder b;
    const int P = b.accessor<float>({-1, -1, 0, 1, -1, 0, -1, 1, 0}, "VEC3");
    b.push(
        "materials",
        {{"extensions",
          {{"RELIEF_displacement", {{"heightGraph", graph}, {"scale", kScale}, {"midlevel", 0}, {"cells", cells}}}}}});
    b.root_node({{"mesh", b.mesh({{"attributes", {{"POSITION", P}}}, {"material", 0}})}});
    b.push("cameras", {{"type", "perspective"}, {"perspective", {{"yfov", 0.7}, {"znear", 0.1}}}});
    b.root_node({{"camera", 0}, {"translation", {0, 0, 5}}});
    const Scene scene = load(b);
    const SceneContext context(scene);
    std::mt19937_64 random(15);
    std::uniform_real_distribution<float> unit(0, 1);
    double most = 0;
    const double bound = 0.5 * (2.0 / cells) * kScale * kWaves * kWaves;
    for (int k = 0; k < 4000; ++k) {
      const float x = unit(random), y = (1 - x) * unit(random);
      const TraceHit hit = trace_rays(context, std::vector<TraceRay>{{{2 * x - 1, 2 * y - 1, 3}, {0, 0, -1}}})[0];
      ASSERT_TRUE(hit.hit);
      const double slope = -static_cast<double>(hit.Ng.x / hit.Ng.z);
      const double error = slope - kScale * kWaves * std::cos(kWaves * static_cast<double>(hit.P.x));
      EXPECT_LE(std::abs(error), bound * 1.01 + 1e-4);
      EXPECT_NEAR(hit.Ng.y, 0, 1e-3);
      most = std::max(most, std::abs(error));
    }
    // The bound is no wider than it has to be.
    EXPECT_GT(most, bound / 2) << cells;
  }
}

/// A square of 2 × 2 m around the origin whose height is an image of 16 bits, read by a graph.
Scene square_of_image(int width, int height, const std::vector<std::uint16_t>& texels, double scale)
{
  const json graph = {
      {"nodes",
       {{{"type", "texture-coordinate"}},
        {{"type", "image-texture"},
         {"texture", {{"index", 0}}},
         {"colorSpace", "linear"},
         {"inputs", {{"vector", reference(0, "uv")}}}},
        {{"type", "math"}, {"operation", "add"}, {"inputs", {{"a", reference(1, "color")}, {"b", 0}}}}}},
      {"outputs", {{"height", reference(2, "value")}}}};
  GltfBuilder b;
  const int P = b.accessor<float>({-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, -1, 0, 1, 1, 0, -1, 1, 0}, "VEC3");
  const int uv = b.accessor<float>({0, 1, 1, 1, 1, 0, 0, 1, 1, 0, 0, 0}, "VEC2");
  b.push("images", {{"uri", "height.tif"}});
  b.push("textures", {{"source", 0}});
  b.push("materials",
         {{"extensions",
           {{"RELIEF_displacement", {{"heightGraph", graph}, {"scale", scale}, {"midlevel", 0}, {"cells", 512}}}}}});
  b.root_node({{"mesh", b.mesh({{"attributes", {{"POSITION", P}, {"TEXCOORD_0", uv}}}, {"material", 0}})}});
  b.push("cameras", {{"type", "perspective"}, {"perspective", {{"yfov", 0.7}, {"znear", 0.1}}}});
  b.root_node({{"camera", 0}, {"translation", {0, 0, 5}}});
  const TemporaryFolder folder;
  folder.write("height.tif", tiff_grey_16(width, height, texels));
  return scene_load(folder.write("scene.gltf", b.gltf()), {});
}

/// Height of the surface over a place.
float height_at(const SceneContext& context, float x, float y)
{
  const TraceHit hit = trace_rays(context, std::vector<TraceRay>{{{x, y, 3}, {0, 0, -1}}})[0];
  return hit.hit ? hit.P.z : kInfinity;
}

/// What a coarse look at the heights would miss: the bounds of an image's texels do not.
TEST(ComputedHeights, OfAnImageHaveItsSmallestBump)
{
  constexpr int kSize = 512, kFirst = 333, kBump = 16;
  std::vector<std::uint16_t> texels(std::size_t{kSize} * kSize, 0);
  for (int y = kFirst; y < kFirst + kBump; ++y) {
    for (int x = kFirst; x < kFirst + kBump; ++x)
      texels[static_cast<std::size_t>(y) * kSize + static_cast<std::size_t>(x)] = 65535;
  }
  const Scene scene = square_of_image(kSize, kSize, texels, 0.2);
  const SceneContext context(scene);
  const auto place = [](int texel) { return 2 * (static_cast<float>(texel) + 0.5f) / kSize - 1; };
  for (int texel = kFirst + 1; texel < kFirst + kBump - 1; ++texel) {
    EXPECT_NEAR(height_at(context, place(texel), -place(texel)), 0.2f, 1e-5f) << texel;
  }
  EXPECT_NEAR(height_at(context, 0, 0), 0.0f, 1e-6f);
}

/// A ramp of all 16 bits: halves have steps of 32 of these near 1.
TEST(ComputedHeights, OfAnImageKeepItsBits)
{
  constexpr int kWidth = 2048;
  std::vector<std::uint16_t> texels;
  for (int row = 0; row < 2; ++row) {
    for (int x = 0; x < kWidth; ++x) texels.push_back(static_cast<std::uint16_t>(60000 + x));
  }
  const Scene scene = square_of_image(kWidth, 2, texels, 1);
  const SceneContext context(scene);
  for (int x = 8; x < kWidth - 8; x += 37) {
    const float at = 2 * (static_cast<float>(x) + 0.5f) / kWidth - 1;
    EXPECT_NEAR(height_at(context, at, 0.3f), static_cast<float>(60000 + x) / 65535.0f, 2e-6f) << x;
  }
}

TEST(ComputedHeights, OfTheWorldDifferBetweenInstances)
{
  const json graph = {
      {"nodes",
       {{{"type", "geometry"}}, {{"type", "noise-texture"}, {"inputs", {{"vector", reference(0, "position")}}}}}},
      {"outputs", {{"height", reference(1, "factor")}}}};
  for (const char* method : {"auto", "chord"}) {
    const Scene scene = load(ball({{"heightGraph", graph}, {"scale", 0.5}, {"method", method}}, 2));
    const SceneContext context(scene);
    EXPECT_EQ(context.displacements.size() + context.displacements.moved().size(), 2u) << method;
  }
}

/// Of a plane of which an orthographic picture shows a millionth part, the rest is coarse.
TEST(ComputedHeights, AreFineWhereThePictureIs)
{
  GltfBuilder b;
  const int P = b.accessor<float>({-1e3f, -1e3f, 0, 1e3f, -1e3f, 0, -1e3f, 1e3f, 0}, "VEC3");
  b.push("materials",
         {{"extensions",
           {{"RELIEF_displacement",
             {{"heightGraph", noise(reference(0, "object"), 1, 2)}, {"scale", 0.1}, {"cellPixels", 0.5}}}}}});
  const int mesh = b.mesh({{"attributes", {{"POSITION", P}}}, {"material", 0}});
  b.root_node({{"mesh", mesh}});
  b.push("cameras",
         {{"type", "orthographic"}, {"orthographic", {{"xmag", 1}, {"ymag", 1}, {"znear", 0.1}, {"zfar", 100}}}});
  b.root_node({{"camera", 0}, {"translation", {-500, -500, 5}}});
  const Scene scene = load(b);
  DisplacementInput input;
  input.instances.push_back({0, 0, -1, scene.instances[0].world_from_object});
  computed_heights_add(scene, {}, &input);
  ASSERT_EQ(input.heights.size(), 1u);
  const std::vector<LatticeTriangle> parts = lattices_make(scene.meshes[0].view(), input.heights[0].cells);
  EXPECT_LT(parts.size(), 10'000u);
  // Cells in the middle of the picture are half a pixel long or less.
  const double pixel = 2.0 / scene.render.height;
  bool is_found = false;
  for (const LatticeTriangle& part : parts) {
    double least = 1, longest = 0;
    const Vec2f middle{0.25f, 0.25f};
    for (int k = 0; k < 3; ++k) {
      const Vec2f a = part.corner[k], c = part.corner[(k + 1) % 3];
      const Vec2f along = c - a, to = middle - a;
      least = std::min(least, static_cast<double>(along.x * to.y - along.y * to.x));
      longest = std::max(longest, 2e3 * static_cast<double>(std::hypot(along.x, along.y)) / part.side_n[k]);
    }
    if (least < 0) continue;
    is_found = true;
    EXPECT_LE(longest, 0.5 * pixel * 1.001);
  }
  EXPECT_TRUE(is_found);
}

/// The source's own bounds, of patches of all sizes, against what it gives there.
TEST(ComputedHeights, AreWithinTheirBounds)
{
  const json by_normal = {
      {"nodes",
       {{{"type", "geometry"}},
        {{"type", "noise-texture"}, {"inputs", {{"vector", reference(0, "normal")}, {"scale", 3}, {"detail", 3}}}}}},
      {"outputs", {{"height", reference(1, "factor")}}}};
  const json musgrave = {{"nodes",
                          {{{"type", "texture-coordinate"}},
                           {{"type", "musgrave-texture"},
                            {"musgraveType", "ridged-multifractal"},
                            {"inputs", {{"vector", reference(0, "object")}, {"scale", 2}, {"detail", 6}}}}}},
                         {"outputs", {{"height", reference(1, "factor")}}}};
  const json voronoi = {
      {"nodes",
       {{{"type", "texture-coordinate"}},
        {{"type", "voronoi-texture"}, {"inputs", {{"vector", reference(0, "generated")}, {"scale", 4}}}}}},
      {"outputs", {{"height", reference(1, "distance")}}}};
  for (const json& graph : {noise(reference(0, "generated"), 6, 8), by_normal, musgrave, voronoi}) {
    const Scene scene = load(ball({{"heightGraph", graph}}));
    DisplacementInput input;
    input.instances.push_back({0, 0, -1, scene.instances[0].world_from_object});
    computed_heights_add(scene, {}, &input);
    ASSERT_EQ(input.heights.size(), 1u);
    const HeightSource source = input.heights[0].source;
    std::mt19937_64 random(13);
    std::uniform_real_distribution<float> unit(0, 1), symbol(-1, 1);
    double widths[3] = {}, seen[3] = {};
    for (int round = 0; round < 1500; ++round) {
      const auto triangle = static_cast<std::uint32_t>(random() % scene.meshes[0].triangles.size());
      const int size_class = round % 3;
      const float size = std::exp2(-3.0f * static_cast<float>(size_class) - 1);
      WeightPatches patches;
      for (int lane = 0; lane < 8; ++lane) {
        for (int axis = 0; axis < 2; ++axis) {
          patches.center[axis][lane] = unit(random) * 0.5f;
          patches.du[axis][lane] = axis == 0 ? size * 0.5f : 0.0f;
          patches.dv[axis][lane] = axis == 1 ? size * 0.5f : 0.0f;
        }
      }
      float low[8], high[8], least[8], most[8];
      source.bounds(source.owner, triangle, patches, low, high);
      std::fill_n(least, 8, kInfinity);
      std::fill_n(most, 8, -kInfinity);
      for (int sample = 0; sample < 32; ++sample) {
        float b[3][8], h[8];
        for (int lane = 0; lane < 8; ++lane) {
          const float e1 = symbol(random), e2 = symbol(random);
          for (int axis = 0; axis < 2; ++axis) {
            b[axis + 1][lane] = patches.center[axis][lane] + e1 * patches.du[axis][lane] + e2 * patches.dv[axis][lane];
          }
          b[0][lane] = 1 - b[1][lane] - b[2][lane];
        }
        source.eval(source.owner, triangle, b, h);
        for (int lane = 0; lane < 8; ++lane) {
          ASSERT_TRUE(h[lane] >= low[lane] && h[lane] <= high[lane])
              << graph << " " << h[lane] << " in " << low[lane] << " " << high[lane];
          least[lane] = std::min(least[lane], h[lane]);
          most[lane] = std::max(most[lane], h[lane]);
        }
      }
      for (int lane = 0; lane < 8; ++lane) {
        widths[size_class] += static_cast<double>(high[lane]) - low[lane];
        seen[size_class] += static_cast<double>(most[lane]) - least[lane];
      }
    }
    std::cout << "[ figures  ] " << graph["nodes"][1]["type"] << ": bounds are as wide as what 32 samples show, times";
    for (int k = 0; k < 3; ++k) std::cout << " " << widths[k] / seen[k];
    std::cout << "\n";
  }
}

}  // namespace
}  // namespace relief::test
