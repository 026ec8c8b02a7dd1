// What textures, height maps and luminaires of a scene cannot be read: told all at once, not one a run.
#pragma once

#include <vector>

#include "scene/diagnostics.h"

namespace relief {

/// What is shown in place of an image that is missing, as in Blender: magenta, opaque.
inline constexpr unsigned char kMissingTexel[4] = {255, 0, 255, 255};
/// The height of that colour: its luminance.
inline constexpr float kMissingHeight = 0.2848f;

/// Collects faults. Not for use by several threads at once.
class TextureFaults {
 public:
  void add(const SceneError& fault);

  /// Takes note of what was found: each is a warning, or all are one error.
  /// @param goes_on  without what is missing
  /// @error SceneError: there are faults, and it does not go on
  void settle(bool goes_on, Warnings& warnings) const;

 private:
  std::vector<SceneError> faults_;  ///< each text once
};

}  // namespace relief
