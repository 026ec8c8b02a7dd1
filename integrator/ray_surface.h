// The surface that a ray of Embree's met.
#pragma once

#include "displacement/embree.h"
#include "kernel/sample/sobol.h"
#include "kernel/shape/primitive.h"

namespace relief {

/// Name of one of an instance's curves, for RTCRay::flags, which Embree leaves alone: of the curve that a ray starts from. 0 is none's.
/// As curves have two vertices more than points (Mesh in scene/scene.h), the difference of a segment's numbers is that of no other curve;
/// two curves of a scene may share a name by a chance of 2⁻³¹, and one is not met from the other then.
/// @param first_vertex  TriangleIndices::v0 of the segment
inline unsigned curve_name(unsigned instance, unsigned segment, std::uint32_t first_vertex)
{
  return hash_mix_32(instance + 0x9e3779b9u * (first_vertex - segment)) | 1u;
}

/// The same of a mesh's segment, or of a point, which has its number for a name.
inline unsigned curve_name(unsigned instance,
                           unsigned segment,
                           std::uint32_t instance_flags,
                           const TriangleIndices* triangles)
{
  return curve_name(instance, segment, (instance_flags & kPoints) != 0 ? 2 * segment + 1 : triangles[segment].v0);
}

/// Whether a ray meets a curve where Embree asks a filter: not the one that it starts from, and tubes from outside only, both as in
/// Cycles.
/// @param i        number of the ray
/// @param name_of  gives the name of a curve by the numbers of its instance and of its segment
template <class NameOf>
inline bool curve_is_met(const RTCFilterFunctionNArguments* arguments, unsigned i, NameOf&& name_of, bool is_tube)
{
  const RTCHit hit = rtcGetHitFromHitN(arguments->hit, arguments->N, i);
  const RTCRay ray = rtcGetRayFromRayN(arguments->ray, arguments->N, i);
  const unsigned instance = hit.instID[0] != RTC_INVALID_GEOMETRY_ID ? hit.instID[0] : hit.geomID;
  if (ray.flags != 0 && name_of(instance, hit.primID) == ray.flags) return false;
  return !is_tube || ray.dir_x * hit.Ng_x + ray.dir_y * hit.Ng_y + ray.dir_z * hit.Ng_z <= 0.0f;
}

/// @param t  along the ray's direction to where it met it
/// @pre   the instance is not displaced
inline SurfaceHit surface_hit_at(const PrimitivePlace& place, const InstanceView& instance, Vec3f O, Vec3f D, float t)
{
  return primitive_hit(place, instance, O + D * t, normalize(-D));
}

/// @param ray  in the world
inline SurfaceHit surface_hit_of_ray(const MeshView& mesh, const InstanceView& instance, const RTCRayHit& ray)
{
  return surface_hit_at({&mesh, ray.hit.primID, ray.hit.u, ray.hit.v}, instance,
                        {ray.ray.org_x, ray.ray.org_y, ray.ray.org_z}, {ray.ray.dir_x, ray.ray.dir_y, ray.ray.dir_z},
                        ray.ray.tfar);
}

}  // namespace relief
