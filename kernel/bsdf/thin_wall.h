// A wall too thin to refract: KHR_materials_transmission without a volume. Light passes as if the reflection were
// mirrored to the other side, blurred by the same microfacets and tinted by the base colour; the reflection itself is
// the ordinary GGX lobe. One lobe passes between the microfacets once, the other after several bounces among them.
#pragma once

#include "kernel/bsdf/base_interface.h"
#include "kernel/bsdf/lobe.h"

namespace relief {

/// Directions on the far side correspond to reflections mirrored through the wall.
RELIEF_KERNEL Vec3f thin_wall_mirror(Vec3f w) { return {w.x, w.y, -w.z}; }

/// @param wi     unit, z < 0
/// @param alpha  >= kDeltaAlpha
RELIEF_KERNEL GgxReflection thin_wall_eval(Vec3f wo, Vec3f wi, float alpha)
{
  return ggx_reflection_eval(wo, thin_wall_mirror(wi), alpha);
}

/// @return unit; z >= 0 is a ray lost among the microfacets
RELIEF_KERNEL Vec3f thin_wall_sample(Vec3f wo, float alpha, Vec2f u)
{
  return thin_wall_mirror(ggx_reflection_sample(wo, alpha, u));
}

struct ThinLobe : Lobe {
  static constexpr unsigned kFeatures = kFeatureTransmission;
  static constexpr LobeSides kSides = LobeSides::kTransmit;
  static constexpr LobeSharpness kSharpness = LobeSharpness::kBase;
  static constexpr bool kIsLayer = false;
  float weight = 0;  ///< share of the surface
};

/// What the reflection leaves of light that passes.
/// @param cos_d  between the direction and the microfacet
RELIEF_KERNEL Vec3f thin_wall_transmittance(const ThinLobe& lobe, const BaseInterface& base, float cos_d)
{
  const float F = fresnel_schlick(splat3(base.under_F0), base.under_F90, cos_d).x;
  return base.transmission_color * (lobe.weight * (1.0f - F));
}

template <TransportMode kMode>
RELIEF_KERNEL BsdfEval lobe_eval(const ThinLobe& lobe, const BaseInterface& base, const BsdfTables&, Vec3f wi)
{
  if (base.ggx.mirror) return {};
  const GgxReflection r = thin_wall_eval(base.wo, wi, base.ggx.alpha);
  return {thin_wall_transmittance(lobe, base, r.cos_d) * r.f, r.pdf};
}

template <TransportMode kMode>
RELIEF_KERNEL LobeSample lobe_sample(const ThinLobe& lobe, const BaseInterface& base, const BsdfTables&, float, Vec2f u)
{
  if (base.ggx.mirror) return lobe_sample_delta(-base.wo, thin_wall_transmittance(lobe, base, base.wo.z));
  return lobe_sample_glossy(thin_wall_sample(base.wo, base.ggx.alpha, u), true, base.ggx.alpha);
}

struct ThinMultipleLobe : Lobe {
  static constexpr unsigned kFeatures = kFeatureTransmission;
  static constexpr LobeSides kSides = LobeSides::kTransmit;
  static constexpr LobeSharpness kSharpness = LobeSharpness::kNever;
  static constexpr bool kIsLayer = false;
  Vec3f f{};  ///< over 1 − E(wi)
};

template <TransportMode kMode>
RELIEF_KERNEL BsdfEval
lobe_eval(const ThinMultipleLobe& lobe, const BaseInterface& base, const BsdfTables& tables, Vec3f wi)
{
  return {lobe.f * ggx_albedo(tables, base.ggx, -wi.z).lost, multiple_scattering_pdf(base.scattering, -wi.z)};
}

template <TransportMode kMode>
RELIEF_KERNEL LobeSample
lobe_sample(const ThinMultipleLobe&, const BaseInterface& base, const BsdfTables&, float, Vec2f u)
{
  return lobe_sample_diffuse(thin_wall_mirror(multiple_scattering_sample(base.scattering, u)), true);
}

}  // namespace relief
