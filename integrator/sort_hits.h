// From what Embree says of a path's ray to the stage that goes on with the path.
#pragma once

#include <cstdint>

#include "integrator/accel.h"
#include "integrator/stages.h"
#include "kernel/globals.h"
#include "kernel/state/path_state.h"

namespace relief {

/// Queues a path that has met an instance.
inline void hit_queue_push(HitQueues& queues, const InstanceView& instance, std::uint32_t path)
{
  queue_push(queues.surfaces[queues.surface_kernel[instance.material_index]], path);
}

/// Completes a path's hit on an instance: what moves is put where it is at the path's time, displaced hits get their position and
/// normal.
/// @pre  the columns hit_object, hit_triangle, hit_t, hit_u and hit_v are as Embree gave them
/// @param Ng_x  of the hit, as Embree gave it
void path_resolve_hit(const KernelGlobals& g, const Accel& accel, PathState& state, std::uint32_t path, float Ng_x);

/// Puts a path into the queue of the stage that its hit asks for, and completes the hit.
/// @pre  as path_resolve_hit, but for the column hit_object
/// @param object  an instance, a light, or RTC_INVALID_GEOMETRY_ID
void sort_hit(const KernelGlobals& g,
              const Accel& accel,
              PathState& state,
              std::uint32_t path,
              unsigned object,
              float Ng_x,
              HitQueues& queues);

}  // namespace relief
