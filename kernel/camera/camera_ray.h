// Camera rays for all projections: perspective and orthographic, thin lens, shift, clipping.
#pragma once

#include "kernel/camera/camera.h"

namespace relief {

struct CameraRay {
  Vec3f O, D;          ///< world; D is unit
  float t_min, t_max;  ///< clipping, as distances along D
  float cone_width;    ///< width of the pixel's cone at O, metres
  float cone_spread;   ///< growth of the width, radians (tan of the full angle a pixel subtends)
};

/// Ray through a point of the image.
/// @param film_x, film_y  position in the full image, 0…1, from the left and from the top
/// @param world_from_camera  at the ray's time
/// @param lens            point of the aperture, see aperture_sample
/// @param pixel_size      side of a square as large as a pixel, as a fraction of the image's height
/// @source thin lens: pbrt-v4 §5.2.3
RELIEF_KERNEL CameraRay camera_ray_make(const Camera& camera,
                                        const Affine3& world_from_camera,
                                        float film_x,
                                        float film_y,
                                        Vec2f lens,
                                        float pixel_size)
{
  const float x = (2.0f * (film_x + camera.shift_x) - 1.0f) * camera.half_width;
  const float y = (1.0f - 2.0f * (film_y - camera.shift_y)) * camera.half_height;
  const bool perspective = camera.projection == Projection::kPerspective;
  Vec3f origin = perspective ? Vec3f{} : Vec3f{x, y, 0};
  Vec3f direction = perspective ? Vec3f{x, y, -1} : Vec3f{0, 0, -1};
  if (camera.aperture_radius > 0.0f) {
    const Vec3f in_focus = origin + direction * camera.focus_distance;
    origin = origin + Vec3f{lens.x * camera.aperture_radius, lens.y * camera.aperture_radius, 0};
    direction = in_focus - origin;
  }
  direction = normalize(direction);

  CameraRay ray;
  ray.O = transform_point(world_from_camera, origin);
  const Vec3f world_direction = transform_vector(world_from_camera, direction);
  const float stretch = length(world_direction);
  ray.D = world_direction / stretch;
  // −z per metre of the ray turns depths along the axis into distances along D.
  const float depth_per_distance = -direction.z / stretch;
  ray.t_min = camera.clip_start / depth_per_distance;
  ray.t_max = camera.clip_end / depth_per_distance;
  const float pixel_in_window = 2.0f * camera.half_height * pixel_size;
  ray.cone_width = perspective ? 0.0f : pixel_in_window;
  ray.cone_spread = perspective ? pixel_in_window : 0.0f;
  return ray;
}

}  // namespace relief
