// Camera rays for all projections: perspective, orthographic and panoramic, thin lens, shift, clipping.
#pragma once

#include "kernel/camera/camera.h"

namespace relief {

struct CameraRay {
  Vec3f O, D;          ///< world; D is unit
  float t_min, t_max;  ///< clipping, as distances along D; t_max below 0: the lens shows nothing there
  float cone_width;    ///< width of the pixel's cone at O, metres
  float cone_spread;   ///< growth of the width, radians (tan of the full angle a pixel subtends)
};

/// Where a panoramic camera's ray starts on its lens, which is turned towards what the ray looks at.
/// @param lens  see aperture_sample
/// @param D     the camera's space, unit
/// @source      the lens' axes are Cycles': the first leads to what is ahead, of mirror balls to the right
RELIEF_KERNEL Vec3f panoramic_lens_point(PanoramaKind kind, Vec2f lens, Vec3f D)
{
  const bool is_ball = kind == PanoramaKind::kMirrorBall;
  const Vec3f axis = is_ball ? Vec3f{1, 0, 0} : Vec3f{0, 0, -1};
  Vec3f U = axis - dot(axis, D) * D;
  // Straight along the axis no direction is the first.
  constexpr float kLeast = 1e-12f;
  U = normalize(length_squared(U) > kLeast ? U : Vec3f{0, 1, 0} - D.y * D);
  const Vec3f V = is_ball ? cross(U, D) : cross(D, U);
  return lens.x * U + lens.y * V;
}

/// The ray of a panoramic camera, see camera_ray_make.
/// @param x, y             of the panorama, −1…1
/// @param pixel_in_window  side of a square as large as a pixel, there
[[gnu::noinline]] RELIEF_KERNEL CameraRay panoramic_ray_make(const Camera& camera,
                                                             const Affine3& world_from_camera,
                                                             float x,
                                                             float y,
                                                             Vec2f lens,
                                                             float pixel_in_window)
{
  CameraRay ray{{}, {0, 0, -1}, 0, -1, 0, 0};
  const PanoramaPoint point = panorama_point(camera.panorama, x, y);
  if (is_zero(point.D)) return ray;
  Vec3f origin, direction = point.D;
  if (camera.aperture_radius > 0.0f) {
    origin = panoramic_lens_point(camera.panorama.kind, lens, point.D) * camera.aperture_radius;
    direction = normalize(point.D * camera.focus_distance - origin);
  }
  ray.O = transform_point(world_from_camera, origin);
  const Vec3f world_direction = transform_vector(world_from_camera, direction);
  const float stretch = length(world_direction);
  ray.D = world_direction / stretch;
  ray.t_min = camera.clip_start * stretch;
  ray.t_max = camera.clip_end * stretch;
  ray.cone_spread = pixel_in_window * __builtin_sqrtf(point.solid_angle);
  return ray;
}

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
  const float pixel_in_window = 2.0f * camera.half_height * pixel_size;
  if (__builtin_expect(camera.projection == Projection::kPanoramic, 0))
    return panoramic_ray_make(camera, world_from_camera, x, y, lens, pixel_in_window);
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
  ray.cone_width = perspective ? 0.0f : pixel_in_window;
  ray.cone_spread = perspective ? pixel_in_window : 0.0f;
  return ray;
}

}  // namespace relief
