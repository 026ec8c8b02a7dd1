// A wall too thin to refract: KHR_materials_transmission without a volume. Light passes as if the reflection were
// mirrored to the other side, blurred by the same microfacets and tinted by the base colour; the reflection itself is
// the ordinary GGX lobe.
#pragma once

#include "kernel/bsdf/ggx.h"

namespace relief {

/// Directions on the far side correspond to reflections mirrored through the wall.
RELIEF_KERNEL Vec3f thin_wall_mirror(Vec3f w) { return {w.x, w.y, -w.z}; }

/// @param wi     unit, z < 0
/// @param alpha  >= kDeltaAlpha
RELIEF_KERNEL GgxReflection thin_wall_eval(Vec3f wo, Vec3f wi, float alpha)
{
  return ggx_reflection_eval(wo, thin_wall_mirror(wi), alpha);
}

/// @return unit; z >= 0 is a ray lost among the microfacets
RELIEF_KERNEL Vec3f thin_wall_sample(Vec3f wo, float alpha, Vec2f u)
{
  return thin_wall_mirror(ggx_reflection_sample(wo, alpha, u));
}

}  // namespace relief
