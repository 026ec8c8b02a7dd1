// Stages that ask Embree: closest hits and shadows of a whole queue.
#pragma once

#include <cstdint>

#include "integrator/accel.h"
#include "kernel/globals.h"
#include "kernel/state/path_state.h"

namespace relief {

/// Finds the closest hit of every path in the queue and sorts the paths by what comes next.
/// Writes the hit columns. Order within each output queue is that of the input.
/// @param coherent         camera rays in batch order: traced in packets of eight
/// @param surface_kernel   kernel index of each material
/// @param surfaces         kNumSurfaceKernels queues
/// @param displacement     counts are added to it
void intersect_closest(const KernelGlobals& g,
                       const Accel& accel,
                       const PathStateView& state,
                       const QueueView& queue,
                       bool coherent,
                       const std::uint8_t* surface_kernel,
                       QueueView* surfaces,
                       QueueView& lights,
                       QueueView& background,
                       TraversalCounters& displacement);

/// Traces every waiting shadow ray.
/// @param visibility    one entry a ray: share of light that passes
/// @param displacement  counts are added to it
void intersect_shadow(const KernelGlobals& g,
                      const Accel& accel,
                      const ShadowQueueView& shadow,
                      float* visibility,
                      TraversalCounters& displacement);

/// Embree filter of surfaces that let shadow rays through in part; its context is made by intersect_shadow.
void shadow_filter(const RTCFilterFunctionNArguments* arguments);

}  // namespace relief
