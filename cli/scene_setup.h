// What several sub-commands make of a scene and their arguments.
#pragma once

#include <optional>
#include <string>

#include <CLI/CLI.hpp>

#include "integrator/displacement_set.h"
#include "scene/load.h"

namespace relief {

/// --strict: no warning is acceptable.
/// @error SceneError with the first warning and the number of all
void refuse_warnings(const std::string& file, const std::vector<std::string>& warnings);

/// The named camera (empty: the first), framed for an image.
/// @error CLI::ValidationError listing the cameras there are
Camera camera_for_image(const Scene& scene, const std::string& name, int width, int height);

/// Adds --displacement; `options` must outlive the parser.
void add_displacement_method(CLI::App& command, DisplacementOptions& options);

/// Adds --displacement-memory likewise.
void add_displacement_memory(CLI::App& command, DisplacementOptions& options);
/// Adds --lod likewise.
void add_displacement_lod(CLI::App& command, DisplacementOptions& options);
/// Adds --caustics likewise; without it `mode` stays as it is.
void add_caustics_mode(CLI::App& command, std::optional<CausticsMode>& mode);

}  // namespace relief
