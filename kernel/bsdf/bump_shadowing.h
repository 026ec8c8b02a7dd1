// How lamps fade that a bent normal sees and the surface's own does not.
#pragma once

#include "kernel/math/vec.h"

namespace relief {

/// Darkens diffuse light where a bent normal sees a lamp that the surface does not, smoothly.
/// @source Chiang, Li, Burley 2019, "Taming the Shadow Terminator", Eq. 2 and 3
RELIEF_KERNEL float bump_shadowing(Vec3f N, Vec3f wi)
{
  const float side = wi.z < 0.0f ? -1.0f : 1.0f;
  const float below = wi.z * N.z;
  const float g = below != 0.0f ? side * dot(N, wi) / (side * below) : 0.0f;
  if (g >= 1.0f) return 1.0f;
  return g > 0.0f ? g + g * g * (1.0f - g) : 0.0f;
}

/// The same as if the bumps were microfacets, as wide as the normal leans: since 5.0.
/// @source Conty Estevez, Lecocq, Stein 2019, "A Microfacet-Based Shadowing Function to Solve the Bump Terminator Problem"
RELIEF_KERNEL float bump_shadowing_ggx(Vec3f N, Vec3f wi)
{
  const float cos_N = __builtin_fabsf(N.z), cos_i = __builtin_fabsf(dot(N, wi));
  if (!(cos_i >= 1e-6f)) return cos_N < 1.0f ? 0.0f : 1.0f;
  const auto tan_squared = [](float cosine) { return max(1.0f / sqr(cosine) - 1.0f, 0.0f); };
  const float alpha_squared = min(0.125f * tan_squared(cos_N), 1.0f);
  return 2.0f / (1.0f + __builtin_sqrtf(1.0f + alpha_squared * tan_squared(cos_i)));
}

}  // namespace relief
