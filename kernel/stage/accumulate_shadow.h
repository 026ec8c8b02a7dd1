// Stage: a shadow ray has been traced.
#pragma once

#include "kernel/globals.h"
#include "kernel/stage/path_access.h"

namespace relief {

/// Adds what next-event estimation found, if the light is seen, or how open the surroundings are.
/// @param visibility  share of the light that passes
RELIEF_KERNEL void accumulate_shadow(const KernelGlobals& g,
                                     PathState& state,
                                     const ShadowQueue& shadow,
                                     std::uint32_t ray,
                                     Vec3f visibility)
{
  const std::uint32_t path = shadow.path[ray];
  if (shadow.scatterings[ray] == kAmbientRay) {
    film_add_ambient(g.film, state.pixel[path], (visibility.x + visibility.y + visibility.z) / 3.0f);
    return;
  }
  const Vec3f gain = shadow.gain[ray] * visibility;
  const std::uint32_t scatterings = shadow.scatterings[ray];
  if (__builtin_expect((scatterings & kMediumRay) != 0, 0) && !state.media[path].is_lit_first) {
    MediumState& m = state.media[path];
    m.lit = m.lit + radiance_clamped(gain, g.clamp_direct);
  }
  constexpr int kShift = kShadowLightGroupShift;
  path_add_radiance(g, state, path, static_cast<int>(scatterings & kShadowScatterings), gain,
                    scatterings >> kShift & kMostLightGroups,
                    (scatterings & kMediumRay) != 0 ? LightRoad::kAskedInMedium : LightRoad::kAsked);
}

}  // namespace relief
