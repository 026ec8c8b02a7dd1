// A scene's displaced meshes, as displacement/ takes them.
#pragma once

#include <string>
#include <vector>

#include "displacement/displacement_set.h"
#include "scene/scene.h"

namespace relief {

/// What a scene's displaced materials need to be traced.
/// @param scene  must outlive the result
/// @error std::runtime_error, see DisplacementSet; SceneError if surfaces are beyond Embree's limits
DisplacementSet scene_displacement(const Scene& scene, const DisplacementOptions& options);

/// Settings of the scene that are not followed as they are written: what is done instead, a line each.
std::vector<std::string> displacement_warnings(const Scene& scene, const DisplacementOptions& options);

/// Rays of a render, about.
double expected_rays(const RenderSettings& settings);

}  // namespace relief
