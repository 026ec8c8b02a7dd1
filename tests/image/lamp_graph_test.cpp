// Lamps whose emission a value graph multiplies: found by sampling lights as by following the BSDF, and by photons.
#include <array>
#include <filesystem>
#include <fstream>
#include <initializer_list>

#include <nlohmann/json.hpp>

#include "scene/graph/graph_builder.h"
#include "scene/load.h"
#include "tests/image/render_runs.h"
#include "tests/support/caustic_scene.h"
#include "tests/support/gltf_builder.h"

namespace relief::test {

namespace {

using nlohmann::json;

json node(int index, const char* output) { return {{"node", index}, {"output", output}}; }

/// A profile that is the same nowhere.
constexpr const char* kProfile =
    "TILT=NONE\n1 1 40 4 5 1 2 0 0 0\n1 1 1\n0 40 90 180\n0 90 180 270 360\n"
    "9 5 1 0\n3 8 2 1\n6 2 4 2\n1 1 9 3\n9 5 1 0\n";

/// The Cornell box lit by one lamp of a node in place of its own.
/// @param lamp_node  transform and area light; `punctual` beside it: a punctual light that it has
Scene cornell_lit_by(json lamp_node, const json& punctual = {})
{
  const auto folder = std::filesystem::path(RELIEF_SOURCE_DIR) / "examples" / "cornell";
  std::ifstream file(folder / "cornell.gltf");
  json gltf = json::parse(file);
  gltf["buffers"][0]["uri"] = "cornell.bin";
  for (const char* name : {"RELIEF_area_light", "RELIEF_light", "KHR_lights_punctual"}) {
    gltf["extensionsUsed"].push_back(name);
  }
  gltf["materials"][3].erase("emissiveFactor");
  if (!punctual.is_null()) {
    gltf["extensions"]["KHR_lights_punctual"] = {{"lights", {punctual}}};
    lamp_node["extensions"]["KHR_lights_punctual"] = {{"light", 0}};
  }
  gltf["scenes"][0]["nodes"].push_back(gltf["nodes"].size());
  gltf["nodes"].push_back(lamp_node);
  const TemporaryFolder copy;
  std::filesystem::copy(folder / "cornell.bin", copy / "cornell.bin");
  copy.write("profile.ies", kProfile);
  return scene_load(copy.write("scene.gltf", gltf.dump()));
}

/// Fails unless MIS, sampling lights, and following the BSDF come to the same picture.
/// @param samples  a pixel and run: as many as paths take to meet the lamp from everywhere
void expect_agreement(const Scene& scene, int samples = 64)
{
  ASSERT_EQ(scene.lamps.size(), 1u);
  RunOptions run;
  run.width = run.height = 24;
  run.samples = samples;
  expect_techniques_agree(scene, run, "lamp");
}

/// Looks down from the middle of the ceiling.
json ceiling(const json& area_light)
{
  return {{"translation", {0.1, 1.9, 0.1}},
          {"rotation", {-0.70710678, 0, 0, 0.70710678}},
          {"extensions", {{"RELIEF_area_light", area_light}}}};
}

json checker(const json& vector, double scale)
{
  return {{"type", "checker-texture"},
          {"inputs", {{"vector", vector}, {"scale", scale}, {"color1", {3, 1, 0.2}}, {"color2", {0.1, 0.5, 2}}}}};
}

TEST(LampGraph, RectangleByItsUv)
{
  const json graph = {{"nodes", {{{"type", "texture-coordinate"}}, checker(node(0, "uv"), 3)}},
                      {"outputs", {{"emission", node(1, "color")}}}};
  expect_agreement(cornell_lit_by(ceiling({{"width", 0.9}, {"height", 0.6}, {"radiance", 8}, {"graph", graph}})));
}

/// Also by depths, which must be the same for light that is asked for and light that is met.
TEST(LampGraph, DiskByDirectionAndDepthWithASpread)
{
  const json graph = {{"nodes",
                       {{{"type", "geometry"}},
                        {{"type", "light-path"}},
                        checker(node(0, "incoming"), 2),
                        {{"type", "vector-math"},
                         {"operation", "scale"},
                         {"inputs", {{"a", node(2, "color")}, {"scale", node(1, "depth")}}}}}},
                      {"outputs", {{"emission", node(3, "vector")}}}};
  expect_agreement(cornell_lit_by(
      ceiling({{"shape", "disk"}, {"radius", 0.45}, {"radiance", 8}, {"spread", 2.2}, {"graph", graph}})));
}

TEST(LampGraph, BallByItsNormal)
{
  const json graph = {{"nodes", {{{"type", "geometry"}}, checker(node(0, "normal"), 3)}},
                      {"outputs", {{"emission", node(1, "color")}}}};
  const json ours = {{"radius", 0.25}, {"visibleToCamera", true}, {"graph", graph}};
  expect_agreement(cornell_lit_by({{"translation", {0.1, 1.4, 0.3}}},
                                  {{"type", "point"}, {"intensity", 3}, {"extensions", {{"RELIEF_light", ours}}}}));
}

TEST(LampGraph, LuminaireWhoseFaceTurns)
{
  const json graph = {{"nodes", {{{"type", "ies-texture"}, {"uri", "profile.ies"}, {"inputs", {{"strength", 0.1}}}}}},
                      {"outputs", {{"emission", node(0, "factor")}}}};
  const json ours = {{"radius", 0.3}, {"shape", "disk"}, {"graph", graph}};
  expect_agreement(cornell_lit_by({{"translation", {0.1, 1.4, 0.3}}, {"rotation", {0.3, 0.2, 0.1, 0.92736185}}},
                                  {{"type", "point"}, {"intensity", 2}, {"extensions", {{"RELIEF_light", ours}}}}));
}

TEST(LampGraph, SpotByNormalAndLength)
{
  const json graph = {{"nodes",
                       {{{"type", "texture-coordinate"}},
                        {{"type", "light-falloff"}, {"inputs", {{"strength", 1}, {"smooth", 0.4}}}},
                        checker(node(0, "normal"), 6),
                        {{"type", "vector-math"},
                         {"operation", "scale"},
                         {"inputs", {{"a", node(2, "color")}, {"scale", node(1, "linear")}}}}}},
                      {"outputs", {{"emission", node(3, "vector")}}}};
  const json ours = {{"radius", 0.35}, {"falloff", "smooth"}, {"graph", graph}};
  expect_agreement(cornell_lit_by({{"translation", {0, 1.6, 0.2}}, {"rotation", {-0.70710678, 0, 0, 0.70710678}}},
                                  {{"type", "spot"},
                                   {"intensity", 4},
                                   {"spot", {{"innerConeAngle", 0.5}, {"outerConeAngle", 1.2}}},
                                   {"extensions", {{"RELIEF_light", ours}}}}),
                   512);
}

/// A scene with a glass ball over a floor, lit by a lamp.
/// @param factor  that its graph gives everywhere; 0: it has none, and twice the emission
Scene glass_ball_lit_by(Light light, float factor)
{
  Scene scene = empty_scene();
  add_floor(scene, 1);
  Affine3 place;
  place.p = {0, 0.5f, 0};
  add_caster(scene, sphere_mesh(0.3f, 24, 12, true), glass_material(), place);
  look_down(scene, {}, 0.5f, 4);
  if (factor > 0) {
    GraphBuilder b;
    const GraphScalar zero = b(GraphOp::multiply, {b.quantity(GraphQuantity::position_x), b.constant(0)});
    for (int i = 0; i < 3; ++i) b.add_result(b(GraphOp::add, {zero, b.constant(factor)}));
    scene.graphs.push_back(b.compile());
    scene.lamps.push_back({0, {}});
    light.lamp_index = 0;
    light.is_even = false;
  } else {
    light.emission *= 2.0f;
  }
  scene.lights.push_back(light);
  return scene;
}

/// Choosing lamps, sampling them, and photons: all of it takes a graph that is the same everywhere for a factor.
TEST(LampGraph, EvenGraphsAreFactors)
{
  Light point = point_light({0.2f, 2, 0.1f}, 3);
  Light ball = point;
  ball.radius = 0.2f;
  Light spot = ball;
  spot.kind = LightKind::kSpot;
  spot.axis = {0, -1, 0};
  spot.cos_inner = 0.95f;
  spot.cos_outer = 0.85f;
  Light sun = point;
  sun.kind = LightKind::kSun;
  sun.axis = normalize(Vec3f{0.1f, -1, 0.2f});
  const Light square = square_light({0.2f, 2, 0.1f}, {0, -1, 0}, 0.2f, 9);
  Light narrow = square;
  narrow.kind = LightKind::kDisk;
  narrow.spread_tan = 1.0f;
  narrow.spread_scale = 1.0f / (1.0f - kPi / 4);
  narrow.area = kPi * 0.04f;
  for (const Light& light : {point, ball, spot, sun, square, narrow}) {
    const auto picture = [&](float factor) {
      const Scene scene = glass_ball_lit_by(light, factor);
      RenderOptions options = caustic_options(scene, CausticsMode::kOn, 16, 16);
      options.settings.caustics.photons = 1 << 13;
      return render_scene(scene, options);
    };
    const Rendered plain = picture(0), by_graph = picture(2);
    EXPECT_GT(mean_of(plain, Aov::kCaustic), 0) << static_cast<int>(light.kind);
    for (int y = 0; y < 16; ++y) {
      for (int x = 0; x < 16; ++x) {
        const float expected = plain.radiance(x, y).x;
        EXPECT_NEAR(by_graph.radiance(x, y).x, expected, 2e-4f * (expected + 0.1f))
            << static_cast<int>(light.kind) << " at " << x << ", " << y;
      }
    }
  }
}

/// Lamps compete by what they give on the mean: one whose graph makes it bright has the noise of one that is bright.
TEST(LampGraph, LampsAreChosenByTheirMeans)
{
  const auto variance_of = [](float intensity, float factor) {
    Scene scene = glass_ball_lit_by(point_light({0.6f, 1, 0}, intensity), factor);
    for (int i = 0; i < 20; ++i) {
      scene.lights.push_back(point_light({-0.9f + 0.09f * static_cast<float>(i), 1.0f, 0.9f}, 1));
    }
    return mean_of(render_scene(scene, caustic_options(scene, CausticsMode::kOff, 16, 16)), Aov::kVariance);
  };
  const double bright = variance_of(500, 0);
  EXPECT_NEAR(variance_of(1, 1000), bright, 0.01 * bright);
}

}  // namespace

}  // namespace relief::test
