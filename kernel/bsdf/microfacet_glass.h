// Solid glass: what microfacets reflect and refract, chosen between by their reflectance.
#pragma once

#include "kernel/bsdf/microfacet_refraction.h"

namespace relief {

struct MicrofacetGlass {
  static constexpr MixtureTraits kTraits{.sides = LobeSides::kBoth,
                                         .is_diffuse = false,
                                         .is_microfacet = true,
                                         .fading = LobeFading::kNever};
  float alpha = 0;
  bool is_beckmann = false;
  Vec3f reflection_tint{1, 1, 1}, transmission_tint{1, 1, 1};
};

/// @param through  whether wi is refracted
template <TransportMode kMode>
[[gnu::noinline]] RELIEF_KERNEL BsdfEval
lobe_eval(const MicrofacetGlass& glass, const LobeHit& hit, const BsdfTables&, Vec3f wi, bool through)
{
  const float eta = hit.fresnel.eta;
  float pdf = 0.0f;
  if (!through) {
    const float cos_d = half_angle_cosine(hit.wo, wi);
    const AnisotropicAlpha alpha{glass.alpha, glass.alpha};
    const float f = glass.is_beckmann ? beckmann_eval({alpha, SmithMasking::kCorrelated}, hit.wo, wi, &pdf)
                                      : ggx_anisotropic_eval({alpha, SmithMasking::kCorrelated}, hit.wo, wi, &pdf);
    const Vec3f F = mixture_fresnel(hit.fresnel, cos_d);
    return {glass.reflection_tint * F * f, reflected_chance(hit.fresnel, F, cos_d) * pdf};
  }
  const MicrofacetRefraction refraction{glass.alpha, eta, glass.is_beckmann, SmithMasking::kCorrelated, false};
  const float f = microfacet_refraction_eval(refraction, hit.wo, wi, &pdf);
  const Vec3f h = hit.wo + eta * wi;
  const float cos_o = min(1.0f, __builtin_fabsf(dot(hit.wo, h)) / length(h));
  const Vec3f F = mixture_fresnel(hit.fresnel, cos_o);
  return {glass.transmission_tint * max(splat3(1.0f) - F, Vec3f{}) * (f * transmission_scale<kMode>(eta)),
          (1.0f - reflected_chance(hit.fresnel, F, cos_o)) * pdf};
}

/// Rough or smooth. @param u_branch  [0, 1): between reflection and refraction
template <TransportMode kMode>
[[gnu::noinline]] RELIEF_KERNEL LobeSample
lobe_sample(const MicrofacetGlass& glass, const LobeHit& hit, float u_branch, Vec2f u)
{
  const float eta = hit.fresnel.eta;
  const Vec3f wo = hit.wo;
  const AnisotropicAlpha alpha{glass.alpha, glass.alpha};
  const Vec3f wm = hit.is_delta        ? Vec3f{0, 0, 1}
                   : glass.is_beckmann ? beckmann_visible_normal(alpha, wo, u)
                                       : ggx_anisotropic_visible_normal(alpha, wo, u);
  const float cos_o = min(1.0f, dot(wo, wm));
  if (!(cos_o > 0.0f)) return {};
  const Vec3f F = mixture_fresnel(hit.fresnel, cos_o);
  const float chance = reflected_chance(hit.fresnel, F, cos_o);
  const bool reflects = u_branch < chance;
  Vec3f wi;
  if (reflects) {
    wi = 2.0f * cos_o * wm - wo;
  } else if (dielectric_is_matched(eta)) {
    wi = -wo;
  } else {
    wi = normalize(refract(wo, wm, cos_o, refracted_cosine(cos_o, eta), eta));
  }
  LobeSample s;
  if (!hit.is_delta) {
    s = lobe_sample_glossy(wi, !reflects, glass.alpha);
  } else if (reflects) {
    s = lobe_sample_delta(wi, glass.reflection_tint * F, chance);
  } else {
    const Vec3f through = max(splat3(1.0f) - F, Vec3f{}) * transmission_scale<kMode>(eta);
    s = lobe_sample_delta(wi, glass.transmission_tint * through, 1.0f - chance);
  }
  if (!reflects) s.eta = eta;
  return s;
}

RELIEF_KERNEL bool lobe_widen(MicrofacetGlass& glass, float eta, float blur)
{
  if (dielectric_is_matched(eta)) return false;
  glass.alpha = max(glass.alpha, blur);
  return true;
}

}  // namespace relief
