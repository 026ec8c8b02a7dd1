// The stage that asks Embree for the closest hits of a whole queue.
#pragma once

#include <cstdint>

#include "integrator/accel.h"
#include "integrator/displacement_work.h"
#include "integrator/sort_hits.h"
#include "kernel/globals.h"
#include "kernel/state/path_state.h"

namespace relief {

/// Finds the closest hit of every path in the queue and sorts the paths by what comes next.
/// Writes the hit columns, and to the film the steps of camera rays. Order within each output queue is that of the input.
/// @param coherent      camera rays in batch order: traced in packets of eight
/// @param queues        get the paths
/// @param displacement  what these rays did is added to it
void intersect_closest(const KernelGlobals& g,
                       const Accel& accel,
                       PathState& state,
                       const QueueView& queue,
                       bool coherent,
                       HitQueues& queues,
                       DisplacementWork& displacement);

/// RTCRay::flags of a ray that leaves a path's last hit: the curve that it starts from.
unsigned curve_left(const KernelGlobals& g, const PathState& state, std::uint32_t path);

}  // namespace relief
