// Scenes that a GltfBuilder describes, loaded, and what their warnings say.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>

#include "scene/load.h"
#include "tests/support/gltf_builder.h"

namespace relief::test {

inline Scene load(const GltfBuilder& b, const LoadOptions& options = {})
{
  const TemporaryFolder folder;
  return scene_load(folder.write("scene.gltf", b.gltf()), options);
}

/// How many of a scene's warnings have a text in them.
inline std::size_t num_warnings(const Scene& scene, const std::string& part)
{
  return static_cast<std::size_t>(
      std::count_if(scene.warnings.begin(), scene.warnings.end(),
                    [&](const std::string& w) { return w.find(part) != std::string::npos; }));
}

inline bool has_warning(const Scene& scene, const std::string& part) { return num_warnings(scene, part) > 0; }

}  // namespace relief::test
