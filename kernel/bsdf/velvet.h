// Ashikhmin's velvet, as Cycles up to 3.6 has it.
//
// Ashikhmin, Premože and Shirley 2000, "A Microfacet-Based BRDF Generator" [A].
#pragma once

#include "kernel/bsdf/mixture_traits.h"
#include "kernel/sample/warp.h"

namespace relief {

struct Velvet {
  static constexpr MixtureTraits kTraits{.fading = LobeFading::kBefore52};
  float inv_sigma2 = 1;
};

RELIEF_KERNEL Velvet velvet_make(float sigma) { return {1.0f / sqr(max(sigma, 0.01f))}; }

/// f before the colour. Dark seen from above, bright at grazing angles, where the albedo comes close to 1.
/// @param wo, wi  unit; wo.z > 0
/// @param pdf     solid angle of wi under velvet_sample
/// @source        [A]: inverted Gaussian of the tangent, with the masking of V grooves. Cycles leaves out the constant
///                term and divides by the cosine of wo alone before it multiplies by that of wi
RELIEF_KERNEL float velvet_eval(const Velvet& lobe, Vec3f wo, Vec3f wi, float* pdf)
{
  *pdf = 0.0f;
  if (!(wi.z > 0.0f)) return 0.0f;
  *pdf = warp_hemisphere_pdf();
  const Vec3f h = wo + wi;
  const float inv_squared = 1.0f / length_squared(h);
  const float sine2 = (h.x * h.x + h.y * h.y) * inv_squared;
  const float cos_d = 0.5f * length(h);
  // No fibre points along the normal, where the exponent has no limit; cosines of 1 − 1e-5 and more are there.
  if (!(sine2 > 2e-5f && cos_d > 1e-5f)) return 0.0f;
  const float cos2 = h.z * h.z * inv_squared;
  const float D = std::exp(-lobe.inv_sigma2 * cos2 / sine2) * lobe.inv_sigma2 * kInvPi / sqr(sine2);
  const float ratio = max(h.z * __builtin_sqrtf(inv_squared) / cos_d, 1e-5f);
  const float G = min(1.0f, 2.0f * ratio * min(wo.z, wi.z));
  return 0.25f * D * G / (wo.z * wi.z);
}

RELIEF_KERNEL Vec3f velvet_sample(const Velvet&, Vec3f, Vec2f u) { return warp_hemisphere(u); }

template <TransportMode>
RELIEF_KERNEL BsdfEval lobe_eval(const Velvet& lobe, const LobeHit& hit, const BsdfTables&, Vec3f wi, bool)
{
  BsdfEval e;
  e.f = splat3(velvet_eval(lobe, hit.wo, wi, &e.pdf));
  return e;
}

template <TransportMode>
RELIEF_KERNEL LobeSample lobe_sample(const Velvet& lobe, const LobeHit& hit, float, Vec2f u)
{
  return lobe_sample_diffuse(velvet_sample(lobe, hit.wo, u), false);
}

}  // namespace relief
