// Camera as plain data; perspective.h and friends generate rays from it.
#pragma once

#include "kernel/math/affine.h"

namespace relief {

enum class Projection : std::uint8_t { kPerspective, kOrthographic };

/// A camera looks along its local −Z, +Y up, +X right (glTF).
struct Camera {
  Projection projection = Projection::kPerspective;
  Affine3 world_from_camera;
  /// Half size of the image window: perspective: on the plane z = −1 (tan of half the field of view);
  /// orthographic: metres. x = y · aspect of the rendered image.
  float half_width = 0.5f, half_height = 0.5f;
  /// Window shift as a fraction of the whole window's width and height; +x moves the view right, +y up.
  float shift_x = 0, shift_y = 0;
  float aperture_radius = 0;                   ///< lens radius, metres; 0: pinhole
  float focus_distance = 1;                    ///< metres along −Z
  float clip_start = 0, clip_end = kInfinity;  ///< metres along −Z
};

}  // namespace relief
