// What the numbers of KHR_lights_punctual stand for. The extension says candela and lux; programs that count in watts turn
// them into those by a luminous efficacy, and files do not say which.
#pragma once

#include <string>

#include "scene/gltf_document.h"

namespace relief {

/// Divisors that make watts of a file's numbers.
struct LightUnits {
  float intensity = 1;   ///< of point and spot lights, to W/sr
  float irradiance = 1;  ///< of directional ones, to W/m²
  std::string assumed;   ///< what had to be guessed, for a warning; empty: nothing
};

/// Units of a file's lights.
/// @param luminous_efficacy  lm/W that the user or the scene asks for; 0: neither does, and the exporter that wrote the file
///                           decides. Blender's has had three ways since its version 3.4.40 (of Blender 3.4): "Standard"
///                           (its default: 683 lm/W), "Unitless" (W/sr and W/m²) and "Raw"; no trace of the choice is in
///                           the file. Which of the first two it was follows from how bright the lights are. Before,
///                           there was "Raw" alone: W of points and spots, W/m² of suns.
/// @source glTF-Blender-IO, gltf2_blender_gather_lights.py; of 3.3.0 and of 3.4.0, where 2308ce88 and f66e491c changed it
LightUnits light_units(const GltfDocument& document, float luminous_efficacy);

}  // namespace relief
