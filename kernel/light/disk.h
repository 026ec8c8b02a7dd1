// Disk light: an ellipse of constant radiance, sampled uniformly by area, except from close by, where the density by area
// has a sharp peak: there it is sampled as the rectangle around it, uniformly in solid angle, and points outside are lost.
#pragma once

#include "kernel/light/rectangle.h"
#include "kernel/sample/warp.h"

namespace relief {

/// From this solid angle (sr) of the rectangle around the disk on, losing a share 1 − π/4 of the samples costs less than the
/// peak: on the axis of a circle it is where the density by area varies by a factor of about three.
inline constexpr float kDiskRectangleSolidAngle = 2.0f;

/// Solid angle of the rectangle around the disk, where that is to be sampled.
/// @return steradians; 0: sample by area
RELIEF_KERNEL float disk_light_solid_angle(const Light& light, Vec3f P)
{
  const float omega = rectangle_light_solid_angle(light, P, light.area * (4.0f * kInvPi));
  return omega >= kDiskRectangleSolidAngle ? omega : 0.0f;
}

/// @param u  [0, 1)²
RELIEF_KERNEL LightSample disk_light_sample(const Light& light, Vec3f P, Vec2f u)
{
  if (!light_faces(light, P)) return {};
  const float omega = disk_light_solid_angle(light, P);
  if (!(omega > 0.0f)) {
    const Vec2f q = warp_disk(u);
    return light_point_sample(light, P, light.P + light.edge_u * q.x + light.edge_v * q.y);
  }
  const Vec3f point = rectangle_light_point(light, P, omega, u);
  const Vec3f q = point - light.P;
  const float x = dot(q, light.edge_u) / length_squared(light.edge_u);
  const float y = dot(q, light.edge_v) / length_squared(light.edge_v);
  if (!(sqr(x) + sqr(y) <= 1.0f)) return {};
  return light_point_sample(light, P, point, 1.0f / omega);
}

/// Solid-angle density of disk_light_sample.
RELIEF_KERNEL float disk_light_pdf(const Light& light, Vec3f P, Vec3f wi, float distance)
{
  if (!light_faces(light, P)) return 0.0f;
  const float omega = disk_light_solid_angle(light, P);
  return omega > 0.0f ? 1.0f / omega : light_area_pdf(light, wi, distance);
}

}  // namespace relief
