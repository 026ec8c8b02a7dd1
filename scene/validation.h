// What a glTF file must look like before any of it is used. tinygltf trusts types and ranges it never checked, so it is
// only ever given a copy that holds the properties listed in validation.cpp and nothing else, each of the right type,
// each number in range and each index inside its array.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "scene/diagnostics.h"

namespace relief {

/// Parses JSON text of any content.
/// @error SceneError: not JSON (with the position), nested deeper than 100 levels, or not an object
nlohmann::json validation_parse(std::string_view text, const std::string& file);

/// Removes what is null, which many programs write for what is not there, with a warning; what is in `extras` stays.
void validation_drop_nulls(nlohmann::json& document, const std::string& file, Warnings& warnings);

/// Checks glTF's core properties and copies them; integers written as 3.0 become 3, extensions, extras and what relief
/// does not read (skins, min and max of accessors) are left out.
/// What is wrong but has an obvious meaning gets it, with a warning: factors a little out of range, an unknown interpolation
/// or alpha mode, nodes of a scene that are no roots, nodes with two parents.
/// @return document for tinygltf: without `buffers` and `images`, which are checked too but loaded by gltf_document
/// @error  SceneError with the JSON path of the first property that is missing, of the wrong type or out of range; cycles
///         in the node tree; accessors of primitives that do not exist
nlohmann::json validation_conform(const nlohmann::json& document, const std::string& file, Warnings& warnings);

/// Warns about extensions that are used and not read, or there and not declared, about skins and the like.
/// @error SceneError naming the first required extension that is not read
void validation_check_support(const nlohmann::json& document, const std::string& file, Warnings& warnings);

}  // namespace relief
