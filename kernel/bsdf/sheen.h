// Sheen of KHR_materials_sheen: the Charlie distribution of fibres with its fitted masking term.
//
// Estevez and Kulla 2017, "Production Friendly Microfacet Sheen BRDF".
#pragma once

#include "kernel/sample/warp.h"

namespace relief {

/// Fibres smoother than this scatter next to nothing but a spike at grazing angles; lower roughness counts as this.
inline constexpr float kSheenMinRoughness = 0.07f;

RELIEF_KERNEL float sheen_alpha(float roughness) { return sqr(max(roughness, kSheenMinRoughness)); }

/// Logarithm of Λ for cos <= ½, a fit in the cosine whose coefficients blend between alpha 1 and 0.
/// @source Estevez and Kulla 2017, table of coefficients
RELIEF_KERNEL float sheen_log_lambda(float cos_theta, float alpha)
{
  const float t = sqr(1.0f - alpha);
  const float a = lerp(t, 21.5473f, 25.3245f);
  const float b = lerp(t, 3.82987f, 3.32435f);
  const float c = lerp(t, 0.19823f, 0.16801f);
  const float d = lerp(t, -1.97760f, -1.27393f);
  const float e = lerp(t, -4.32054f, -4.85967f);
  return a / (1.0f + b * std::pow(cos_theta, c)) + d * cos_theta + e;
}

/// Masking of the fibres.
/// @param cos_theta  in (0, 1]; rounding may have put it just above
RELIEF_KERNEL float sheen_lambda(float cos_theta, float alpha)
{
  // The fit is for grazing angles and is continued by point symmetry of its logarithm.
  const float log_lambda =
      cos_theta < 0.5f ? sheen_log_lambda(cos_theta, alpha)
                       : 2.0f * sheen_log_lambda(0.5f, alpha) - sheen_log_lambda(max(0.0f, 1.0f - cos_theta), alpha);
  return std::exp(log_lambda);
}

/// Density of fibre normals. @param sin_h  sine of the half vector
RELIEF_KERNEL float sheen_D(float sin_h, float alpha)
{
  const float inv_alpha = 1.0f / alpha;
  return (2.0f + inv_alpha) * std::pow(sin_h, inv_alpha) * (0.5f * kInvPi);
}

/// Sine between the half vector and the normal.
RELIEF_KERNEL float sheen_half_sine(Vec3f wo, Vec3f wi)
{
  const Vec3f h = wo + wi;
  return min(1.0f, __builtin_sqrtf((h.x * h.x + h.y * h.y) / length_squared(h)));
}

/// f before the sheen colour, as published: at low roughness and grazing angles its albedo exceeds one
/// (SheenAlbedo::bound).
/// @param wo, wi  unit, z > 0
RELIEF_KERNEL float sheen_eval(Vec3f wo, Vec3f wi, float roughness)
{
  const float alpha = sheen_alpha(roughness);
  const float lambda = sheen_lambda(wo.z, alpha) + sheen_lambda(wi.z, alpha);
  return sheen_D(sheen_half_sine(wo, wi), alpha) / (4.0f * (1.0f + lambda) * wo.z * wi.z);
}

/// The lobe is broad and bright at the horizon, so that a uniform hemisphere fits it better than a cosine.
RELIEF_KERNEL Vec3f sheen_sample(Vec2f u) { return warp_hemisphere(u); }
/// @return solid angle
RELIEF_KERNEL float sheen_pdf(Vec3f wi) { return wi.z > 0.0f ? warp_hemisphere_pdf() : 0.0f; }

}  // namespace relief
