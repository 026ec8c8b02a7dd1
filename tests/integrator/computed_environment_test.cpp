// Surroundings by a value graph: what a direction is for it, how directions are chosen, and what is wrong with one.
#include "integrator/computed_environment.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "integrator/environment_tables.h"
#include "integrator/light_set.h"
#include "integrator/stages.h"
#include "kernel/globals.h"
#include "kernel/sample/sobol.h"
#include "kernel/sample/warp.h"
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

/// Direction of a place of a lat-long map, v down, whose middle looks along −Z.
Vec3f direction_of(double u, double v)
{
  const double phi = (u - 0.5) * 2 * std::numbers::pi, theta = v * std::numbers::pi;
  return {static_cast<float>(std::sin(theta) * std::sin(phi)), static_cast<float>(std::cos(theta)),
          static_cast<float>(-std::sin(theta) * std::cos(phi))};
}

ComputedEnvironment computed_of(const Scene& scene, const Surroundings& surroundings)
{
  return computed_environment_make(surroundings.graph.value(), surroundings.rotation, stage_table_select().run_graph,
                                   scene.textures->views().data());
}

Vec3f radiance(const Scene& scene, const Surroundings& surroundings, float u, float v)
{
  const ComputedEnvironment computed = computed_of(scene, surroundings);
  return environment_eval(environment_view_make(computed, surroundings.color, surroundings.rotation),
                          direction_of(static_cast<double>(u), static_cast<double>(v)));
}

Vec3f radiance(const Scene& scene, float u, float v) { return radiance(scene, scene.environment, u, v); }

EnvironmentTables tables_of(const Scene& scene, EnvironmentDensity density)
{
  const Environment& e = scene.environment;
  return environment_tables_make(std::make_shared<ComputedEnvironment>(computed_of(scene, e)), e.color, e.rotation,
                                 e.graph->suns, environment_graph_image_side(*e.graph, scene.textures->views()), density);
}

void expect_radiance(Vec3f found, Vec3f expected, float tolerance = 2e-6f)
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
    expect_radiance(radiance(scene, 0.625f, 0.25f), {0.5f, 0.5f, std::sqrt(0.5f)});
  }
}

TEST(EnvironmentGraph, RadiancesBeyondHalfPrecisionStay)
{
  for (const float value : {1e8f, 1e-8f}) {
    expect_radiance(radiance(load(environment(json::array(), {value, value / 2, 0})), 0.3f, 0.4f) * (1 / value),
                    {1, 0.5f, 0});
  }
  expect_radiance(radiance(load(environment(json::array(), {-1, 2, 0})), 0.3f, 0.4f), {-1, 2, 0});
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
  EXPECT_EQ(radiance(scene, seen, 0.3f, 0.4f).x, 3.0f);
  both["backdrop"]["image"] = 0;
  EXPECT_NE(error_of(both).find("/extensions/RELIEF_environment/backdrop"), std::string::npos);
}

json sky(json options)
{
  options["type"] = "sky-texture";
  return environment(json::array({options}), {{"node", 0}});
}

/// Integral of red over the sphere, by the directions that are chosen.
double power(const Scene& scene)
{
  constexpr std::uint32_t kSamples = 1u << 16;
  const EnvironmentTables tables = tables_of(scene, EnvironmentDensity::kRadiance);
  const EnvironmentView view = tables.view();
  double sum = 0;
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    const EnvironmentSample sample = environment_sample(view, sample_2d(0, i, 0));
    if (sample.pdf_solid_angle > 0) sum += static_cast<double>(sample.radiance.x / sample.pdf_solid_angle);
  }
  return sum / kSamples;
}

/// The same by a grid of directions.
double power_by_grid(const Scene& scene, int rows)
{
  const ComputedEnvironment computed = computed_of(scene, scene.environment);
  const EnvironmentView view = environment_view_make(computed, scene.environment.color, scene.environment.rotation);
  double sum = 0;
  for (int y = 0; y < rows; ++y) {
    const double v = (y + 0.5) / rows;
    for (int x = 0; x < 2 * rows; ++x) {
      sum += std::sin(v * std::numbers::pi) *
             static_cast<double>(environment_eval(view, direction_of((x + 0.5) / (2 * rows), v)).x);
    }
  }
  return sum * std::numbers::pi * std::numbers::pi / rows / rows;
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

json noise(double scale)
{
  return environment({{{"type", "texture-coordinate"}},
                      {{"type", "noise-texture"},
                       {"inputs", {{"vector", {{"node", 0}, {"output", "generated"}}}, {"scale", scale}, {"detail", 2}}}}},
                     {{"node", 1}, {"output", "factor"}});
}

/// What makes a sun, cells and noise of two scales; each with and without a turn.
std::vector<Scene> varied_scenes()
{
  std::vector<Scene> scenes;
  for (const double rotation : {0.0, 1.0}) {
    for (json e : {noise(3), noise(90), sky({{"sunElevation", 0.5}, {"sunRotation", 1}, {"sunSize", 0.1}})}) {
      e["rotation"] = rotation;
      scenes.push_back(load(e));
    }
  }
  return scenes;
}

TEST(ComputedEnvironment, IsNotBlurred)
{
  // 2,000 cells a radian: a map of 4,096 texels has a third of that.
  const Scene scene = load(environment({{{"type", "texture-coordinate"}},
                                        {{"type", "checker-texture"},
                                         {"inputs", {{"vector", {{"node", 0}, {"output", "generated"}}}, {"scale", 2000}}}}},
                                       {{"node", 1}, {"output", "factor"}}));
  int num_grey = 0, num_white = 0;
  for (int i = 0; i < 2000; ++i) {
    const float value = radiance(scene, 0.001f * static_cast<float>(i % 997), 0.3f + 0.0001f * static_cast<float>(i)).x;
    num_grey += value != 0 && value != 1;
    num_white += value == 1;
  }
  EXPECT_EQ(num_grey, 0);
  EXPECT_NEAR(num_white, 1000, 150);
}

TEST(ComputedEnvironment, TurnsAsAMapWould)
{
  json e = noise(3);
  const Scene still = load(e);
  e["rotation"] = 2 * std::numbers::pi * 0.125;
  const Scene turned = load(e);
  for (const float u : {0.1f, 0.45f, 0.8f}) {
    expect_radiance(radiance(turned, u, 0.4f), radiance(still, u + 0.125f, 0.4f), 1e-5f);
  }
}

TEST(ComputedEnvironment, SamplesHaveTheRadianceAndTheDensityOfTheirDirections)
{
  for (const Scene& scene : varied_scenes()) {
    for (const EnvironmentDensity density : {EnvironmentDensity::kRadiance, EnvironmentDensity::kExcess}) {
      const EnvironmentTables tables = tables_of(scene, density);
      const EnvironmentView view = tables.view();
      constexpr std::uint32_t kSamples = 20000;
      int num_others = 0;
      for (std::uint32_t i = 0; i < kSamples; ++i) {
        const EnvironmentSample s = environment_sample(view, sample_2d(1, i, 0));
        ASSERT_GT(s.pdf_solid_angle, 0.0f);
        ASSERT_NEAR(length(s.wi), 1.0f, 1e-6f);
        ASSERT_EQ(s.radiance, environment_eval(view, s.wi));
        num_others += std::abs(environment_pdf(view, s.wi) - s.pdf_solid_angle) > 1e-5f * s.pdf_solid_angle;
      }
      // As in EnvironmentSampling: directions within rounding of a cell's border.
      EXPECT_LE(num_others, static_cast<int>(kSamples / 500));
    }
  }
}

TEST(ComputedEnvironment, DensityIntegratesToOneAndFollowsWhatIsSampled)
{
  constexpr int kRows = 1024, kBlocks = 8, kSamples = 1 << 17;
  for (const Scene& scene : varied_scenes()) {
    for (const EnvironmentDensity density : {EnvironmentDensity::kRadiance, EnvironmentDensity::kExcess}) {
      const EnvironmentTables tables = tables_of(scene, density);
      const EnvironmentView view = tables.view();
      std::vector<double> expected(2 * kBlocks * kBlocks), found(expected.size());
      const auto block_of = [](double u, double v) {
        const int x = std::min(static_cast<int>(u * 2 * kBlocks), 2 * kBlocks - 1);
        return static_cast<std::size_t>(std::min(static_cast<int>(v * kBlocks), kBlocks - 1) * 2 * kBlocks + x);
      };
      double total = 0;
      for (int y = 0; y < kRows; ++y) {
        const double v = (y + 0.5) / kRows;
        const double weight = std::sin(v * std::numbers::pi) * std::numbers::pi * std::numbers::pi / kRows / kRows;
        for (int x = 0; x < 2 * kRows; ++x) {
          const double u = (x + 0.5) / (2 * kRows);
          const double part = weight * static_cast<double>(environment_pdf(view, direction_of(u, v)));
          expected[block_of(u, v)] += part;
          total += part;
        }
      }
      EXPECT_NEAR(total, 1, 0.005);
      for (std::uint32_t i = 0; i < kSamples; ++i) {
        const Vec3f wi = environment_sample(view, sample_2d(2, i, 0)).wi;
        const double u = 0.5 + std::atan2(static_cast<double>(wi.x), static_cast<double>(-wi.z)) / (2 * std::numbers::pi);
        found[block_of(u, std::acos(std::clamp(static_cast<double>(wi.y), -1.0, 1.0)) / std::numbers::pi)] += 1.0 / kSamples;
      }
      // Five standard deviations of independent samples, besides what the grid errs by.
      for (std::size_t i = 0; i < found.size(); ++i) {
        EXPECT_NEAR(found[i], expected[i], 5 * std::sqrt(expected[i] / kSamples) + 0.01 * expected[i] + 1e-4) << i;
      }
    }
  }
}

TEST(ComputedEnvironment, SamplingFindsAllOfTheLight)
{
  for (const Scene& scene : varied_scenes()) {
    const double expected = power_by_grid(scene, 1024);
    EXPECT_NEAR(power(scene), expected, 0.01 * expected);
  }
}

/// The height of a direction as its radiance: 2π/3 on what looks up, as much taken from what looks down.
TEST(ComputedEnvironment, WhatIsNegativeIsSampledAsWhatIsPositive)
{
  const Scene scene = load(environment(
      {{{"type", "geometry"}}, {{"type", "separate"}, {"inputs", {{"vector", {{"node", 0}, {"output", "position"}}}}}}},
      {{"node", 1}, {"output", "z"}}));
  const EnvironmentTables tables = tables_of(scene, EnvironmentDensity::kRadiance);
  const EnvironmentView view = tables.view();
  constexpr int kSamples = 4096;
  double up = 0, down = 0;
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    const EnvironmentSample s = environment_sample(view, sample_2d(4, i, 0));
    ASSERT_GT(s.pdf_solid_angle, 0.0f);
    const double radiance = static_cast<double>(s.radiance.x / s.pdf_solid_angle) / kSamples;
    (s.wi.y > 0.0f ? up : down) += radiance * static_cast<double>(std::fabs(s.wi.y));
  }
  EXPECT_NEAR(up, 2 * std::numbers::pi / 3, 0.02);
  EXPECT_NEAR(down, -2 * std::numbers::pi / 3, 0.02);
  expect_radiance(environment_eval(view, {0, -1, 0}), {-1, -1, -1}, 2e-3f);
}

TEST(ComputedEnvironment, DiskOfASunIsSampledByItself)
{
  const Scene scene = load(sky({{"sunElevation", 0.5}, {"sunRotation", 1}}));
  const EnvironmentTables tables = tables_of(scene, EnvironmentDensity::kExcess);
  const EnvironmentView view = tables.view();
  ASSERT_EQ(view.num_suns, 1);
  constexpr int kSamples = 4096;
  int num_in_sun = 0;
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    const EnvironmentSample s = environment_sample(view, sample_2d(3, i, 0));
    num_in_sun += s.radiance.x > 1000;
  }
  // Half of a clear day's light and more is the sun's; of a cell it fills a third.
  EXPECT_GT(num_in_sun, kSamples / 2);
  EXPECT_LT(num_in_sun, kSamples * 9 / 10);
  EXPECT_LT(tables.bytes(), std::size_t{5} << 19);
}

TEST(ComputedEnvironment, InterpolatesWhereItIsSmoothAlone)
{
  // Of a clear sky the horizon is sharp, and the sun's rim.
  const Scene scene = load(sky({{"sunElevation", 0.5}, {"sunRotation", 1}}));
  const EnvironmentTables tables = tables_of(scene, EnvironmentDensity::kExcess);
  const EnvironmentView view = tables.view();
  double num_smooth = 0;
  for (const std::uint8_t is_smooth : tables.computed->map.is_smooth) num_smooth += is_smooth;
  EXPECT_GT(num_smooth, 0.95 * ComputedCells::kColumns * ComputedCells::kRows);
  constexpr std::uint32_t kPlaces = 50000;
  std::vector<Vec2f> places(kPlaces);
  double sum = 0;
  for (std::uint32_t i = 0; i < kPlaces; ++i) {
    places[i] = sample_2d(4, i, 0);
    const float value = max_component(radiance(scene, places[i].x, places[i].y));
    constexpr float kSun = 1000;  // no sky is as bright
    if (value < kSun) sum += static_cast<double>(value);
  }
  // Where it fades to black, what is small beside the sky.
  const float least = 4e-4f * static_cast<float>(sum / kPlaces);
  for (const Vec2f at : places) {
    const Vec3f found = environment_eval(view, direction_of(static_cast<double>(at.x), static_cast<double>(at.y)));
    const Vec3f exact = radiance(scene, at.x, at.y);
    ASSERT_LT(max_component(found - exact), 0.004f * max_component(exact) + least) << at.x << ", " << at.y;
    ASSERT_LT(max_component(exact - found), 0.004f * max_component(exact) + least) << at.x << ", " << at.y;
  }
  const Scene textured = load(noise(3));
  EXPECT_TRUE(tables_of(textured, EnvironmentDensity::kExcess).computed->map.is_smooth.empty());
}

TEST(ComputedEnvironment, InterpolatesWithinSuns)
{
  for (const double elevation : {0.02, 0.5, 1.4}) {
    const Scene scene = load(sky({{"sunElevation", elevation}, {"sunRotation", 1}}));
    const EnvironmentTables tables = tables_of(scene, EnvironmentDensity::kExcess);
    const EnvironmentView view = tables.view();
    const ComputedEnvironment graph = computed_of(scene, scene.environment);
    ASSERT_EQ(tables.computed->suns.size(), 1u);
    const SmoothGrid& grid = tables.computed->suns[0].grid;
    double num_smooth = 0;
    for (const std::uint8_t is_smooth : grid.is_smooth) num_smooth += is_smooth;
    // The disk has two thirds of its square.
    EXPECT_GT(num_smooth, 0.4 * static_cast<double>(grid.values.size())) << elevation;
    const Frame frame = frame_from_normal(view.suns[0].towards);
    for (std::uint32_t i = 0; i < 20000; ++i) {
      // Beyond the rim, too.
      const Vec3f d = from_local(frame, warp_cone(1.3f * view.suns[0].cone, sample_2d(5, i, 0)));
      const Vec3f exact = environment_eval(environment_view_make(graph, scene.environment.color, scene.environment.rotation), d);
      const Vec3f found = environment_eval(view, d);
      ASSERT_LT(max_component(abs(found - exact)), 0.004f * max_component(exact)) << elevation << ": " << i;
    }
  }
}

}  // namespace
}  // namespace relief
