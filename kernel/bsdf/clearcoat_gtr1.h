// Clearcoat of Blender's Principled shader up to 3.6: Disney's long-tailed GTR1 distribution, masked as if its roughness
// were 0.25.
//
// Burley 2012, "Physically Based Shading at Disney" [B].
#pragma once

#include "kernel/bsdf/ggx_anisotropic.h"

namespace relief {

/// Index of the clearcoat, whose reflectance seen from above is 0.04 (fresnel_interpolated).
inline constexpr float kGtr1Ior = 1.5f;
/// What Cycles multiplies the clearcoat's strength by.
inline constexpr float kGtr1Strength = 0.25f;

struct ClearcoatGtr1 {
  float alpha = 1e-3f;  ///< roughness², >= kDeltaAlpha; 1 and more is uniform
};

/// Density of microfacet normals per unit of projected area.
/// @param sine2  squared sine of the microfacet normal
/// @source       [B] Eq. 4 with gamma 1
RELIEF_KERNEL float gtr1_D(float alpha, float sine2)
{
  if (alpha >= 0.999f) return kInvPi;
  const float a2 = alpha * alpha;
  // 1 + (a² − 1) cos² by the sine, which keeps its digits at the peak.
  return (a2 - 1.0f) * kInvPi / (std::log(a2) * (a2 + (1.0f - a2) * sine2));
}

/// f with reflectance 1: times Fresnel, kGtr1Strength and the clearcoat's strength it is the lobe. The masking does not
/// belong to the distribution, so that the albedo before those factors reaches 3.2 at grazing angles.
///
/// Cycles samples it as if it were GGX of the same roughness and divides by the density that its formula would have, so
/// that with light found by sampling the lobe alone (the background without importance, other surfaces) it shows GGX's
/// shape instead.
/// @param wo, wi  unit; wo.z > 0
/// @param pdf     solid angle of wi under clearcoat_gtr1_sample
RELIEF_KERNEL float clearcoat_gtr1_eval(const ClearcoatGtr1& lobe, Vec3f wo, Vec3f wi, float* pdf)
{
  *pdf = 0.0f;
  if (!(wi.z > 0.0f)) return 0.0f;
  const Vec3f h = wo + wi;
  const float h_squared = length_squared(h);
  const float D = gtr1_D(lobe.alpha, (h.x * h.x + h.y * h.y) / h_squared);
  const float inv_length = 1.0f / __builtin_sqrtf(h_squared);
  *pdf = 0.5f * D * h.z * inv_length * inv_length;  // D cos / (4 cos_d), cos_d half of the length
  constexpr float kMaskingAlpha = 0.25f;
  return D / ((wo.z + ggx_stretched_length(wo.z, kMaskingAlpha)) * (wi.z + ggx_stretched_length(wi.z, kMaskingAlpha)));
}

/// @return unit; zero vector or z <= 0 is lost
/// @source [B] Eq. 5
RELIEF_KERNEL Vec3f clearcoat_gtr1_sample(const ClearcoatGtr1& lobe, Vec3f wo, Vec2f u)
{
  const float a2 = sqr(lobe.alpha);
  const float sine2 = lobe.alpha >= 0.999f ? u.y : (std::exp(std::log(a2) * (1.0f - u.y)) - a2) / (1.0f - a2);
  const SinCos phi = sin_cos_turn(u.x);
  const float sine = safe_sqrt(sine2);
  const Vec3f h = {sine * phi.cos, sine * phi.sin, safe_sqrt(1.0f - sine2)};
  const float cos_d = dot(wo, h);
  if (!(cos_d > 0.0f)) return {};
  return 2.0f * cos_d * h - wo;
}

}  // namespace relief
