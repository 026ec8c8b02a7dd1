// Refraction alone through rough surfaces, by GGX or Beckmann: what Cycles' Refraction node does. There is no Fresnel
// term, except that what is totally reflected is lost.
//
// Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces" [W].
#pragma once

#include "kernel/bsdf/beckmann.h"
#include "kernel/bsdf/dielectric.h"
#include "kernel/bsdf/mixture_traits.h"

namespace relief {

/// eta is index transmitted / index incident, seen from wo (Cycles' `ior`, inverted by it on back faces).
struct MicrofacetRefraction {
  static constexpr MixtureTraits kTraits{.sides = LobeSides::kTransmit,
                                         .is_diffuse = false,
                                         .is_microfacet = true,
                                         .fading = LobeFading::kNever};
  float alpha = 1;
  float eta = 1.45f;  ///< not matched (dielectric_is_matched)
  bool is_beckmann = false;
  SmithMasking masking = SmithMasking::kSeparable;
  /// Also light pairs of directions that no microfacet connects, as if their half vector's mirror image did: Cycles
  /// 3.4 and 4.3 do for light that they sample. It adds energy (0.25 of a sun that it cannot refract, at wo.z 0.2).
  bool lights_unconnected = false;
};

/// f of radiance over the square of the index, in which a furnace is closed; times transmission_scale for photons.
/// @param wo, wi  unit; wo.z > 0
/// @param pdf     solid angle of wi under microfacet_refraction_sample; 0 where it is not connected
/// @source        [W] Eq. 16, 17 and 21 without (1 − F)
RELIEF_KERNEL float microfacet_refraction_eval(const MicrofacetRefraction& lobe, Vec3f wo, Vec3f wi, float* pdf)
{
  *pdf = 0.0f;
  if (!(wi.z < 0.0f)) return 0.0f;
  Vec3f h = wo + lobe.eta * wi;
  if (lobe.eta > 1.0f) h = -h;
  const float inv_length = 1.0f / length(h);
  float cos_o = dot(wo, h) * inv_length;
  float cos_i = -dot(wi, h) * inv_length;
  const bool is_connected = h.z > 0.0f && cos_o > 0.0f && cos_i > 0.0f;
  if (!is_connected) {
    if (!lobe.lights_unconnected) return 0.0f;
    cos_o = __builtin_fabsf(cos_o);
    cos_i = __builtin_fabsf(cos_i);
  }
  const AnisotropicAlpha a{lobe.alpha, lobe.alpha};
  const Vec3f below = -wi;
  float D, lambda_o, lambda_i, one_plus_lambda_pdf;
  if (lobe.is_beckmann) {
    D = beckmann_D(a, h);
    const float tan_o = beckmann_alpha_tan(a, wo);
    lambda_o = beckmann_lambda(tan_o);
    lambda_i = beckmann_lambda(beckmann_alpha_tan(a, below));
    one_plus_lambda_pdf = beckmann_exact_one_plus_lambda(tan_o);
  } else {
    D = ggx_D(h, lobe.alpha);
    lambda_o = ggx_lambda(wo.z, lobe.alpha);
    lambda_i = ggx_lambda(below.z, lobe.alpha);
    one_plus_lambda_pdf = 1.0f + lambda_o;
  }
  const float masking =
      lobe.masking == SmithMasking::kSeparable ? (1.0f + lambda_o) * (1.0f + lambda_i) : 1.0f + lambda_o + lambda_i;
  const float common = D * cos_o * cos_i * sqr(lobe.eta * inv_length) / wo.z;
  *pdf = is_connected ? common / one_plus_lambda_pdf : 0.0f;
  return common / (below.z * masking);
}

/// @return unit; zero at total reflection, z >= 0 where the microfacets lose the ray
RELIEF_KERNEL Vec3f microfacet_refraction_sample(const MicrofacetRefraction& lobe, Vec3f wo, Vec2f u)
{
  const Vec3f wm = lobe.is_beckmann ? beckmann_visible_normal({lobe.alpha, lobe.alpha}, wo, u)
                                    : warp_ggx_visible_normal(wo, lobe.alpha, u);
  const float cos_o = min(1.0f, dot(wo, wm));
  if (!(cos_o > 0.0f)) return {};
  const float cos_t = refracted_cosine(cos_o, lobe.eta);
  if (!(cos_t > 0.0f)) return {};
  return normalize(refract(wo, wm, cos_o, cos_t, lobe.eta));
}

template <TransportMode kMode>
RELIEF_KERNEL BsdfEval
lobe_eval(const MicrofacetRefraction& lobe, const LobeHit& hit, const BsdfTables&, Vec3f wi, bool)
{
  BsdfEval e;
  e.f = splat3(microfacet_refraction_eval(lobe, hit.wo, wi, &e.pdf) * transmission_scale<kMode>(lobe.eta));
  return e;
}

/// What a clear pane sends on.
template <TransportMode kMode>
RELIEF_KERNEL LobeSample lobe_sample_pane(const MicrofacetRefraction& lobe, Vec3f wo)
{
  const float eta = lobe.eta;
  const float cos_t = refracted_cosine(wo.z, eta);
  if (!(cos_t > 0.0f)) return {};
  const Vec3f wi = dielectric_is_matched(eta) ? -wo : normalize(Vec3f{-wo.x / eta, -wo.y / eta, -cos_t});
  LobeSample s = lobe_sample_delta(wi, splat3(transmission_scale<kMode>(eta)));
  s.eta = eta;
  return s;
}

template <TransportMode kMode>
RELIEF_KERNEL LobeSample lobe_sample(const MicrofacetRefraction& lobe, const LobeHit& hit, float, Vec2f u)
{
  if (hit.is_delta) return lobe_sample_pane<kMode>(lobe, hit.wo);
  LobeSample s = lobe_sample_glossy(microfacet_refraction_sample(lobe, hit.wo, u), true, sqr(hit.roughness));
  s.eta = lobe.eta;
  return s;
}

RELIEF_KERNEL bool lobe_widen(MicrofacetRefraction& lobe, float, float blur)
{
  if (dielectric_is_matched(lobe.eta)) return false;
  lobe.alpha = max(lobe.alpha, blur);
  return true;
}

}  // namespace relief
