// Reflection by the base's microfacets: metal, dielectric and thin wall together, because Schlick's Fresnel is linear in F0
// and F90.
#pragma once

#include "kernel/bsdf/base_interface.h"
#include "kernel/bsdf/lobe.h"

namespace relief {

struct SpecularLobe : Lobe {
  static constexpr unsigned kFeatures = 0;
  static constexpr LobeSides kSides = LobeSides::kReflect;
  static constexpr LobeSharpness kSharpness = LobeSharpness::kBase;
  static constexpr bool kIsLayer = false;
  Vec3f F0{};  ///< weighted by the shares of what reflects
  float F90 = 0;
};

template <TransportMode kMode>
RELIEF_KERNEL BsdfEval lobe_eval(const SpecularLobe& lobe, const BaseInterface& base, const BsdfTables&, Vec3f wi)
{
  if (base.ggx.mirror) return {};
  const GgxReflection r = ggx_reflection_eval(base.wo, wi, base.ggx.alpha);
  return {fresnel_schlick(lobe.F0, lobe.F90, r.cos_d) * r.f, r.pdf};
}

template <TransportMode kMode>
RELIEF_KERNEL LobeSample
lobe_sample(const SpecularLobe& lobe, const BaseInterface& base, const BsdfTables&, float, Vec2f u)
{
  if (base.ggx.mirror) {
    return lobe_sample_delta({-base.wo.x, -base.wo.y, base.wo.z}, fresnel_schlick(lobe.F0, lobe.F90, base.wo.z));
  }
  return lobe_sample_glossy(ggx_reflection_sample(base.wo, base.ggx.alpha, u), false, base.ggx.alpha);
}

}  // namespace relief
