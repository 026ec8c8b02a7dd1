#include "integrator/intersect_stage.h"

#include "displacement/path_facets.h"
#include "integrator/path_lod.h"
#include "integrator/ray_surface.h"
#include "kernel/stage/path_access.h"

namespace relief {

namespace {

std::uint32_t kind_of(const PathState& state, std::uint32_t path)
{
  if (state.bounces[path] == 0) return kRayCamera;
  const std::uint32_t flags = state.flags[path];
  return (flags & kPathPhoton) != 0 ? kRayBounce : path_ray_kind(flags) << kRayBounceShift;
}

std::uint32_t mask_of(const KernelGlobals& g, const PathState& state, std::uint32_t path)
{
  const std::uint32_t kind = kind_of(state, path);
  return g.catchers_alone ? kind << kRayCatchersShift : kind;
}

void intersect_packet(const KernelGlobals& g,
                      const Accel& accel,
                      PathState& state,
                      const std::uint32_t* paths,
                      EmbreeContext& context,
                      HitQueues& queues,
                      DisplacementWork& displacement)
{
  RTCRayHit8 packet;
  for (int i = 0; i < 8; ++i) {
    const std::uint32_t path = paths[i];
    packet.ray.org_x[i] = state.O.x[path];
    packet.ray.org_y[i] = state.O.y[path];
    packet.ray.org_z[i] = state.O.z[path];
    packet.ray.dir_x[i] = state.D.x[path];
    packet.ray.dir_y[i] = state.D.y[path];
    packet.ray.dir_z[i] = state.D.z[path];
    packet.ray.tnear[i] = state.t_min[path];
    packet.ray.tfar[i] = state.t_max[path];
    packet.ray.time[i] = path_time(state, path);
    packet.ray.mask[i] = kRayCamera;
    packet.ray.id[i] = static_cast<unsigned>(i);
    packet.ray.flags[i] = 0;
    packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
  LodCone cones[8];
  if (accel.displacements().has_levels()) {
    for (int i = 0; i < 8; ++i)
      cones[i] = PathLod(state, paths[i]).cone(state.cone_width[paths[i]], state.cone_spread[paths[i]]);
    context.cones = cones;
  }
  accel.intersect8(context, packet);
  for (int i = 0; i < 8; ++i) {
    const std::uint32_t path = paths[i];
    state.hit_t[path] = packet.ray.tfar[i];
    state.hit_u[path] = packet.hit.u[i];
    state.hit_v[path] = packet.hit.v[i];
    state.hit_triangle[path] = packet.hit.primID[i];
    const unsigned instance = packet.hit.instID[0][i];
    const unsigned object = instance != RTC_INVALID_GEOMETRY_ID ? instance : packet.hit.geomID[i];
    if (context.steps != nullptr) {
      film_add_displacement_steps(g.film, state.pixel[path], context.steps[i]);
      note_steps(context.steps[i], displacement);
    }
    sort_hit(g, accel, state, path, object, packet.hit.Ng_x[i], queues);
  }
}

}  // namespace

unsigned curve_left(const KernelGlobals& g, const PathState& state, std::uint32_t path)
{
  const std::uint32_t object = state.hit_object[path];
  if (object >= g.num_instances || (g.instances[object].flags & kCurves) == 0) return 0;
  const MeshView& mesh = g.meshes[g.instances[object].mesh_index];
  const std::uint32_t segment = state.hit_triangle[path];
  RELIEF_ASSERT(segment < mesh.num_triangles);
  return curve_name(object, segment, g.instances[object].flags, mesh.triangles);
}

void intersect_closest(const KernelGlobals& g,
                       const Accel& accel,
                       PathState& state,
                       const QueueView& queue,
                       bool coherent,
                       HitQueues& queues,
                       DisplacementWork& displacement)
{
  EmbreeContext context;
  embree_context_init(context, coherent);
  context.displacement = &displacement.total;
  const bool has_levels = accel.displacements().has_levels();
  std::uint32_t steps[8] = {};
  context.texels = accel.displacements().texels();
  if (accel.displacements().size() > 0) context.steps = steps;
  std::uint32_t i = 0;
  if (coherent) {
    for (; i + 8 <= queue.size; i += 8) {
      intersect_packet(g, accel, state, queue.paths + i, context, queues, displacement);
    }
  }
  for (; i < queue.size; ++i) {
    const std::uint32_t path = queue.paths[i];
    if (state.facets != nullptr && !coherent && path_stays_among_facets(g, accel.displacements(), state, path)) {
      hit_queue_push(queues, path_instance(g, state, path), path);
      continue;
    }
    RTCRayHit ray;
    ray.ray.org_x = state.O.x[path];
    ray.ray.org_y = state.O.y[path];
    ray.ray.org_z = state.O.z[path];
    ray.ray.dir_x = state.D.x[path];
    ray.ray.dir_y = state.D.y[path];
    ray.ray.dir_z = state.D.z[path];
    ray.ray.tnear = state.t_min[path];
    ray.ray.tfar = state.t_max[path];
    ray.ray.time = path_time(state, path);
    ray.ray.mask = mask_of(g, state, path);
    ray.ray.id = 0;
    ray.ray.flags = 0;
    ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    LodCone cone;
    if (has_levels) {
      cone = PathLod(state, path).cone(state.cone_width[path], state.cone_spread[path]);
      context.cones = &cone;
    }
    if (accel.has_curves() && state.bounces[path] != 0 && (state.flags[path] & kPathScattered) == 0) {
      ray.ray.flags = curve_left(g, state, path);
    }
    accel.intersect(context, ray);
    if (context.steps != nullptr) {
      if (state.bounces[path] == 0) film_add_displacement_steps(g.film, state.pixel[path], steps[0]);
      note_steps(steps[0], displacement);
    }
    state.hit_t[path] = ray.ray.tfar;
    state.hit_u[path] = ray.hit.u;
    state.hit_v[path] = ray.hit.v;
    state.hit_triangle[path] = ray.hit.primID;
    const unsigned object = met_object(ray);
    sort_hit(g, accel, state, path, object, ray.hit.Ng_x, queues);
  }
}

}  // namespace relief
