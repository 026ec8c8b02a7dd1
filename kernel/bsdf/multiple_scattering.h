// Light that leaves a rough interface on the side it came from, after several bounces among the microfacets: its f is
// 1 − E(wo) times 1 − E(wi).
//
// Kulla and Conty 2017, "Revisiting Physically Based Shading at Imageworks".
#pragma once

#include "kernel/bsdf/base_interface.h"
#include "kernel/bsdf/lobe.h"

namespace relief {

struct MultipleLobe : Lobe {
  static constexpr unsigned kFeatures = kFeatureMetal | kFeatureTransmission;
  static constexpr LobeSides kSides = LobeSides::kReflect;
  static constexpr LobeSharpness kSharpness = LobeSharpness::kNever;
  static constexpr bool kIsLayer = false;
  Vec3f f{};  ///< over 1 − E(wi)
};

template <TransportMode kMode>
RELIEF_KERNEL BsdfEval
lobe_eval(const MultipleLobe& lobe, const BaseInterface& base, const BsdfTables& tables, Vec3f wi)
{
  return {lobe.f * ggx_albedo(tables, base.ggx, wi.z).lost, multiple_scattering_pdf(base.scattering, wi.z)};
}

template <TransportMode kMode>
RELIEF_KERNEL LobeSample lobe_sample(const MultipleLobe&, const BaseInterface& base, const BsdfTables&, float, Vec2f u)
{
  return lobe_sample_diffuse(multiple_scattering_sample(base.scattering, u), false);
}

}  // namespace relief
