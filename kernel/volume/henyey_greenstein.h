// The phase function of Henyey and Greenstein: how likely a direction is in which a medium scatters light.
//
// Source: Henyey and Greenstein 1941, "Diffuse Radiation in the Galaxy".
#pragma once

#include "kernel/math/vec.h"
#include "kernel/sample/warp.h"

namespace relief {

/// Anisotropies nearer to ±1 than this are taken for it, as in Cycles: a delta function cannot be sampled.
inline constexpr float kMostAnisotropy = 1.0f - 1e-3f;

/// Below this it is taken for even, as in Cycles: inverting the distribution divides by it.
inline constexpr float kLeastAnisotropy = 1e-3f;

/// @param cosine  between where light came from and where it goes, both along its way
/// @param g       mean of that, within ±kMostAnisotropy
/// @return        per steradian
RELIEF_KERNEL float henyey_greenstein_pdf(float cosine, float g)
{
  if (__builtin_fabsf(g) < kLeastAnisotropy) return warp_sphere_pdf();
  // 1 + g² − 2 g cosine, of which near a narrow peak that would lose most digits.
  const float size = __builtin_fabsf(g), towards = g < 0.0f ? -cosine : cosine;
  const float square = sqr(1.0f - size) + 2.0f * size * max(1.0f - towards, 0.0f);
  return (1.0f - g * g) / (square * __builtin_sqrtf(square)) * (0.25f * kInvPi);
}

/// @param D  unit, along the light's way
/// @return   unit, where it goes
RELIEF_KERNEL Vec3f henyey_greenstein_sample(Vec3f D, float g, Vec2f u)
{
  float cosine = 1.0f - 2.0f * u.x;
  if (!(__builtin_fabsf(g) < kLeastAnisotropy)) {
    const float k = (1.0f - g * g) / (1.0f - g + 2.0f * g * u.x);
    cosine = clamp((1.0f + g * g - k * k) / (2.0f * g), -1.0f, 1.0f);
  }
  return normalize(from_local(frame_from_normal(D), direction_from_z(cosine, u.y)));
}

/// The point that henyey_greenstein_sample makes a direction of.
RELIEF_KERNEL Vec2f henyey_greenstein_inverse(Vec3f D, float g, Vec3f wi)
{
  const Vec3f local = to_local(frame_from_normal(D), wi);
  if (__builtin_fabsf(g) < kLeastAnisotropy) return {0.5f * (1.0f - local.z), turn_from_direction(local)};
  const float k = __builtin_sqrtf(max(1.0f + g * g - 2.0f * g * local.z, 1e-20f));
  return {((1.0f - g * g) / k - (1.0f - g)) / (2.0f * g), turn_from_direction(local)};
}

}  // namespace relief
