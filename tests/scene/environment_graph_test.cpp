// Surroundings by a value graph: what a direction is for it, how fine the map gets, and what is wrong with one.
#include "scene/environment_graph.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "kernel/texture/texture.h"
#include "scene/graph/hosek_wilkie.h"
#include "scene/texture_store.h"
#include "tests/support/graph_scene.h"

namespace relief {
namespace {

using nlohmann::json;
using test::GltfBuilder;

json environment(const json& nodes, const json& color)
{
  return {{"graph", {{"nodes", nodes}, {"outputs", {{"color", color}}}}}};
}

Scene load(const json& environment)
{
  GltfBuilder b = test::graph_scene({{"nodes", json::array()}, {"outputs", json::object()}});
  b.json["extensions"]["RELIEF_environment"] = environment;
  const test::TemporaryFolder folder;
  return scene_load(folder.write("scene.gltf", b.gltf()));
}

const TextureView& map_of(const Scene& scene)
{
  return scene.textures->views()[static_cast<std::size_t>(scene.environment.texture_index)];
}

/// Radiance at a place of the map, v down.
Vec3f radiance(const Scene& scene, float u, float v)
{
  const Vec4f texel = texture_sample(map_of(scene), {u, v}, 0);
  return scene.environment.color * Vec3f{texel.x, texel.y, texel.z};
}

void expect_radiance(Vec3f found, Vec3f expected, float tolerance = 0.01f)
{
  EXPECT_NEAR(found.x, expected.x, tolerance);
  EXPECT_NEAR(found.y, expected.y, tolerance);
  EXPECT_NEAR(found.z, expected.z, tolerance);
}

std::string error_of(const json& environment)
{
  try {
    load(environment);
  } catch (const SceneError& error) {
    return error.what();
  }
  return "";
}

TEST(EnvironmentGraph, PositionsAreDirectionsWithZUp)
{
  const json geometry = json::array({{{"type", "geometry"}}});
  const Scene scene = load(environment(geometry, {{"node", 0}, {"output", "position"}}));
  EXPECT_EQ(map_of(scene).width, 512);
  expect_radiance(radiance(scene, 0.5f, 0.5f), {0, 1, 0});
  expect_radiance(radiance(scene, 0.75f, 0.5f), {1, 0, 0});
  expect_radiance(radiance(scene, 0.5f, 0.0f), {0, 0, 1});
  for (const char* output : {"normal", "trueNormal", "incoming"}) {
    const Scene back = load(environment(geometry, {{"node", 0}, {"output", output}}));
    expect_radiance(radiance(back, 0.25f, 0.5f), {1, 0, 0});
    expect_radiance(radiance(back, 0.0f, 0.5f), {0, 1, 0});
    expect_radiance(radiance(back, 0.5f, 1.0f), {0, 0, 1});
  }
}

TEST(EnvironmentGraph, GeneratedAndObjectAreDirectionsToo)
{
  for (const char* output : {"generated", "object"}) {
    const Scene scene = load(environment({{{"type", "texture-coordinate"}}}, {{"node", 0}, {"output", output}}));
    expect_radiance(radiance(scene, 0.625f, 0.25f), {0.5f, 0.5f, 0.7071f});
  }
}

TEST(EnvironmentGraph, FineGraphsGetFineMaps)
{
  const json noise = {{{"type", "texture-coordinate"}},
                      {{"type", "noise-texture"},
                       {"inputs", {{"vector", {{"node", 0}, {"output", "generated"}}}, {"scale", 30}, {"detail", 0}}}}};
  json e = environment(noise, {{"node", 1}, {"output", "factor"}});
  EXPECT_GT(map_of(load(e)).width, 512);
  e["graph"]["resolution"] = 64;
  EXPECT_EQ(map_of(load(e)).width, 64);
  EXPECT_EQ(map_of(load(e)).height, 32);
}

TEST(EnvironmentGraph, RadiancesBeyondHalfPrecisionStay)
{
  for (const float value : {1e8f, 1e-8f}) {
    expect_radiance(radiance(load(environment(json::array(), {value, value / 2, 0})), 0.3f, 0.4f) * (1 / value),
                    {1, 0.5f, 0}, 0.001f);
  }
  // What is no radiance is none.
  expect_radiance(radiance(load(environment(json::array(), {-1, 2, 0})), 0.3f, 0.4f), {0, 2, 0});
}

TEST(EnvironmentGraph, StrengthAndColourMultiply)
{
  json e = environment(json::array(), {1, 2, 3});
  e["color"] = {1, 0.5, 0.25};
  e["strength"] = 2;
  expect_radiance(radiance(load(e), 0.1f, 0.5f), {2, 2, 1.5f});
}

TEST(EnvironmentGraph, ErrorsSayWhere)
{
  json both = environment(json::array(), {1, 1, 1});
  both["image"] = 0;
  EXPECT_NE(error_of(both).find("/extensions/RELIEF_environment"), std::string::npos);
  EXPECT_NE(error_of(both).find("either a graph or a map"), std::string::npos);
  const json without = {{"graph", {{"nodes", json::array()}, {"outputs", json::object()}}}};
  EXPECT_NE(error_of(without).find("/extensions/RELIEF_environment/graph/outputs/color"), std::string::npos);
  EXPECT_NE(error_of({{"graph", {{"nodes", json::array()}}}}).find("graph/outputs"), std::string::npos);
  EXPECT_NE(error_of(environment({{{"type", "nonsense"}}}, {1, 1, 1})).find("graph/nodes/0/type"), std::string::npos);
  json narrow = environment(json::array(), {1, 1, 1});
  narrow["graph"]["resolution"] = 1;
  EXPECT_NE(error_of(narrow).find("graph/resolution"), std::string::npos);
}

TEST(EnvironmentGraph, WhatDependsOnTheRayIsWarnedAbout)
{
  const Scene scene = load(environment({{{"type", "light-path"}}}, {{"node", 0}, {"output", "camera"}}));
  EXPECT_TRUE(std::any_of(scene.warnings.begin(), scene.warnings.end(), [](const std::string& text) {
    return text.find("all rays see the same surroundings") != std::string::npos;
  }));
  expect_radiance(radiance(scene, 0.3f, 0.4f), {0, 0, 0});
}

TEST(EnvironmentGraph, BackdropsAreWhatTheCameraSees)
{
  const json by_ray = environment({{{"type", "light-path"}}}, {{"node", 0}, {"output", "camera"}});
  json both = by_ray;
  both["backdrop"] = by_ray;
  both["backdrop"]["strength"] = 3;
  const Scene scene = load(both);
  EXPECT_TRUE(std::none_of(scene.warnings.begin(), scene.warnings.end(), [](const std::string& text) {
    return text.find("see the same surroundings") != std::string::npos;
  }));
  expect_radiance(radiance(scene, 0.3f, 0.4f), {0, 0, 0});
  const Surroundings& seen = scene.environment.backdrop.value();
  const TextureView& map = scene.textures->views()[static_cast<std::size_t>(seen.texture_index)];
  EXPECT_NEAR(texture_sample(map, {0.3f, 0.4f}, 0).x * seen.color.x, 3.0f, 0.01f);
  both["backdrop"]["image"] = 0;
  EXPECT_NE(error_of(both).find("/extensions/RELIEF_environment/backdrop"), std::string::npos);
}

json sky(json options)
{
  options["type"] = "sky-texture";
  json e = environment(json::array({options}), {{"node", 0}});
  e["graph"]["resolution"] = 1024;
  return e;
}

/// Integral of red over the sphere.
double power(const Scene& scene)
{
  const TextureView& map = map_of(scene);
  double sum = 0;
  for (int y = 0; y < map.height; ++y) {
    const double v = (y + 0.5) / map.height;
    for (int x = 0; x < map.width; ++x) {
      const double u = (x + 0.5) / map.width;
      sum += std::sin(v * std::numbers::pi) *
             static_cast<double>(radiance(scene, static_cast<float>(u), static_cast<float>(v)).x);
    }
  }
  return sum * 2 * std::numbers::pi * std::numbers::pi / map.width / map.height;
}

TEST(EnvironmentGraph, SunsOfAnySizeHaveTheirPower)
{
  const json options = {{"sunElevation", 0.7}, {"sunRotation", 1}, {"sunIntensity", 1}};
  json without = options;
  without["sunDisc"] = false;
  const double rest = power(load(sky(without)));
  EXPECT_GT(rest, 1);
  double first = 0;
  for (const float size : {0.05f, 0.009512f, 0.002f, 0.0006f}) {
    json with = options;
    with["sunSize"] = size;
    // Cycles computes the disk's solid angle in single precision.
    const float rounded = 1 - std::cos(size / 2);
    const double exact = 1 - std::cos(static_cast<double>(size) / 2);
    const double sun = (power(load(sky(with))) - rest) * static_cast<double>(rounded) / exact;
    if (first == 0) first = sun;
    EXPECT_NEAR(sun / first, 1, 0.01) << size;
  }
  EXPECT_GT(first, rest);
}

TEST(EnvironmentGraph, SkiesOfNothingAreBlack)
{
  for (const char* kind : {"nishita", "single-scattering", "multiple-scattering"}) {
    json options = {{"sky", kind}, {"sunElevation", 0.7}, {"sunDisc", false}, {"air", 0}, {"dust", 0}, {"ozone", 0}};
    EXPECT_EQ(power(load(sky(options))), 0) << kind;
    // Nothing dims the sun, then, whose disk has its power wherever it stands above the horizon.
    options["sunDisc"] = true;
    double first = 0;
    for (const float elevation : {0.2f, 1.2f}) {
      options["sunElevation"] = elevation;
      options["sunSize"] = 0.05;
      const double sun = power(load(sky(options)));
      if (first == 0) first = sun;
      EXPECT_NEAR(sun / first, 1, 0.01) << kind;
    }
    EXPECT_GT(first, 10) << kind;
  }
}

TEST(EnvironmentGraph, ScatteringSkiesAreNishitasAboveTheHorizonAndHaveAGroundBelow)
{
  const json options = {{"sunElevation", 0.6}, {"sunDisc", false}};
  const auto of_kind = [&options](const char* kind) {
    json named = options;
    named["sky"] = kind;
    return load(sky(named));
  };
  const Scene nishita = of_kind("nishita"), single = of_kind("single-scattering"),
              multiple = of_kind("multiple-scattering");
  for (const float u : {0.1f, 0.4f, 0.8f}) {
    for (const float v : {0.05f, 0.2f, 0.4f}) {
      const Vec3f before = radiance(nishita, u, v), now = radiance(single, u, v), more = radiance(multiple, u, v);
      expect_radiance(now / before, {1, 1, 1}, 0.01f);
      // Another atmosphere, and more of its light.
      expect_radiance(more / before, {1.5f, 1.5f, 1.5f}, 0.7f);
    }
    // Both fade away below the horizon.
    expect_radiance(radiance(single, u, 0.53f) / radiance(nishita, u, 0.53f), {1, 1, 1}, 0.03f);
    EXPECT_EQ(max_component(radiance(single, u, 0.65f)), 0);
    EXPECT_GT(min_component(radiance(multiple, u, 0.8f)), 0);
  }
}

TEST(EnvironmentGraph, CoefficientsOfHosekAndWilkieAreTheTablesAtTheirKnots)
{
  const float half_pi = std::numbers::pi_v<float> / 2;
  const HosekWilkieSky low = hosek_wilkie_make(1, 0, 0), high = hosek_wilkie_make(1, 0, half_pi);
  EXPECT_NEAR(low.xyz[0].a, -1.117001f, 1e-6f);
  EXPECT_NEAR(low.xyz[0].h, 0.6083296f, 1e-6f);
  EXPECT_NEAR(high.xyz[0].a, -1.070108f, 1e-5f);
  EXPECT_NEAR(high.xyz[0].i, 2.343583f, 1e-5f);
  EXPECT_NEAR(hosek_wilkie_make(10, 0, 0).xyz[0].a, -1.841310f, 1e-5f);
  EXPECT_NEAR(hosek_wilkie_make(1, 1, 0).xyz[0].a, -1.116416f, 1e-6f);
  // Linear between turbidities, and between black and white ground.
  const float between =
      0.5f * (hosek_wilkie_make(4, 0.25f, 0.3f).xyz[1].radiance + hosek_wilkie_make(5, 0.25f, 0.3f).xyz[1].radiance);
  EXPECT_NEAR(hosek_wilkie_make(4.5f, 0.25f, 0.3f).xyz[1].radiance, between, 1e-5f * between);
}

TEST(EnvironmentGraph, TheSkyOfHosekAndWilkieIsItsFormula)
{
  const float elevation = 0.4f, turn = 1;  // from north to the east
  const json direction = {std::cos(elevation) * std::sin(turn), std::cos(elevation) * std::cos(turn),
                          std::sin(elevation)};
  const Scene scene =
      load(sky({{"sky", "hosek-wilkie"}, {"sunDirection", direction}, {"turbidity", 3.5}, {"groundAlbedo", 0.6}}));
  const HosekWilkieSky coefficients = hosek_wilkie_make(3.5f, 0.6f, elevation);
  for (const double u : {0.1, 0.55, 0.9}) {
    for (const double v : {0.05, 0.25, 0.45, 0.8}) {
      const double phi = (u - 0.5) * 2 * std::numbers::pi, theta = v * std::numbers::pi;
      const double cos_gamma = std::sin(theta) * std::cos(phi - 1) * std::cos(0.4) + std::cos(theta) * std::sin(0.4);
      const double cos_theta = std::max(std::cos(theta), 1e-3), gamma = std::acos(cos_gamma);
      double xyz[3];
      for (int c = 0; c < 3; ++c) {
        const HosekWilkieLobe& k = coefficients.xyz[c];
        const double around = (1 + cos_gamma * cos_gamma) / std::pow(1 + k.h * k.h - 2 * k.h * cos_gamma, 1.5);
        xyz[c] = (1 + k.a * std::exp(k.b / (cos_theta + 0.01))) *
                 (k.c + k.d * std::exp(k.e * gamma) + k.f * cos_gamma * cos_gamma + k.g * around +
                  k.i * std::sqrt(cos_theta)) *
                 k.radiance * 2 * std::numbers::pi / 683;
      }
      const double red = 3.2404542 * xyz[0] - 1.5371385 * xyz[1] - 0.4985314 * xyz[2];
      const double blue = 0.0556434 * xyz[0] - 0.2040259 * xyz[1] + 1.0572252 * xyz[2];
      const Vec3f found = radiance(scene, static_cast<float>(u), static_cast<float>(v));
      EXPECT_NEAR(static_cast<double>(found.x), std::max(red, 0.0), 0.002 * std::abs(red) + 1e-5) << u << ", " << v;
      EXPECT_NEAR(static_cast<double>(found.z), std::max(blue, 0.0), 0.002 * std::abs(blue) + 1e-5) << u << ", " << v;
    }
  }
}

TEST(EnvironmentGraph, TheSunStandsWhereItIsToldTo)
{
  // Clockwise from north, +Y, which is the map's middle.
  const Scene scene = load(sky({{"sunElevation", 0.5}, {"sunRotation", 1}, {"sunSize", 0.02}}));
  const float u = 0.5f + 1 / (2 * std::numbers::pi_v<float>), v = 0.5f - 0.5f / std::numbers::pi_v<float>;
  const float sun = radiance(scene, u, v).x;
  EXPECT_GT(sun, 100 * radiance(scene, u + 0.02f, v).x);
  EXPECT_GT(sun, 100 * radiance(scene, u, v + 0.02f).x);
  // The ground is black from asin 0.4 below the horizon on.
  expect_radiance(radiance(scene, u, 0.65f), {0, 0, 0}, 1e-6f);
  EXPECT_GT(radiance(scene, u, 0.52f).x, 0);
}

TEST(EnvironmentGraph, ImagesAreLookedUpByDirection)
{
  for (const char* projection : {"equirectangular", "mirror-ball"}) {
    const json node = {{"type", "environment-texture"}, {"projection", projection}, {"texture", {{"index", 0}}}};
    const Vec3f grey = radiance(load(environment(json::array({node}), {{"node", 0}, {"output", "color"}})), 0.3f, 0.4f);
    EXPECT_GT(grey.x, 0.1f);
    EXPECT_LT(grey.x, 0.9f);
  }
  EXPECT_NE(
      error_of(environment({{{"type", "environment-texture"}}}, {{"node", 0}, {"output", "color"}})).find("texture"),
      std::string::npos);
}

}  // namespace
}  // namespace relief
