// Ashikhmin and Shirley's anisotropic Phong lobe, as Cycles up to 3.6 has it: without Fresnel.
//
// Ashikhmin and Shirley 2000, "An Anisotropic Phong BRDF Model" [AS].
#pragma once

#include "kernel/bsdf/ggx_anisotropic.h"
#include "kernel/bsdf/mixture_traits.h"

namespace relief {

/// Exponents along x and y, >= 0.
struct AshikhminShirley {
  static constexpr MixtureTraits kTraits{.is_diffuse = false,
                                         .is_microfacet = true,
                                         .has_fresnel = true,
                                         .fading = LobeFading::kNever,
                                         .leaves_below = true};
  float n_x = 0, n_y = 0;
};

/// @source the exponent whose lobe is as wide as Beckmann's of that roughness
RELIEF_KERNEL AshikhminShirley ashikhmin_shirley_make(AnisotropicAlpha alpha)
{
  return {2.0f / sqr(alpha.x) - 2.0f, 2.0f / sqr(alpha.y) - 2.0f};
}

/// The roughness that ashikhmin_shirley_make was given.
RELIEF_KERNEL AnisotropicAlpha ashikhmin_shirley_alpha(const AshikhminShirley& lobe)
{
  return {__builtin_sqrtf(2.0f / (lobe.n_x + 2.0f)), __builtin_sqrtf(2.0f / (lobe.n_y + 2.0f))};
}

/// f with reflectance 1. It is reciprocal. Its albedo is 1 for sharp lobes seen from above, and falls with roughness.
/// @param wo, wi  unit; wo.z > 0
/// @param pdf     solid angle of wi under ashikhmin_shirley_sample
/// @source        [AS] Eq. 4 and 8, F = 1
RELIEF_KERNEL float ashikhmin_shirley_eval(const AshikhminShirley& lobe, Vec3f wo, Vec3f wi, float* pdf)
{
  *pdf = 0.0f;
  if (!(wi.z > 0.0f)) return 0.0f;
  const Vec3f h = wo + wi;
  const float h_squared = length_squared(h);
  const float across2 = h.x * h.x + h.y * h.y;
  const float exponent = across2 > 0.0f ? (lobe.n_x * h.x * h.x + lobe.n_y * h.y * h.y) / across2 : 0.0f;
  // cosⁿ by the sine: next to the normal the cosine has no digits that an exponent of 10⁶ could use.
  const float D = std::exp(0.5f * exponent * std::log1p(-min(across2 / h_squared, 1.0f - 1e-7f)));
  const float norm = __builtin_sqrtf((lobe.n_x + 1.0f) * (lobe.n_y + 1.0f)) * (0.125f * kInvPi);
  const float cos_d = max(0.5f * __builtin_sqrtf(h_squared), 1e-6f);
  *pdf = norm * D / cos_d;
  return *pdf / max(wo.z, wi.z);
}

/// @return unit; z <= 0 is lost
/// @source [AS] Eq. 6 and 9
RELIEF_KERNEL Vec3f ashikhmin_shirley_sample(const AshikhminShirley& lobe, Vec3f wo, Vec2f u)
{
  // atan(√((n_x + 1) / (n_y + 1)) tan φ) in every quadrant: an ellipse.
  const SinCos circle = sin_cos_turn(u.x);
  const float x = __builtin_sqrtf(lobe.n_y + 1.0f) * circle.cos, y = __builtin_sqrtf(lobe.n_x + 1.0f) * circle.sin;
  const float inv_radius = 1.0f / __builtin_sqrtf(x * x + y * y);
  const float cos_phi = x * inv_radius, sin_phi = y * inv_radius;
  const float exponent = lobe.n_x * cos_phi * cos_phi + lobe.n_y * sin_phi * sin_phi;
  const float log_cos2 = 2.0f * std::log(max(1.0f - u.y, 1e-30f)) / (exponent + 1.0f);
  const float sine = __builtin_sqrtf(-std::expm1(log_cos2));
  const Vec3f h = {sine * cos_phi, sine * sin_phi, std::exp(0.5f * log_cos2)};
  const float cos_d = dot(wo, h);
  if (!(cos_d > 0.0f)) return {};
  return 2.0f * cos_d * h - wo;
}

template <TransportMode>
RELIEF_KERNEL BsdfEval lobe_eval(const AshikhminShirley& lobe, const LobeHit& hit, const BsdfTables&, Vec3f wi, bool)
{
  BsdfEval e;
  e.f = splat3(ashikhmin_shirley_eval(lobe, hit.wo, wi, &e.pdf));
  return e;
}

template <TransportMode>
RELIEF_KERNEL LobeSample lobe_sample(const AshikhminShirley& lobe, const LobeHit& hit, float, Vec2f u)
{
  if (hit.is_delta) return lobe_sample_mirror(hit);
  return lobe_sample_glossy(ashikhmin_shirley_sample(lobe, hit.wo, u), false, sqr(hit.roughness));
}

RELIEF_KERNEL bool lobe_widen(AshikhminShirley& lobe, float, float blur)
{
  lobe = ashikhmin_shirley_make(anisotropic_alpha_widened(ashikhmin_shirley_alpha(lobe), blur));
  return true;
}

}  // namespace relief
