// The stage that asks Embree which shadow rays of a whole queue reach their lights.
#pragma once

#include <cstdint>

#include "integrator/accel.h"
#include "integrator/displacement_work.h"
#include "kernel/globals.h"
#include "kernel/state/path_state.h"

namespace relief {

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
