// What several sub-commands make of a scene and their arguments.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <CLI/App.hpp>

#include "cli/arguments.h"
#include "displacement/displacement_set.h"
#include "scene/load.h"

namespace relief {

/// --strict: no warning is acceptable.
/// @error SceneError with the first warning and the number of all
void refuse_warnings(const std::string& file, const std::vector<std::string>& warnings);

/// The frames of a list; of "all", those of the scene. Empty: the rest pose.
/// @error CLI::ValidationError if a scene has frames that no list could name; as scene_settings
std::vector<int> frames_of(const FrameList& list, const std::string& scene);

/// What the command line says of a scene as a whole, whatever is then done with it.
struct SceneSetup {
  double luminous_efficacy = 0;  ///< lm/W; 0: the scene says
  std::optional<EnvironmentChoice> environment;
  bool continue_without_textures = false;
  std::string background;  ///< "world", "black" or "transparent"; empty: the scene says

  /// @param frame  empty: the rest pose
  LoadOptions load_options(std::optional<int> frame = {}) const;

  /// Image that --environment names; empty: none.
  std::string environment_file() const;
};

/// Adds the options about light; `setup` must outlive the parser.
std::vector<CLI::Option*> add_light_options(CLI::App& command, SceneSetup& setup);

/// Adds --continue-without-textures.
void add_continue_without_textures(CLI::App& command, SceneSetup& setup);

/// Each adds one option; `options` must outlive the parser.
CLI::Option* add_displacement_method(CLI::App& command, DisplacementOptions& options);
CLI::Option* add_displacement_error(CLI::App& command, DisplacementOptions& options);
CLI::Option* add_displacement_memory(CLI::App& command, DisplacementOptions& options);
CLI::Option* add_displacement_lod(CLI::App& command, DisplacementOptions& options);
CLI::Option* add_displacement_rmip(CLI::App& command, DisplacementOptions& options);
/// Without it `mode` stays as it is.
CLI::Option* add_caustics_mode(CLI::App& command, std::optional<CausticsMode>& mode);

}  // namespace relief
