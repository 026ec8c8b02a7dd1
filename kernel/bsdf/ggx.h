// Isotropic GGX microfacets with height-correlated Smith masking: distribution, reflection lobe. Everything that shines
// (metal, dielectric, coat, glass) is built on this file.
//
// Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces" [W]; Heitz 2014, "Understanding the
// Masking-Shadowing Function" [H]; Heitz 2018, "Sampling the GGX Distribution of Visible Normals".
#pragma once

#include "kernel/bsdf/fresnel.h"
#include "kernel/sample/warp.h"

namespace relief {

/// Below this a lobe is treated as a perfect mirror (roughness 0.0316): its half width is 0.06°, finer than a pixel,
/// and light sampling would be left with peaks of 3·10⁵.
inline constexpr float kDeltaAlpha = 1e-3f;

/// Directions closer to the surface than this scatter nothing; keeps every quotient by a cosine finite.
inline constexpr float kMinCosine = 1e-6f;

/// Density of microfacet normals per unit of projected area.
/// @param h  along the normal, any length: summing two unit vectors needs no normalisation. h.z >= 0
/// @source   [W] Eq. 33, with sine and cosine in place of the tangent, so that small alpha keeps its digits
RELIEF_KERNEL float ggx_D(Vec3f h, float alpha)
{
  const float a2 = alpha * alpha;
  return a2 * kInvPi * sqr(length_squared(h) / (h.x * h.x + h.y * h.y + a2 * h.z * h.z));
}

/// √(z² + alpha²(1 − z²)): z times √(1 + alpha² tan²), finite at the horizon.
RELIEF_KERNEL float ggx_stretched_length(float z, float alpha)
{
  return __builtin_sqrtf(z * z + alpha * alpha * (1.0f - z * z));
}

/// Smith's Λ: microfacet area hidden from w per area seen.
/// @param z  |cosine|, > 0
/// @source   [H] Eq. 72
RELIEF_KERNEL float ggx_lambda(float z, float alpha)
{
  // (length / z − 1) / 2 without its cancellation, which left smooth surfaces only the first digit.
  return 0.5f * alpha * alpha * (1.0f - z * z) / (z * (z + ggx_stretched_length(z, alpha)));
}

/// Share of the microfacets visible from wo that wi does not see: 1 − G2 / G1(wo), [H] Eq. 99 and Eq. 43.
/// @param lambda_o, lambda_i  ggx_lambda of both
RELIEF_KERNEL float ggx_hidden_share(float lambda_o, float lambda_i) { return lambda_i / (1.0f + lambda_o + lambda_i); }

/// Reflection by microfacets that are perfect mirrors; times a Fresnel term at `cos_d` it is a lobe.
struct GgxReflection {
  float f = 0;      ///< D·G2 / (4 cos cos)
  float pdf = 0;    ///< solid angle of wi under ggx_reflection_sample
  float cos_d = 1;  ///< cosine between either direction and the microfacet
};

/// @param wo, wi  unit, z > 0
/// @param alpha   >= kDeltaAlpha
RELIEF_KERNEL GgxReflection ggx_reflection_eval(Vec3f wo, Vec3f wi, float alpha)
{
  const Vec3f h = wo + wi;
  const float h_squared = length_squared(h);
  const float D = ggx_D(h, alpha);
  const float o_length = ggx_stretched_length(wo.z, alpha);
  const float i_length = ggx_stretched_length(wi.z, alpha);
  GgxReflection r;
  // G2 and G1 over the cosines, simplified: no division can be 0 / 0 at the horizon.
  r.f = 0.5f * D / (wo.z * i_length + wi.z * o_length);
  r.pdf = 0.5f * D / (wo.z + o_length);
  r.cos_d = min(1.0f, 0.5f * __builtin_sqrtf(h_squared));
  return r;
}

/// @return unit; z <= 0 is a ray lost among the microfacets
RELIEF_KERNEL Vec3f ggx_reflection_sample(Vec3f wo, float alpha, Vec2f u)
{
  const Vec3f wm = warp_ggx_visible_normal(wo, alpha, u);
  return 2.0f * dot(wo, wm) * wm - wo;
}

}  // namespace relief
