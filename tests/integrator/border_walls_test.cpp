// Walls between parts of an object whose materials displace them differently: closed for rays and for paths, however the parts are
// traced, and nowhere else.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "integrator/scene_context.h"
#include "integrator/trace.h"
#include "kernel/sample/warp.h"
#include "tests/support/image_bytes.h"
#include "tests/support/loaded_scene.h"

namespace relief::test {
namespace {

using nlohmann::json;

Vec3f cube_corner(int i) { return {i & 1 ? 1.0f : -1.0f, i & 2 ? 1.0f : -1.0f, i & 4 ? 1.0f : -1.0f}; }

/// Grey noise.
std::string noise_tga(int size, unsigned seed)
{
  std::mt19937 random(seed);
  std::string texels;
  for (int i = 0; i < size * size; ++i) texels.push_back(static_cast<char>(random()));
  return tga_grey(size, size, texels);
}

/// Waves along all axes that do not fit a cube.
json waves()
{
  const auto of = [](int node, const char* output) { return json{{"node", node}, {"output", output}}; };
  const auto math = [](const char* operation, const json& a, const json& b) {
    return json{{"type", "math"}, {"operation", operation}, {"inputs", {{"a", a}, {"b", b}}}};
  };
  return {{"nodes",
           {{{"type", "texture-coordinate"}},
            {{"type", "separate"}, {"inputs", {{"vector", of(0, "object")}}}},
            math("multiply", of(1, "x"), 7),
            math("multiply", of(1, "y"), 11),
            math("add", of(2, "value"), of(3, "value")),
            math("multiply", of(1, "z"), 5),
            math("add", of(4, "value"), of(5, "value")),
            {{"type", "math"}, {"operation", "sine"}, {"inputs", {{"a", of(6, "value")}}}}}},
          {"outputs", {{"height", of(7, "value")}}}};
}

struct CubeOptions {
  bool weld = true;
  Vec3f away{};        ///< where it stands
  bool split = false;  ///< each side has normals of its own
};

/// A cube of 2 m, a material a side: three maps of different sizes, scales and wraps, two graphs, and one that is not displaced.
Scene cube_of_materials(const CubeOptions& options)
{
  const TemporaryFolder folder;
  GltfBuilder b;
  const int sides[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  const char* const seams = options.weld ? "weld" : "keep";
  for (int side = 0; side < 6; ++side) {
    std::vector<float> P, N, uv;
    Vec3f middle;
    for (const int i : sides[side]) middle += 0.25f * cube_corner(i);
    for (const int i : sides[side]) {
      const Vec3f p = cube_corner(i), n = options.split ? middle : normalize(p);
      P.insert(P.end(), {p.x, p.y, p.z});
      N.insert(N.end(), {n.x, n.y, n.z});
    }
    const float u = 0.3f * static_cast<float>(side), width = side == 2 ? 3.1f : 0.7f;
    uv = {u, 0.1f, u + width, 0.2f, u + width - 0.1f, 0.9f, u + 0.05f, 0.8f};
    const json primitive{{"attributes",
                          {{"POSITION", b.accessor(P, "VEC3")},
                           {"NORMAL", b.accessor(N, "VEC3")},
                           {"TEXCOORD_0", b.accessor(uv, "VEC2")}}},
                         {"indices", b.accessor<std::uint16_t>({0, 1, 2, 0, 2, 3}, "SCALAR")},
                         {"material", side}};
    if (side == 0) {
      b.mesh(primitive);
    } else {
      b.json["meshes"][0]["primitives"].push_back(primitive);
    }
    json displacement{{"seams", seams}};
    if (side < 3) {
      const std::string name = "noise" + std::to_string(side) + ".tga";
      folder.write(name, noise_tga(16 << side, static_cast<unsigned>(side)));
      displacement.update({{"heightTexture", {{"uri", name}}}, {"scale", 0.1 + 0.15 * side}, {"midlevel", 0.2 * side}});
    } else if (side < 5) {
      displacement.update(
          {{"heightGraph", waves()}, {"scale", side == 3 ? 0.1 : 0.05}, {"midlevel", side == 3 ? 0.4 : 0}});
    }
    b.push("materials", side < 5 ? json{{"extensions", {{"RELIEF_displacement", displacement}}}} : json::object());
  }
  b.root_node({{"mesh", 0}, {"translation", {options.away.x, options.away.y, options.away.z}}});
  b.json["extensionsUsed"].push_back("RELIEF_displacement");
  b.push("cameras", {{"type", "perspective"}, {"perspective", {{"yfov", 0.7}, {"znear", 0.1}}}});
  b.root_node({{"camera", 0}, {"translation", {options.away.x, options.away.y, options.away.z + 5}}});
  return scene_load(folder.write("scene.gltf", b.gltf()), {});
}

/// How the cube is traced.
struct Way {
  const char* name;
  std::optional<DisplacementMethod> method;
  double error;  ///< pixels; 0: it is not diced
  float lod;
};
constexpr Way kWays[] = {
    {"chord", DisplacementMethod::chord, 0, 0},
    {"rmip", DisplacementMethod::rmip, 0, 0},
    {"tfdm", DisplacementMethod::tfdm, 0, 0},
    {"tessellate", DisplacementMethod::tessellate, 0, 0},
    {"tessellate-grid", DisplacementMethod::tessellate_grid, 0, 0},
    {"levels by cones", std::nullopt, 0, -1},
    {"a level between", std::nullopt, 0, 0.5f},
    {"diced", std::nullopt, 1, 0},
};

DisplacementOptions options_of(const Scene& scene, const Way& way)
{
  DisplacementOptions options;
  options.method = way.method;
  options.error = way.error;
  if (way.lod != 0) options.lod = way.lod;
  options.camera = scene.cameras[0].camera;
  options.picture_height = 200;
  options.num_rays = 1e9;
  return options;
}

/// A ray from about the middle to a place near an edge of the cube, from below its lowest side to above its highest.
/// @param reach  from the middle of the edge, of half its length
TraceRay ray_to_an_edge(const Vec3f& middle, std::mt19937& random, float reach = 1)
{
  std::uniform_real_distribution<float> uniform(-1, 1);
  Vec3f edge{reach * uniform(random), random() % 2 ? 1.0f : -1.0f, random() % 2 ? 1.0f : -1.0f};
  for (auto turns = random() % 3; turns > 0; --turns) edge = {edge.y, edge.z, edge.x};
  const Vec3f beside{uniform(random), uniform(random), uniform(random)};
  const Vec3f target = edge + 0.4f * uniform(random) * normalize(edge) + 0.01f * beside;
  const Vec3f O = 0.3f * Vec3f{uniform(random), uniform(random), uniform(random)};
  return {middle + O, target - O, 0, kInfinity};
}

int num_rays_out(const SceneContext& context, const Vec3f& middle, float reach, int count)
{
  std::mt19937 random(5);
  std::vector<TraceRay> rays;
  for (int i = 0; i < count; ++i) rays.push_back(ray_to_an_edge(middle, random, reach));
  int num_out = 0;
  for (const TraceHit& hit : trace_rays(context, rays)) num_out += hit.hit ? 0 : 1;
  return num_out;
}

TEST(BorderWalls, LetNoRayOut)
{
  constexpr int kRays = 1 << 16;
  for (const bool split : {false, true}) {
    // With normals of its own each side has corners of its own as well, between which nothing is.
    const float reach = split ? 0.7f : 1;
    for (const Vec3f away : {Vec3f{0, 0, 0}, Vec3f{100, -70, 30}}) {
      const Scene open = cube_of_materials({false, away, split}), welded = cube_of_materials({true, away, split});
      EXPECT_EQ(open.border_instances.size(), 0u);
      EXPECT_EQ(welded.border_instances.size(), 12u);
      for (const Way& way : kWays) {
        const SceneContext context(welded, options_of(welded, way));
        EXPECT_EQ(num_rays_out(context, away, reach, kRays), 0)
            << way.name << ", " << away.x << " m away, split " << split;
      }
      EXPECT_GT(num_rays_out(SceneContext(open, options_of(open, kWays[0])), away, reach, kRays), kRays / 100);
    }
  }
}

TEST(BorderWalls, LetNoPathOut)
{
  constexpr int kNumPaths = 16384, kBounces = 32;
  // Where two borders cross, a wall narrows to nothing: hits there that rounding puts beyond it let paths out. Of these, which all start
  // at edges, 0 to 4 get out.
  constexpr int kMostOut = 8;
  {
    const Vec3f away{};
    const Scene scene = cube_of_materials({true, away});
    for (const Way& way : {kWays[0], kWays[3], kWays[7]}) {
      const SceneContext context(scene, options_of(scene, way));
      std::mt19937 random(7);
      std::uniform_real_distribution<float> uniform(0, 1);
      std::vector<TraceRay> rays;
      for (int i = 0; i < kNumPaths; ++i) rays.push_back(ray_to_an_edge(away, random));
      int num_out = 0;
      for (int bounce = 0; bounce < kBounces; ++bounce) {
        const std::vector<TraceHit> hits = trace_rays(context, rays);
        for (std::size_t i = 0; i < hits.size(); ++i) {
          const TraceHit& hit = hits[i];
          if (!hit.hit) ++num_out;
          if (!hit.hit || bounce % 8 == 7) {
            rays[i] = ray_to_an_edge(away, random);
            continue;
          }
          const bool front = dot(hit.Ng, rays[i].D) < 0.0f;
          const Vec3f D = warp_cosine_hemisphere({uniform(random), uniform(random)});
          rays[i] = {front ? hit.O_front : hit.O_back, from_local(frame_from_normal(front ? hit.Ng : -hit.Ng), D),
                     kLeastDistance, kInfinity};
        }
      }
      EXPECT_LE(num_out, kMostOut) << way.name << ", of " << kNumPaths * kBounces;
    }
  }
}

/// The wall's normal is to the lower side, as what stands on the higher one goes on.
TEST(BorderWalls, FaceTheSideThatIsLower)
{
  const Scene scene = cube_of_materials({});
  const SceneContext context(scene, options_of(scene, kWays[0]));
  std::mt19937 random(11);
  std::vector<TraceRay> rays;
  for (int i = 0; i < 20000; ++i) rays.push_back(ray_to_an_edge({}, random));
  int num_walls = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const TraceHit hit = trace_rays(context, std::span(rays).subspan(i, 1))[0];
    if (hit.instance_index < static_cast<int>(scene.num_placed())) continue;
    ++num_walls;
    // From the inside of the cube all of its surface is seen from behind.
    EXPECT_GT(dot(hit.Ng, rays[i].D), 0.0f);
  }
  EXPECT_GT(num_walls, 200);
}

}  // namespace
}  // namespace relief::test
