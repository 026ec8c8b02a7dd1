// The way from a file to a Scene.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "scene/environment_preset.h"
#include "scene/framing.h"
#include "scene/graph/graph_program.h"
#include "scene/scene.h"

namespace relief {

class KeptImages;  // scene/kept_images.h

struct LoadOptions {
  double frame = 0;        ///< animation time in frames; used only if `has_frame`
  bool has_frame = false;  ///< false: rest pose
  CameraChoice camera;
  bool needs_camera = false;                                ///< it is an error if the file has none
  float luminous_efficacy = 0;                              ///< lm/W of the scene's lights; 0: the scene says
  std::optional<EnvironmentChoice> environment;             ///< empty: the scene's
  std::optional<bool> environment_visible;                  ///< to cameras; empty: as the environment has it
  bool continue_without_textures = false;                   ///< warnings for what cannot be read, which is magenta
  std::size_t texture_budget_bytes = std::size_t{4} << 30;  ///< above it textures go through a tile cache
  KeptImages* kept = nullptr;                               ///< of the frames before; gets this frame's
  /// Asked of scenes without light but for what glows, with the place of their camera: whether that is enough. Null: points of
  /// surfaces decide alone, see emission_lights_scene.
  bool (*emission_shows)(const Scene& scene, std::size_t camera) = nullptr;
  /// Evaluates heights of which maps are made. This one runs everywhere, and slowly.
  GraphRun run_graph = graph_program_run;

  bool operator==(const LoadOptions&) const = default;
};

/// Loads, composes, validates and resolves a scene.
/// @param path  .gltf or .glb
/// @error SceneError for anything wrong with the file or what it refers to; never crashes on any input
Scene scene_load(const std::filesystem::path& path, const LoadOptions& options = {});

/// Every file that scene_load reads, and those that an environment of the command line replaces: what no output may be.
/// No image is read.
/// @error SceneError
std::vector<FileStamp> scene_files(const std::filesystem::path& path);

/// A scene's RenderSettings as scene_load gives them, without loading what it shows.
/// @error SceneError
RenderSettings scene_settings(const std::filesystem::path& path);

}  // namespace relief
