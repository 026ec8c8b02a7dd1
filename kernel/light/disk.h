// Disk light: an ellipse of constant radiance, sampled uniformly by area, except from close by, where the density by area
// has a sharp peak: there it is sampled as the rectangle around it, uniformly in solid angle, and points outside are lost.
#pragma once

#include "kernel/light/rectangle.h"
#include "kernel/sample/warp.h"

namespace relief {

struct DiskLight : PlateLight {};

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

/// Of a disk with a spread, the radius about a point's foot on its plane in which it shines to the point, where that is less than
/// the disk itself; metres.
/// @return  0: all of the disk is sampled
RELIEF_KERNEL float disk_light_reach(const Light& light, Vec3f P)
{
  if (!(light.spread_tan > 0.0f)) return 0.0f;
  const float reach = light_spread_reach(light, P);
  return kPi * sqr(reach) < light.area ? reach : 0.0f;
}

/// @param u  [0, 1)²
/// @return   along the half axes, uniform by area
RELIEF_KERNEL Vec2f light_coordinates(DiskLight, Vec2f u) { return warp_disk(u); }

/// Samples what shines to a point, by area; what of that is beyond the disk is lost.
/// @param reach  of disk_light_reach
/// @param u      [0, 1)²
[[gnu::noinline]] RELIEF_KERNEL LightSample disk_light_sample_near(const Light& light, Vec3f P, float reach, Vec2f u)
{
  const Vec2f q = reach * warp_disk(u);
  const Frame frame = frame_from_normal(light.axis);
  const Vec3f point = P - dot(P - light.P, light.axis) * light.axis + frame.s * q.x + frame.t * q.y;
  if (const Vec2f at = plate_light_meet(light, P, point - P).q; !(sqr(at.x) + sqr(at.y) <= 1.0f)) return {};
  LightSample sample = light_point_sample(light, P, point);
  sample.pdf *= light.area / (kPi * sqr(reach));
  return sample;
}

/// @param u  [0, 1)²
RELIEF_KERNEL LightSample light_sample(DiskLight kind, const Light& light, Vec3f P, Vec2f u)
{
  if (!light_faces(light, P)) return {};
  if (const float reach = disk_light_reach(light, P); reach > 0.0f) return disk_light_sample_near(light, P, reach, u);
  const float omega = disk_light_solid_angle(light, P);
  if (!(omega > 0.0f)) {
    const Vec2f q = light_coordinates(kind, u);
    return light_point_sample(light, P, light.P + light.edge_u * q.x + light.edge_v * q.y);
  }
  const Vec3f point = rectangle_light_point(light, P, omega, u);
  const Vec3f q = point - light.P;
  const float x = dot(q, light.edge_u) / length_squared(light.edge_u);
  const float y = dot(q, light.edge_v) / length_squared(light.edge_v);
  if (!(sqr(x) + sqr(y) <= 1.0f)) return {};
  return light_point_sample(light, P, point, 1.0f / omega);
}

/// Solid-angle density of light_sample.
RELIEF_KERNEL float light_pdf(DiskLight, const Light& light, Vec3f P, Vec3f wi, float distance)
{
  if (!light_faces(light, P)) return 0.0f;
  if (const float reach = disk_light_reach(light, P); reach > 0.0f) {
    return light_area_pdf(light, wi, distance) * (light.area / (kPi * sqr(reach)));
  }
  const float omega = disk_light_solid_angle(light, P);
  return omega > 0.0f ? 1.0f / omega : light_area_pdf(light, wi, distance);
}

/// Of an ellipse c + a·cos φ + b·sin φ along an axis: √(a² + b²).
RELIEF_KERNEL Vec3f light_half_extent(DiskLight, const Light& light)
{
  const Vec3f u = light.edge_u, v = light.edge_v;
  return {__builtin_sqrtf(sqr(u.x) + sqr(v.x)), __builtin_sqrtf(sqr(u.y) + sqr(v.y)),
          __builtin_sqrtf(sqr(u.z) + sqr(v.z))};
}

/// @return negative: a ray misses it
RELIEF_KERNEL float light_distance(DiskLight, const Light& light, Vec3f O, Vec3f D)
{
  const PlateHit hit = plate_light_meet(light, O, D);
  return sqr(hit.q.x) + sqr(hit.q.y) <= 1.0f ? hit.t : -1.0f;
}

RELIEF_KERNEL LightRay light_emit(DiskLight kind, const Light& light, Vec2f u, Vec2f v, bool back)
{
  return plate_light_emit(light, light_coordinates(kind, u), v, back);
}

}  // namespace relief
