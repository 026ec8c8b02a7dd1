// Sheen of Blender's Principled shader up to 3.6: a Schlick term of the half vector, and nothing else.
//
// Burley 2012, "Physically Based Shading at Disney".
#pragma once

#include "kernel/bsdf/diffuse.h"
#include "kernel/bsdf/mixture_traits.h"

namespace relief {

/// Has no parameters: the strength and the tint are its colour.
struct PrincipledSheen {
  static constexpr MixtureTraits kTraits{};
};

/// f before the colour, (1 − cos)⁵ of the half angle. It has no 1/π; the albedo at grazing angles is 0.08, on top of the
/// diffuse base.
/// @param wo, wi  unit; wo.z > 0
RELIEF_KERNEL float principled_sheen_eval(const PrincipledSheen&, Vec3f wo, Vec3f wi, float* pdf)
{
  *pdf = diffuse_pdf(wi);
  if (!(wi.z > 0.0f)) return 0.0f;
  return schlick_weight(0.5f * length(wo + wi));
}

RELIEF_KERNEL Vec3f principled_sheen_sample(const PrincipledSheen&, Vec3f, Vec2f u) { return diffuse_sample(u); }

template <TransportMode>
RELIEF_KERNEL BsdfEval lobe_eval(const PrincipledSheen& lobe, const LobeHit& hit, const BsdfTables&, Vec3f wi, bool)
{
  BsdfEval e;
  e.f = splat3(principled_sheen_eval(lobe, hit.wo, wi, &e.pdf));
  return e;
}

template <TransportMode>
RELIEF_KERNEL LobeSample lobe_sample(const PrincipledSheen& lobe, const LobeHit& hit, float, Vec2f u)
{
  return lobe_sample_diffuse(principled_sheen_sample(lobe, hit.wo, u), false);
}

}  // namespace relief
