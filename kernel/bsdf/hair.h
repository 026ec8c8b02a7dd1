// Cycles' Hair BSDF: two lobes of a strand, what its surface reflects and what goes through it, after Marschner and others 2003, with
// distributions that are easy to sample. Constant in energy: f · cos is the density of samples.
//
// In the frame of a strand x is along it and z across it towards the viewer, so that wo = (sin θo, 0, cos θo).
#pragma once

#include "kernel/bsdf/mixture_traits.h"
#include "kernel/math/vec.h"

namespace relief {

struct Hair {
  static constexpr MixtureTraits kTraits{.is_diffuse = false, .fading = LobeFading::kNever, .is_strand = true};
  float along = 0.1f;  ///< width of the tilts, radians
  float around = 1;    ///< width around the strand
  float offset = 0;    ///< of the highlight's tilt, radians
  bool transmits = false;
};

RELIEF_KERNEL Hair hair_make(float along, float around, float offset, bool transmits)
{
  return {clamp(along, 0.001f, 1.0f), clamp(around, 0.001f, 1.0f), offset, transmits};
}

RELIEF_KERNEL float asin_clamped(float x) { return std::asin(clamp(x, -1.0f, 1.0f)); }

/// The tilts of half vectors that are sampled, as angles of a Cauchy distribution.
struct HairTilts {
  float low, high;
};

RELIEF_KERNEL HairTilts hair_tilts(const Hair& hair, float theta_o)
{
  const auto angle = [&](float end) { return std::atan((0.5f * (end + theta_o) - hair.offset) / hair.along); };
  return {angle(-0.5f * kPi), angle(0.5f * kPi)};
}

/// Density of the tilt of wi over solid angle, without that around the strand.
RELIEF_KERNEL float hair_tilt_pdf(const Hair& hair, float theta_o, float theta_i)
{
  const HairTilts tilts = hair_tilts(hair, theta_o);
  const float t = 0.5f * (theta_i + theta_o) - hair.offset;
  return hair.along / (2.0f * (sqr(t) + sqr(hair.along)) * (tilts.high - tilts.low) * std::cos(theta_i));
}

/// Width of the Cauchy distribution around what goes through, over the half turn that is sampled.
RELIEF_KERNEL float hair_spread(const Hair& hair) { return 2.0f * std::atan(0.5f * kPi / hair.around); }

/// @return  f · cos, and the same as pdf of solid angle. Lamps are shown what is reflected to the viewer's side alone, and what goes through
///          where the surface's normal looks away (mixture_lobe_reaches); samples go where they fall
/// @source  Cycles 3.4
RELIEF_KERNEL float hair_eval(const Hair& hair, Vec3f wo, Vec3f wi)
{
  constexpr float kSteepest = 0.5f * kPi - 0.001f;
  const float theta_o = asin_clamped(wo.x), theta_i = asin_clamped(wi.x);
  const float across = __builtin_sqrtf(sqr(wi.y) + sqr(wi.z));
  if (!(__builtin_fabsf(theta_i) < kSteepest && across > 0.0f)) return 0.0f;
  const float cos_phi = wi.z / across;
  const float phi = std::acos(clamp(cos_phi, -1.0f, 1.0f));
  const float tilt = hair_tilt_pdf(hair, theta_o, theta_i);
  if (hair.transmits) {
    const float p = kPi - phi;
    return tilt * hair.around / (hair_spread(hair) * (sqr(p) + sqr(hair.around)));
  }
  return tilt * 0.25f / hair.around * std::cos(0.5f * min(phi / hair.around, kPi));
}

/// @return unit; where hair_eval is 0, nothing is sampled
RELIEF_KERNEL Vec3f hair_sample(const Hair& hair, Vec3f wo, Vec2f u)
{
  const float theta_o = asin_clamped(wo.x);
  const HairTilts tilts = hair_tilts(hair, theta_o);
  const float t = hair.along * std::tan(lerp(u.x, tilts.low, tilts.high));
  const float theta_i = 2.0f * (t + hair.offset) - theta_o;
  const float phi = hair.transmits ? kPi + hair.around * std::tan(hair_spread(hair) * (u.y - 0.5f))
                                   : 2.0f * hair.around * asin_clamped(1.0f - 2.0f * u.y);
  const float cosine = std::cos(theta_i);
  return {std::sin(theta_i), -std::sin(phi) * cosine, std::cos(phi) * cosine};
}

template <TransportMode>
[[gnu::noinline]] RELIEF_KERNEL BsdfEval lobe_eval(const Hair& hair, const LobeHit& hit, const BsdfTables&, Vec3f wi, bool)
{
  const float density = hair_eval(hair, hit.wo, wi);
  return {splat3(density), density};
}

template <TransportMode>
[[gnu::noinline]] RELIEF_KERNEL LobeSample lobe_sample(const Hair& hair, const LobeHit& hit, float, Vec2f u)
{
  return lobe_sample_glossy(hair_sample(hair, hit.wo, u), hair.transmits, hair.along);
}

/// That of what goes through.
struct HairThrough : Hair {
  static constexpr MixtureTraits kTraits{
      .sides = LobeSides::kTransmit, .is_diffuse = false, .fading = LobeFading::kNever, .is_strand = true};
};

}  // namespace relief
