// What a rough reflection scatters more than once, nearly evenly: as MultipleLobe of layered surfaces has it.
#pragma once

#include "kernel/bsdf/base_interface.h"
#include "kernel/bsdf/mixture_traits.h"

namespace relief {

struct GgxMultiple {
  static constexpr MixtureTraits kTraits{.fading = LobeFading::kNever};
  GgxCoordinate ggx;
  MultipleScattering scattering;
  float over_mean = 0;  ///< 1 − E(wo), over π times its mean
};

template <TransportMode>
RELIEF_KERNEL BsdfEval lobe_eval(const GgxMultiple& lobe, const LobeHit&, const BsdfTables& tables, Vec3f wi, bool)
{
  return {splat3(lobe.over_mean * ggx_albedo(tables, lobe.ggx, wi.z).lost),
          multiple_scattering_pdf(lobe.scattering, wi.z)};
}

template <TransportMode>
RELIEF_KERNEL LobeSample lobe_sample(const GgxMultiple& lobe, const LobeHit&, float, Vec2f u)
{
  return lobe_sample_diffuse(multiple_scattering_sample(lobe.scattering, u), false);
}

}  // namespace relief
