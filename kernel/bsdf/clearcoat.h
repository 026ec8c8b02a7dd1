// Clearcoat of KHR_materials_clearcoat: a colourless GGX reflection of index 1.5 on top of everything, possibly about a
// normal of its own.
#pragma once

#include "kernel/bsdf/base_interface.h"
#include "kernel/bsdf/lobe.h"

namespace relief {

inline constexpr float kClearcoatF0 = 0.04f;

/// f and pdf in the *surface's* frame.
/// @param wo_coat, wi_coat  unit, coat's frame; below its horizon there is no reflection
/// @param wi_z              cosine of wi to the surface's own normal, > 0
/// @param alpha             >= kDeltaAlpha
/// @return f before the coat's strength. The integrator multiplies by the surface's cosine; where the coat faces wi
///         less than the surface does, f is scaled to the coat's own cosine, so that a tilted coat never reflects more
///         than it receives
RELIEF_KERNEL GgxReflection clearcoat_eval(Vec3f wo_coat, Vec3f wi_coat, float wi_z, float alpha)
{
  if (!(wo_coat.z > kMinCosine && wi_coat.z > kMinCosine)) return {0, 0, 1};
  GgxReflection r = ggx_reflection_eval(wo_coat, wi_coat, alpha);
  r.f *= (kClearcoatF0 + (1.0f - kClearcoatF0) * schlick_weight(r.cos_d)) * min(1.0f, wi_coat.z / wi_z);
  return r;
}

/// @return unit, coat's frame
RELIEF_KERNEL Vec3f clearcoat_sample(Vec3f wo_coat, float alpha, Vec2f u)
{
  return ggx_reflection_sample(wo_coat, alpha, u);
}

struct CoatLobe : Lobe {
  static constexpr unsigned kFeatures = kFeatureLayers;
  static constexpr LobeSides kSides = LobeSides::kReflect;
  static constexpr LobeSharpness kSharpness = LobeSharpness::kCoat;
  static constexpr bool kIsLayer = true;
  float strength = 0;  ///< of the coat, whether it reflects towards wo or not
  Frame frame;
  Vec3f wo{};  ///< coat's frame
  GgxCoordinate ggx;
};

/// What a coat leaves for below.
/// @param cos_theta  to the coat's normal
RELIEF_KERNEL float coat_transmits(const CoatLobe& coat, const BsdfTables& tables, float cos_theta)
{
  if (!(cos_theta > kMinCosine)) return 1.0f;
  return 1.0f - coat.strength * ggx_albedo_with(kClearcoatF0, 1.0f, ggx_albedo(tables, coat.ggx, cos_theta));
}

template <TransportMode kMode>
RELIEF_KERNEL BsdfEval lobe_eval(const CoatLobe& coat, const BaseInterface&, const BsdfTables&, Vec3f wi)
{
  if (coat.ggx.mirror) return {};
  const GgxReflection r = clearcoat_eval(coat.wo, to_local(coat.frame, wi), wi.z, coat.ggx.alpha);
  return {splat3(coat.strength * r.f), r.pdf};
}

template <TransportMode kMode>
RELIEF_KERNEL LobeSample lobe_sample(const CoatLobe& coat, const BaseInterface& base, const BsdfTables&, float, Vec2f u)
{
  if (coat.ggx.mirror) {
    const Vec3f wi = 2.0f * coat.wo.z * coat.frame.n - base.wo;
    if (!(wi.z > 0.0f)) return {};
    const float F = kClearcoatF0 + (1.0f - kClearcoatF0) * schlick_weight(coat.wo.z);
    return lobe_sample_delta(wi, splat3(coat.strength * F));
  }
  const Vec3f wi = clearcoat_sample(coat.wo, coat.ggx.alpha, u);
  // Below a tilted coat's horizon can still be above the surface's, where the coat has no density.
  if (!(wi.z > kMinCosine)) return {};
  return lobe_sample_glossy(from_local(coat.frame, wi), false, coat.ggx.alpha);
}

}  // namespace relief
