// Camera as plain data; camera_ray.h makes rays of it.
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
  float pixel_aspect = 1;                      ///< width of a pixel over its height
  float aperture_radius = 0;                   ///< lens radius, metres, to the corners if it has some; 0: pinhole
  int aperture_blades = 0;                     ///< corners of the opening; round with fewer than three
  float aperture_rotation = 0;                 ///< radians, counter-clockwise as seen from behind the camera
  float aperture_ratio = 1;                    ///< height of the opening over its width, which alone follows
  float focus_distance = 1;                    ///< metres along −Z
  float clip_start = 0, clip_end = kInfinity;  ///< metres along −Z
};

/// Gives a camera the width of window that an image of so many pixels asks for.
RELIEF_KERNEL void camera_fit(Camera& camera, float width, float height)
{
  camera.half_width = camera.half_height * width / height * camera.pixel_aspect;
}

}  // namespace relief
