// Diffuse base and sheen of Blender's Principled shader up to 3.6, both after Disney and both sampled by the cosine.
//
// Burley 2012, "Physically Based Shading at Disney" [B12]; Burley 2015, "Extending the Disney BRDF to a BSDF with
// Integrated Subsurface Scattering" [B15].
#pragma once

#include <cstdint>

#include "kernel/bsdf/diffuse.h"
#include "kernel/bsdf/mixture_traits.h"

namespace relief {

/// What of it there is, where part of the light goes below the surface.
enum class PrincipledDiffusePart : std::uint8_t {
  kAll,
  kLambert,  ///< without retro-reflection
  kRetro,    ///< that alone
  kLeaving,  ///< of light that leaves again: Lambert's part for wi alone
};

struct PrincipledDiffuse {
  static constexpr MixtureTraits kTraits{};
  float roughness = 0.5f;  ///< not clamped, as in Cycles
  PrincipledDiffusePart part = PrincipledDiffusePart::kAll;
};

/// f before the colour. Bright at grazing angles: roughness 0.5 reflects up to 1.02 of what it receives, roughness
/// 1 up to 1.52 (BlenderLobe tests).
/// @param wo, wi  unit; wo.z > 0
/// @source        [B15] Eq. 4: Lambert and retro-reflection apart, each with its own Schlick terms
RELIEF_KERNEL float principled_diffuse_eval(const PrincipledDiffuse& lobe, Vec3f wo, Vec3f wi, float* pdf)
{
  *pdf = diffuse_pdf(wi);
  if (!(wi.z > 0.0f)) return 0.0f;
  const float F_o = schlick_weight(wo.z), F_i = schlick_weight(wi.z);
  // 2 cos² of half the angle between both directions is one plus their cosine.
  const float retro = lobe.roughness * (1.0f + dot(wo, wi));
  const float leaving = 1.0f - 0.5f * F_i;
  const float lambert = (1.0f - 0.5f * F_o) * leaving;
  const float back = retro * (F_o + F_i + F_o * F_i * (retro - 1.0f));
  switch (lobe.part) {
    case PrincipledDiffusePart::kAll:
      break;
    case PrincipledDiffusePart::kLambert:
      return kInvPi * lambert;
    case PrincipledDiffusePart::kRetro:
      return kInvPi * back;
    case PrincipledDiffusePart::kLeaving:
      return kInvPi * leaving;
  }
  return kInvPi * (lambert + back);
}

RELIEF_KERNEL Vec3f principled_diffuse_sample(const PrincipledDiffuse&, Vec3f, Vec2f u) { return diffuse_sample(u); }

template <TransportMode>
RELIEF_KERNEL BsdfEval lobe_eval(const PrincipledDiffuse& lobe, const LobeHit& hit, const BsdfTables&, Vec3f wi, bool)
{
  BsdfEval e;
  e.f = splat3(principled_diffuse_eval(lobe, hit.wo, wi, &e.pdf));
  return e;
}

template <TransportMode>
RELIEF_KERNEL LobeSample lobe_sample(const PrincipledDiffuse& lobe, const LobeHit& hit, float, Vec2f u)
{
  return lobe_sample_diffuse(principled_diffuse_sample(lobe, hit.wo, u), false);
}

}  // namespace relief
