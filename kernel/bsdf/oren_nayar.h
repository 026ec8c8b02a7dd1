// Rough diffuse surfaces: Oren–Nayar as Cycles 3.4 evaluates it, and its successor of 4.3, which gives back what bounces
// among the grooves. Both are sampled by the cosine.
//
// Fujii, "A tiny improvement of Oren–Nayar reflectance model", qualitative model [F]; OpenPBR 1.1, section "Base
// substrate: glossy-diffuse" [O].
#pragma once

#include "kernel/bsdf/diffuse.h"
#include "kernel/bsdf/mixture_traits.h"

namespace relief {

/// Roughness 0 is Lambert.
struct OrenNayar {
  static constexpr MixtureTraits kTraits{};
  float A = kInvPi;
  float B = 0;
};

/// @param roughness  clamped to [0, 1]
/// @source           [F]; A falls with roughness so that no direction reflects more than it receives
RELIEF_KERNEL OrenNayar oren_nayar_make(float roughness)
{
  const float sigma = clamp(roughness, 0.0f, 1.0f);
  const float A = 1.0f / (kPi + (0.5f * kPi - 2.0f / 3.0f) * sigma);
  return {A, sigma * A};
}

/// Cosine of the azimuth between both directions times their sines, over the larger cosine where it is positive.
/// @source [F]
RELIEF_KERNEL float oren_nayar_s_over_t(Vec3f wo, Vec3f wi)
{
  const float s = wo.x * wi.x + wo.y * wi.y;
  return s > 0.0f ? s / max(wo.z, wi.z) : s;
}

/// f before the colour. The albedo is below 1 except for roughness 0.
/// @param wo, wi  unit; wo.z > 0
/// @param pdf     solid angle of wi under oren_nayar_sample
RELIEF_KERNEL float oren_nayar_eval(const OrenNayar& lobe, Vec3f wo, Vec3f wi, float* pdf)
{
  *pdf = diffuse_pdf(wi);
  if (!(wi.z > 0.0f)) return 0.0f;
  return lobe.A + lobe.B * oren_nayar_s_over_t(wo, wi);
}

RELIEF_KERNEL Vec3f oren_nayar_sample(const OrenNayar&, Vec3f, Vec2f u) { return diffuse_sample(u); }

/// Directional albedo over B, less π A over B: ∫ s/t cos dω.
/// @param z     cosine, [0, 1]
/// @source      [O]
RELIEF_KERNEL float oren_nayar_G(float z)
{
  // tan θ has no digits next to the horizon; the first two terms of the series do.
  if (z < 1e-6f) return (0.5f * kPi - 2.0f / 3.0f) - z;
  const float sine = safe_sqrt(1.0f - z * z);
  const float theta = angle_of(sine, z);
  return sine * (theta - 2.0f / 3.0f - sine * z) + (2.0f / 3.0f) * (sine / z) * (1.0f - sine * sine * sine);
}

/// Share that one bounce reflects towards a direction.
RELIEF_KERNEL float oren_nayar_albedo(const OrenNayar& lobe, float z)
{
  return min(1.0f, lobe.A * kPi + lobe.B * oren_nayar_G(z));
}

/// Oren–Nayar of Cycles 4.3: with a second term for light that bounces more than once. White is closed in the furnace.
struct OrenNayarMultiple {
  static constexpr MixtureTraits kTraits{};
  OrenNayar single;
  Vec3f multiple{};  ///< of the second term, before what wi loses
};

/// @param color  of the surface; it saturates where it bounces again, and so stands in the lobe. Clamped to [0, 1]
/// @source       [O], with Cycles' factor: it multiplies the sum by the colour once more, and so has one power of the
///               colour more than [O] in the second term
RELIEF_KERNEL OrenNayarMultiple oren_nayar_multiple_make(Vec3f color, float roughness, Vec3f wo)
{
  OrenNayarMultiple lobe;
  lobe.single = oren_nayar_make(roughness);
  const Vec3f albedo = min(max(color, splat3(0.0f)), splat3(1.0f));
  const float mean = lobe.single.A * kPi + ((2.0f * kPi - 5.6f) / 3.0f) * lobe.single.B;
  // 1 − mean cancels from both sides: with roughness 0 nothing is lost and nothing to be divided by.
  const float lost_mean = 1.0f - mean;
  if (!(lobe.single.B > 0.0f && lost_mean > 0.0f)) return lobe;
  const float lost_o = 1.0f - oren_nayar_albedo(lobe.single, wo.z);
  lobe.multiple = albedo * albedo * (kInvPi * mean / lost_mean * lost_o) / (splat3(1.0f) - albedo * lost_mean);
  return lobe;
}

/// f before the colour, by which the caller multiplies.
/// @param wo  as in oren_nayar_multiple_make
RELIEF_KERNEL Vec3f oren_nayar_multiple_eval(const OrenNayarMultiple& lobe, Vec3f wo, Vec3f wi, float* pdf)
{
  const float single = oren_nayar_eval(lobe.single, wo, wi, pdf);
  if (!(wi.z > 0.0f)) return {};
  return splat3(single) + lobe.multiple * (1.0f - oren_nayar_albedo(lobe.single, wi.z));
}

RELIEF_KERNEL Vec3f oren_nayar_multiple_sample(const OrenNayarMultiple&, Vec3f, Vec2f u) { return diffuse_sample(u); }

template <TransportMode>
RELIEF_KERNEL BsdfEval lobe_eval(const OrenNayar& lobe, const LobeHit& hit, const BsdfTables&, Vec3f wi, bool)
{
  BsdfEval e;
  e.f = splat3(oren_nayar_eval(lobe, hit.wo, wi, &e.pdf));
  return e;
}

template <TransportMode>
RELIEF_KERNEL LobeSample lobe_sample(const OrenNayar& lobe, const LobeHit& hit, float, Vec2f u)
{
  return lobe_sample_diffuse(oren_nayar_sample(lobe, hit.wo, u), false);
}

template <TransportMode>
RELIEF_KERNEL BsdfEval lobe_eval(const OrenNayarMultiple& lobe, const LobeHit& hit, const BsdfTables&, Vec3f wi, bool)
{
  BsdfEval e;
  e.f = oren_nayar_multiple_eval(lobe, hit.wo, wi, &e.pdf);
  return e;
}

template <TransportMode>
RELIEF_KERNEL LobeSample lobe_sample(const OrenNayarMultiple& lobe, const LobeHit& hit, float, Vec2f u)
{
  return lobe_sample_diffuse(oren_nayar_multiple_sample(lobe, hit.wo, u), false);
}

}  // namespace relief
