// Camera as plain data; camera_ray.h makes rays of it.
#pragma once

#include "kernel/camera/panorama.h"
#include "kernel/math/affine.h"

namespace relief {

enum class Projection : std::uint8_t { kPerspective, kOrthographic, kPanoramic };

/// A camera looks along its local −Z, +Y up, +X right (glTF).
struct Camera {
  Projection projection = Projection::kPerspective;
  Affine3 world_from_camera;
  /// Half size of the image window: perspective: on the plane z = −1 (tan of half the field of view);
  /// orthographic: metres. x = y · aspect of the rendered image. Panoramic: of the whole panorama, which is stretched into it.
  float half_width = 0.5f, half_height = 0.5f;
  /// Window shift as a fraction of the whole window's width and height; +x moves the view right, +y up.
  float shift_x = 0, shift_y = 0;
  float pixel_aspect = 1;                      ///< width of a pixel over its height, in the window
  float aperture_radius = 0;                   ///< lens radius, metres, to the corners if it has some; 0: pinhole
  int aperture_blades = 0;                     ///< corners of the opening; round with fewer than three
  float aperture_rotation = 0;                 ///< radians, counter-clockwise as seen from behind the camera
  float aperture_ratio = 1;                    ///< height of the opening over its width, which alone follows
  float focus_distance = 1;                    ///< metres along −Z; panoramic: along the ray
  float clip_start = 0, clip_end = kInfinity;  ///< likewise
  Panorama panorama;                           ///< of a panoramic camera
};

/// Gives a camera the width of window that an image of so many pixels asks for, or pixels of the shape that the window does.
RELIEF_KERNEL void camera_fit(Camera& camera, float width, float height)
{
  if (camera.projection == Projection::kPanoramic) {
    camera.pixel_aspect = camera.half_width * height / (camera.half_height * width);
    return;
  }
  camera.half_width = camera.half_height * width / height * camera.pixel_aspect;
}

/// The axes by which value graphs tell a panoramic camera's space, which are not those of other cameras.
/// @return  as of Camera::world_from_camera: the graph's X, Y and −Z, which are ahead, left and up; of mirror balls right, back and up
RELIEF_KERNEL Affine3 camera_graph_frame(const Camera& camera)
{
  const Affine3& m = camera.world_from_camera;
  if (camera.projection != Projection::kPanoramic) return m;
  if (camera.panorama.kind == PanoramaKind::kMirrorBall) return {m.x, m.z, -m.y, m.p};
  return {-m.z, -m.x, -m.y, m.p};
}

/// A point of that space among the camera's own axes.
RELIEF_KERNEL Vec3f camera_from_graph_frame(const Camera& camera, Vec3f p)
{
  if (camera.projection != Projection::kPanoramic) return p;
  if (camera.panorama.kind == PanoramaKind::kMirrorBall) return {p.x, -p.z, p.y};
  return {-p.y, -p.z, -p.x};
}

}  // namespace relief
