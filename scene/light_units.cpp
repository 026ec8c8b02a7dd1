#include "scene/light_units.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <string_view>

namespace relief {
namespace {

using Version = std::array<int, 3>;

/// Version of Blender's exporter that wrote the file; empty: something else did.
std::optional<Version> blender_exporter(const GltfDocument& document)
{
  constexpr std::string_view kName = "Khronos glTF Blender I/O v";
  const auto& asset = document.json.at("asset");
  const auto generator = asset.find("generator");
  if (generator == asset.end() || !generator->is_string()) return {};
  std::string_view text = generator->get_ref<const std::string&>();
  if (!text.starts_with(kName)) return {};
  text.remove_prefix(kName.size());
  Version version{};
  const char* at = text.data();
  const char* const end = at + text.size();
  for (int& number : version) {
    const auto read = std::from_chars(at, end, number);
    if (read.ec != std::errc()) return {};
    at = read.ptr < end && *read.ptr == '.' ? read.ptr + 1 : read.ptr;
  }
  return version;
}

/// Greatest intensity of the file's lights. Mistakes in them are found when they are placed.
double brightest(const GltfDocument& document)
{
  double intensity = 0;
  document.read_extension(document.json, "", "KHR_lights_punctual", [&](const JsonReader& r) {
    if (!r.has("lights") || !r.raw("lights").is_array()) return;
    for (const auto& light : r.raw("lights")) {
      const auto found = light.is_object() ? light.find("intensity") : light.end();
      if (found != light.end() && found->is_number()) intensity = std::max(intensity, found->get<double>());
    }
  });
  return intensity;
}

}  // namespace

LightUnits light_units(const GltfDocument& document, float luminous_efficacy)
{
  if (luminous_efficacy > 0) return {luminous_efficacy, luminous_efficacy, {}};
  const std::optional<Version> version = blender_exporter(document);
  if (!version || *version < Version{1, 0, 0}) return {};
  constexpr Version kFirstWithUnits{3, 4, 40};
  constexpr float kFourPi = 12.566371f;
  const std::string how = "; --luminous-efficacy or RELIEF_render.luminousEfficacy says otherwise";
  if (*version < kFirstWithUnits) {
    return {kFourPi, 1, "lights as Blender's glTF exporter wrote them before 3.4: watts" + how};
  }
  // As "Standard" this is a lamp of 3.7 W or a sun of .3 W/m², as "Unitless" one of 2500 W or a sun of 200 W/m²: between
  // what people set in Blender, lamps of 10 to 1000 W and suns of 1 to 10 W/m².
  constexpr double kLeastStandard = 200;
  if (brightest(document) < kLeastStandard) {
    return {
        1, 1,
        "lights of Blender's glTF exporter, so dim that they were exported as \"Unitless\": taken as W/sr and W/m²" +
            how};
  }
  constexpr float kStandard = 683;  // lm/W of green light of 555 nm
  return {kStandard, kStandard,
          "lights of Blender's glTF exporter: taken as \"Standard\", its default, of 683 lm/W" + how};
}

}  // namespace relief
