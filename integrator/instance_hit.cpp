#include "integrator/instance_hit.h"

#include "integrator/ray_surface.h"

namespace relief {

namespace {

/// A hit's geometric normal on the front side, world space.
Vec3f hit_normal(const SceneContext& context, const RTCRayHit& ray, unsigned object)
{
  const InstanceView instance = context.motion.instance_at(context.instances[object], ray.ray.time);
  if ((instance.flags & kDisplaced) != 0) {
    const DisplacedPoint point = context.displacements.resolve(object, instance, ray.hit.primID,
                                                               {ray.hit.u, ray.hit.v, ray.hit.Ng_x, ray.ray.time});
    return transform_normal(instance.object_from_world, as_normal(point.Ng));
  }
  const MeshView mesh =
      context.motion.mesh_at(instance, context.meshes[static_cast<std::size_t>(instance.mesh_index)], ray.ray.time);
  return surface_hit_of_ray(mesh, instance, ray).Ng;
}

}  // namespace

std::optional<InstanceHit>
instance_hit_next(const SceneContext& context, Vec3f P, Vec3f D, float time, float from, float to, std::uint32_t mask)
{
  EmbreeContext embree;
  embree_context_init(embree, false);
  RTCRayHit ray{};
  ray.ray.org_x = P.x, ray.ray.org_y = P.y, ray.ray.org_z = P.z;
  ray.ray.dir_x = D.x, ray.ray.dir_y = D.y, ray.ray.dir_z = D.z;
  ray.ray.tnear = from;
  ray.ray.tfar = to;
  ray.ray.time = time;
  ray.ray.mask = mask;
  ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  context.accel->intersect(embree, ray);
  if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
  const unsigned object = met_object(ray);
  return InstanceHit{ray.ray.tfar, object,
                     object < context.instances.size() ? hit_normal(context, ray, object) : Vec3f{}};
}

}  // namespace relief
