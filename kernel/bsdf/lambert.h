// Lambert's lobe in mixtures.
#pragma once

#include "kernel/bsdf/diffuse.h"
#include "kernel/bsdf/mixture_traits.h"

namespace relief {

/// Has no parameters but its colour.
struct Lambert {
  static constexpr MixtureTraits kTraits{};
};

template <TransportMode>
RELIEF_KERNEL BsdfEval lobe_eval(const Lambert&, const LobeHit&, const BsdfTables&, Vec3f wi, bool)
{
  return {splat3(kInvPi), diffuse_pdf(wi)};
}

template <TransportMode>
RELIEF_KERNEL LobeSample lobe_sample(const Lambert&, const LobeHit&, float, Vec2f u)
{
  return lobe_sample_diffuse(diffuse_sample(u), false);
}

}  // namespace relief
