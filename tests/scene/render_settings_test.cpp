// The list of settings: what is declared is what files may say, and what is shown of them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "scene/setting_values.h"

namespace relief {
namespace {

using nlohmann::json;

/// Where a setting stands in RELIEF_render.
json::json_pointer pointer_of(const SettingInfo& info)
{
  std::string text = '/' + std::string(info.name);
  std::replace(text.begin(), text.end(), '.', '/');
  return json::json_pointer(text);
}

/// RELIEF_render with one setting.
json saying(const SettingInfo& info, const json& value)
{
  json out = json::object();
  out[pointer_of(info)] = value;
  return out;
}

RenderSettings read(const json& said)
{
  Warnings warnings;
  const RenderSettings settings = render_settings_read(JsonReader(said, "scene.gltf", "/r"), warnings);
  EXPECT_TRUE(warnings.texts().empty());
  return settings;
}

/// The error about what is said.
SceneError refusal(const json& said)
{
  Warnings warnings;
  try {
    render_settings_read(JsonReader(said, "scene.gltf", "/r"), warnings);
  } catch (const SceneError& error) {
    return error;
  }
  ADD_FAILURE() << said << " is accepted";
  return {"", "", "", ""};
}

json value_of(const RenderSettings& settings, const SettingInfo& info)
{
  const std::vector<SettingValue> all = setting_values(settings);
  return std::find_if(all.begin(), all.end(), [&](const SettingValue& s) { return s.info->name == info.name; })->value;
}

TEST(RenderSettingsList, ValuesOfAnotherTypeAreRefusedByNameOfFileAndPlace)
{
  for (const SettingInfo& info : kRenderSettings) {
    for (const json& wrong : {json(true), json(nullptr), json::object(), json({1, "a"}), json({1, 2, 3})}) {
      const SceneError error = refusal(saying(info, wrong));
      EXPECT_EQ(error.file, "scene.gltf") << info.name;
      EXPECT_EQ(error.json_path.find("/r" + pointer_of(info).to_string()), 0u) << error.what();
      EXPECT_FALSE(error.expected.empty() || error.found.empty()) << info.name;
    }
  }
}

TEST(RenderSettingsList, LimitsAreAllowedAndWhatIsBeyondIsNot)
{
  for (const SettingInfo& info : kRenderSettings) {
    for (const auto& [limit, outwards] : {std::pair{info.range.low, -1.0}, {info.range.high, 1.0}}) {
      if (!std::isfinite(limit)) continue;
      const auto value = [&info = info](double x) -> json {
        // A pair's other number is the same, so that none comes after the other.
        return info.type == SettingType::kIntegerPair ? json({x, x}) : json(x);
      };
      EXPECT_NO_THROW(read(saying(info, value(limit)))) << info.name << ' ' << limit;
      const double step = info.type == SettingType::kNumber ? std::fabs(limit) * 1e-6 + 1e-9 : 2.0;
      const SceneError error = refusal(saying(info, value(limit + outwards * step)));
      EXPECT_NE(error.expected.find(number_text(limit)), std::string::npos) << info.name << ": " << error.what();
    }
  }
}

TEST(RenderSettingsList, EveryLabelIsReadAsItself)
{
  for (const SettingInfo& info : kRenderSettings) {
    for (const std::string_view label : info.range.labels) {
      EXPECT_EQ(value_of(read(saying(info, label)), info), label) << info.name;
    }
  }
}

TEST(RenderSettingsList, WhatIsReadIsShown)
{
  const json said = json::parse(R"({
    "resolution": [640, 480], "samples": 9, "noiseThreshold": 0.01, "noiseMaths": "3.4", "minSamples": 8,
    "filterGlossy": 0.5, "clampDirect": 4, "maxBounces": 5, "diffuseBounces": 4,
    "glossyBounces": 3, "transmissionBounces": 2, "volumeBounces": 1, "transparentBounces": 7, "seed": 9007199254740991, "view": "Filmic",
    "exposure": -1, "clampIndirect": 3, "filmExposure": 2, "frameRange": [-2, 8], "fps": 29.97,
    "pixelFilter": {"type": "box", "width": 2}, "luminousEfficacy": 683, "caustics": {"mode": "on", "kinds": "none", "photons": 1000,
    "alpha": 0.7, "radius": 0.1, "memory": 64}, "mist": {"start": 1, "depth": 2, "falloff": "linear"},
    "occlusionDistance": 0.3, "cryptomatteLevels": 8})");
  for (const SettingValue& setting : setting_values(read(said))) {
    EXPECT_EQ(setting.value, said.at(pointer_of(*setting.info)));
    EXPECT_NE(setting.value, setting.fallback) << setting.info->name;
  }
}

TEST(RenderSettingsList, NothingSaidIsTheDefault)
{
  for (const SettingValue& setting : setting_values(read(json::object()))) {
    EXPECT_EQ(setting.value, setting.fallback) << setting.info->name;
  }
  EXPECT_EQ(value_of({}, setting_info("luminousEfficacy")), nullptr)
      << "no number that a file may say stands for the exporter's";
}

TEST(RenderSettingsList, DefaultsFollowWhatTheyDependOn)
{
  const RenderSettings s = read({{"maxBounces", 3}, {"glossyBounces", 5}, {"pixelFilter", {{"type", "box"}}}});
  EXPECT_EQ(s.diffuse_bounces, 3);
  EXPECT_EQ(s.glossy_bounces, 5);
  EXPECT_EQ(s.filter_width, 1);
  EXPECT_EQ(RenderSettings{}.filter_width, 1.5f);
  EXPECT_EQ(RenderSettings{}.transmission_bounces, 12);
}

TEST(RenderSettingsList, UnknownPropertiesOfObjectsAreWarnedAbout)
{
  Warnings warnings;
  const json said = {{"mist", {{"colour", 1}}}, {"caustics", {{"photon", 1}}}, {"sample", 1}};
  render_settings_read(JsonReader(said, "scene.gltf", "/r"), warnings);
  ASSERT_EQ(warnings.texts().size(), 3u);
  for (const char* path : {"/r/mist/colour", "/r/caustics/photon", "/r/sample"}) {
    EXPECT_NE((warnings.texts()[0] + warnings.texts()[1] + warnings.texts()[2]).find(path), std::string::npos) << path;
  }
}

}  // namespace
}  // namespace relief
