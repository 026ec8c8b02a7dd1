// Solid glass: a boundary between two media with exact Fresnel, smooth or rough, with what its microfacets scatter more than
// once (dielectric.h has the mathematics).
#pragma once

#include "kernel/bsdf/base_interface.h"
#include "kernel/bsdf/diffuse.h"
#include "kernel/bsdf/lobe.h"
#include "kernel/sample/choice.h"

namespace relief {

struct GlassLobe : Lobe {
  static constexpr unsigned kFeatures = kFeatureTransmission;
  static constexpr LobeSides kSides = LobeSides::kBoth;
  static constexpr LobeSharpness kSharpness = LobeSharpness::kBase;
  static constexpr bool kIsLayer = false;
  float weight = 0;  ///< share of the surface
  float eta = 1;     ///< index of the far side / index of wo's side
  bool delta = false;
  GlassCoordinate table;
  float lost = 0;                     ///< 1 − E(wo): to be scattered again
  float reflect_share = 1;            ///< of what is scattered again
  float mean_near = 0, mean_far = 0;  ///< mean of 1 − E on wo's side and on the other
};

template <TransportMode kMode>
RELIEF_KERNEL BsdfEval lobe_eval(const GlassLobe& glass, const BaseInterface& base, const BsdfTables& tables, Vec3f wi)
{
  if (glass.delta) return {};
  const bool crosses = wi.z < 0.0f;
  const DielectricEval single = dielectric_eval(base.wo, wi, base.ggx.alpha, glass.eta);
  float f = single.f;
  float pdf = single.pdf;
  if (glass.lost > 0.0f) {
    const float cos_i = __builtin_fabsf(wi.z);
    const int side = crosses ? 1 - glass.table.side : glass.table.side;
    const float lost_i = glass_lost(tables, glass.table, side, cos_i);
    const float share = crosses ? 1.0f - glass.reflect_share : glass.reflect_share;
    f += share * diffuse_coupled_eval(splat3(1.0f), glass.lost, lost_i, crosses ? glass.mean_far : glass.mean_near).x;
    pdf = lerp(glass.lost, pdf, share * multiple_scattering_pdf(base.scattering, cos_i));
  }
  f *= glass.weight;
  return {crosses ? base.transmission_color * (f * transmission_scale<kMode>(glass.eta)) : splat3(f), pdf};
}

/// Smooth or index-matched glass.
template <TransportMode kMode>
RELIEF_KERNEL LobeSample glass_sample_delta(const GlassLobe& glass, const BaseInterface& base, float u_branch)
{
  const Vec3f wo = base.wo;
  const float eta = glass.eta;
  if (dielectric_is_matched(eta)) return lobe_sample_delta(-wo, base.transmission_color * glass.weight);
  const float cos_t = refracted_cosine(wo.z, eta);
  const float F = fresnel_dielectric(wo.z, cos_t, eta);
  if (u_branch < F) return lobe_sample_delta({-wo.x, -wo.y, wo.z}, splat3(glass.weight * F), F);
  const float scale = (1.0f - F) * glass.weight * transmission_scale<kMode>(eta);
  LobeSample s =
      lobe_sample_delta(normalize({-wo.x / eta, -wo.y / eta, -cos_t}), base.transmission_color * scale, 1.0f - F);
  s.eta = eta;
  return s;
}

template <TransportMode kMode>
RELIEF_KERNEL LobeSample
lobe_sample(const GlassLobe& glass, const BaseInterface& base, const BsdfTables&, float u_branch, Vec2f u)
{
  if (glass.delta) return glass_sample_delta<kMode>(glass, base, u_branch);
  LobeSample s;
  if (u.x < glass.lost) {
    const bool crosses = u_branch >= glass.reflect_share;
    const Vec3f wi = multiple_scattering_sample(base.scattering, {choice_rest(u.x, glass.lost), u.y});
    s = lobe_sample_diffuse(crosses ? -wi : wi, crosses);
  } else {
    const Vec2f rest{choice_rest(u.x - glass.lost, 1.0f - glass.lost), u.y};
    const DielectricSample d = dielectric_sample(base.wo, base.ggx.alpha, glass.eta, u_branch, rest);
    s = lobe_sample_glossy(d.wi, d.transmitted, base.ggx.alpha);
  }
  if ((s.bits & kLobeTransmit) != 0) s.eta = glass.eta;
  return s;
}

}  // namespace relief
