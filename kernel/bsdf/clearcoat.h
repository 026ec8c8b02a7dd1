// Clearcoat of KHR_materials_clearcoat: a colourless GGX reflection of index 1.5 on top of everything, possibly about a
// normal of its own.
#pragma once

#include "kernel/bsdf/ggx.h"

namespace relief {

inline constexpr float kClearcoatF0 = 0.04f;

/// f and pdf in the *surface's* frame.
/// @param wo_coat, wi_coat  unit, coat's frame; below its horizon there is no reflection
/// @param wi_z              cosine of wi to the surface's own normal, > 0
/// @param alpha             >= kDeltaAlpha
/// @return f before the coat's strength. The integrator multiplies by the surface's cosine; where the coat faces wi
///         less than the surface does, f is scaled to the coat's own cosine, so that a tilted coat never reflects more
///         than it receives
RELIEF_KERNEL GgxReflection clearcoat_eval(Vec3f wo_coat, Vec3f wi_coat, float wi_z, float alpha)
{
  if (!(wo_coat.z > kMinCosine && wi_coat.z > kMinCosine)) return {0, 0, 1};
  GgxReflection r = ggx_reflection_eval(wo_coat, wi_coat, alpha);
  r.f *= (kClearcoatF0 + (1.0f - kClearcoatF0) * schlick_weight(r.cos_d)) * min(1.0f, wi_coat.z / wi_z);
  return r;
}

/// @return unit, coat's frame
RELIEF_KERNEL Vec3f clearcoat_sample(Vec3f wo_coat, float alpha, Vec2f u)
{
  return ggx_reflection_sample(wo_coat, alpha, u);
}

}  // namespace relief
