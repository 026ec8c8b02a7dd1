// The sheen of sheen.h as a lobe, bounded by its energy table.
#pragma once

#include "kernel/bsdf/base_interface.h"
#include "kernel/bsdf/lobe.h"

namespace relief {

struct SheenLobe : Lobe {
  static constexpr unsigned kFeatures = kFeatureLayers;
  static constexpr LobeSides kSides = LobeSides::kReflect;
  static constexpr LobeSharpness kSharpness = LobeSharpness::kNever;
  static constexpr bool kIsLayer = true;
  Vec3f color{};       ///< sheen colour times what the coat leaves of it
  float strength = 0;  ///< the sheen colour's largest channel, whether it scatters towards wo or not
  float roughness = 0;
  TableCoordinate table;
  SheenAlbedo albedo_o;  ///< towards wo
};

template <TransportMode kMode>
RELIEF_KERNEL BsdfEval lobe_eval(const SheenLobe& sheen, const BaseInterface& base, const BsdfTables& tables, Vec3f wi)
{
  const float bound = min(sheen.albedo_o.bound, sheen_albedo(tables, sheen.table, wi.z).bound);
  return {sheen.color * (bound * sheen_eval(base.wo, wi, sheen.roughness)), sheen_pdf(wi)};
}

template <TransportMode kMode>
RELIEF_KERNEL LobeSample lobe_sample(const SheenLobe&, const BaseInterface&, const BsdfTables&, float, Vec2f u)
{
  return lobe_sample_diffuse(sheen_sample(u), false);
}

}  // namespace relief
