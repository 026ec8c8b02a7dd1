// Values of the settings in render_settings.inc: from a file, and as JSON for people and programs.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "scene/json_reader.h"
#include "scene/render_settings.h"

namespace relief {

/// RenderSettings of a RELIEF_render.
/// @error SceneError for a value of another type or beyond its range
RenderSettings render_settings_read(const JsonReader& r, Warnings& warnings);

/// A setting and what it is.
struct SettingValue {
  const SettingInfo* info;
  nlohmann::json value;
  nlohmann::json fallback;  ///< what it is where nothing is said; null: no value that a file may say
};

/// All of them, in the order of the list. A number is as short as tells it from its neighbours.
std::vector<SettingValue> setting_values(RenderSettings settings);

/// A value as a file would say it, on one line. What is no UTF-8 is replaced.
std::string setting_text(const nlohmann::json& value);

}  // namespace relief
