#include "integrator/sort_hits.h"

#include "displacement/path_facets.h"
#include "integrator/path_lod.h"
#include "kernel/stage/path_access.h"

namespace relief {

void path_resolve_hit(const KernelGlobals& g, const Accel& accel, PathState& state, std::uint32_t path, float Ng_x)
{
  const std::uint32_t object = state.hit_object[path];
  const InstanceView& centre = g.instances[object];
  if ((centre.flags & (kMoves | kDeforms)) != 0) {
    const float time = path_time(state, path);
    state.motion.instances[path] = accel.motion().instance_at(centre, time);
    if ((centre.flags & kDeforms) != 0) {
      state.motion.meshes[path] = accel.motion().mesh_at(centre, g.meshes[centre.mesh_index], time);
    }
  }
  const InstanceView& instance = path_instance(g, state, path);
  if ((instance.flags & kDisplaced) != 0) {
    const DisplacedPoint point =
        accel.displacements().resolve(object, instance, state.hit_triangle[path],
                                      {state.hit_u[path], state.hit_v[path], Ng_x, path_time(state, path)});
    state.hit_triangle[path] = point.triangle;
    state.hit_u[path] = point.u;
    state.hit_v[path] = point.v;
    state.hit_P[path] = point.P;
    state.hit_Ng[path] = point.Ng;
    state.hit_Ns[path] = point.Ns;
    state.hit_leave[path] = point.leave;
    state.hit_lift[path] = point.lift;
    state.hit_width[path] = point.width < kInfinity ? point.width / PathLod(state, path).factor : kInfinity;
    if (state.facets != nullptr) path_enter_facets(accel.displacements(), state, path, instance, point.level);
  }
}

void sort_hit(const KernelGlobals& g,
              const Accel& accel,
              PathState& state,
              std::uint32_t path,
              unsigned object,
              float Ng_x,
              HitQueues& queues)
{
  if (object == RTC_INVALID_GEOMETRY_ID) {
    // What hides surfaces behind a camera's far end hides no media.
    state.hit_t[path] = kInfinity;
    queue_push(queues.background, path);
    return;
  }
  state.hit_object[path] = object;
  if (state.facets != nullptr) state.facets[path].height = 0.0f;
  if (object >= g.num_instances) {
    queue_push(queues.lights, path);
    return;
  }
  path_resolve_hit(g, accel, state, path, Ng_x);
  hit_queue_push(queues, g.instances[object], path);
}

}  // namespace relief
