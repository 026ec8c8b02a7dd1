// Stages that ask Embree: closest hits and shadows of a whole queue.
#pragma once

#include <cstdint>

#include "integrator/accel.h"
#include "kernel/globals.h"
#include "kernel/state/path_state.h"

namespace relief {

/// What the rays of a worker did in displaced meshes.
struct DisplacementWork {
  TraversalCounters total;
  std::uint32_t most_steps = 0;  ///< bounds and texels, of any single ray
};

/// Finds the closest hit of every path in the queue and sorts the paths by what comes next.
/// Writes the hit columns, and to the film the steps of camera rays. Order within each output queue is that of the input.
/// @param coherent         camera rays in batch order: traced in packets of eight
/// @param surface_kernel   kernel index of each material
/// @param surfaces         kNumSurfaceKernels queues
/// @param displacement     what these rays did is added to it
void intersect_closest(const KernelGlobals& g,
                       const Accel& accel,
                       PathState& state,
                       const QueueView& queue,
                       bool coherent,
                       const std::uint8_t* surface_kernel,
                       QueueView* surfaces,
                       QueueView& lights,
                       QueueView& background,
                       DisplacementWork& displacement);

/// Completes a path's hit on an instance: what moves is put where it is at the path's time, displaced hits get their position and
/// normal.
/// @pre  the columns hit_object, hit_triangle, hit_t, hit_u and hit_v are as Embree gave them
/// @param Ng_x  of the hit, as Embree gave it
void path_resolve_hit(const KernelGlobals& g, const Accel& accel, PathState& state, std::uint32_t path, float Ng_x);

/// Where shadow rays start.
enum class ShadowStart : std::uint8_t { kAtHit, kInMedium };

/// Traces every waiting shadow ray.
/// @param start         at the hits of their paths, or before these
/// @param visibility    one entry a ray: share of light that passes
/// @param displacement  what these rays did is added to it
void intersect_shadow(const KernelGlobals& g,
                      const Accel& accel,
                      const PathState& state,
                      const ShadowQueue& shadow,
                      ShadowStart start,
                      Vec3f* visibility,
                      DisplacementWork& displacement);

/// Embree filter of surfaces that let shadow rays through in part; its context is made by intersect_shadow.
void shadow_filter(const RTCFilterFunctionNArguments* arguments);

}  // namespace relief
