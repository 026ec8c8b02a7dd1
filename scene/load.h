// The way from a file to a Scene.
#pragma once

#include <filesystem>

#include "scene/scene.h"

namespace relief {

struct LoadOptions {
  double frame = 0;                                         ///< animation time in frames; used only if `has_frame`
  bool has_frame = false;                                   ///< false: rest pose
  std::size_t texture_budget_bytes = std::size_t{4} << 30;  ///< above it textures go through a tile cache
};

/// Loads, composes, validates and resolves a scene.
/// @param path  .gltf or .glb
/// @error SceneError for anything wrong with the file or what it refers to; never crashes on any input
Scene scene_load(const std::filesystem::path& path, const LoadOptions& options = {});

}  // namespace relief
