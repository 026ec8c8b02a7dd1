// Light that leaves evenly on the far side: Lambert's lobe, upside down.
#pragma once

#include "kernel/bsdf/diffuse.h"
#include "kernel/bsdf/mixture_traits.h"

namespace relief {

/// Has no parameters but its colour.
struct Translucent {
  static constexpr MixtureTraits kTraits{.sides = LobeSides::kTransmit};
};

/// f before the colour. @param wi  unit; z < 0, dark above
RELIEF_KERNEL float translucent_eval(const Translucent&, Vec3f, Vec3f wi, float* pdf)
{
  *pdf = warp_cosine_hemisphere_pdf(-wi.z);
  return wi.z < 0.0f ? kInvPi : 0.0f;
}

RELIEF_KERNEL Vec3f translucent_sample(const Translucent&, Vec3f, Vec2f u)
{
  const Vec3f w = diffuse_sample(u);
  return {w.x, w.y, -w.z};
}

template <TransportMode>
RELIEF_KERNEL BsdfEval lobe_eval(const Translucent& lobe, const LobeHit& hit, const BsdfTables&, Vec3f wi, bool)
{
  BsdfEval e;
  e.f = splat3(translucent_eval(lobe, hit.wo, wi, &e.pdf));
  return e;
}

template <TransportMode>
RELIEF_KERNEL LobeSample lobe_sample(const Translucent& lobe, const LobeHit& hit, float, Vec2f u)
{
  return lobe_sample_diffuse(translucent_sample(lobe, hit.wo, u), true);
}

}  // namespace relief
