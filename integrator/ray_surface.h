// The surface that a ray of Embree's met.
#pragma once

#include "displacement/embree.h"
#include "kernel/shape/curve_hit.h"

namespace relief {

/// @param t  along the ray's direction to where it met it
/// @pre   the instance is not displaced
inline SurfaceHit surface_hit_at(const MeshView& mesh,
                                 const InstanceView& instance,
                                 std::uint32_t primitive,
                                 float u,
                                 float v,
                                 Vec3f O,
                                 Vec3f D,
                                 float t)
{
  if ((instance.flags & kCurves) == 0) return surface_hit_make(mesh, instance, primitive, u, v);
  return surface_hit_curve(mesh, instance, primitive, u, v, O + D * t, normalize(-D));
}

/// @param ray  in the world
inline SurfaceHit surface_hit_of_ray(const MeshView& mesh, const InstanceView& instance, const RTCRayHit& ray)
{
  return surface_hit_at(mesh, instance, ray.hit.primID, ray.hit.u, ray.hit.v,
                        {ray.ray.org_x, ray.ray.org_y, ray.ray.org_z}, {ray.ray.dir_x, ray.ray.dir_y, ray.ray.dir_z},
                        ray.ray.tfar);
}

}  // namespace relief
