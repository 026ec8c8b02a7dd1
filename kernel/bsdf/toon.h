// Cycles' two toon lobes: a disk of constant light with a soft rim, about the normal (diffuse) or the mirror direction
// (glossy).
#pragma once

#include "kernel/bsdf/mixture_traits.h"
#include "kernel/sample/warp.h"

namespace relief {

/// Angles in radians.
struct Toon {
  static constexpr MixtureTraits kTraits{};
  float inner = 0;          ///< full brightness up to here
  float rim = 0;            ///< width over which it falls to nothing
  float one_minus_cos = 0;  ///< of the cone that is sampled, min(inner + rim, π/2)
  bool is_glossy = false;
};

/// @param size, smooth  clamped to [0, 1], of a right angle
RELIEF_KERNEL Toon toon_make(float size, float smooth, bool is_glossy)
{
  Toon lobe;
  lobe.inner = 0.5f * kPi * clamp(size, 0.0f, 1.0f);
  lobe.rim = 0.5f * kPi * clamp(smooth, 0.0f, 1.0f);
  lobe.is_glossy = is_glossy;
  const float outer = min(lobe.inner + lobe.rim, 0.5f * kPi);
  lobe.one_minus_cos = 2.0f * sqr(std::sin(0.5f * outer));
  return lobe;
}

/// Nothing to see: Cycles has no closure either where both size and smooth are zero.
RELIEF_KERNEL bool toon_is_empty(const Toon& lobe) { return !(lobe.one_minus_cos > 1e-7f); }

/// Axis of the disk.
RELIEF_KERNEL Vec3f toon_axis(const Toon& lobe, Vec3f wo)
{
  return lobe.is_glossy ? Vec3f{-wo.x, -wo.y, wo.z} : Vec3f{0.0f, 0.0f, 1.0f};
}

/// Brightness at an angle from the axis, [0, 1].
RELIEF_KERNEL float toon_intensity(const Toon& lobe, float angle)
{
  if (angle < lobe.inner) return 1.0f;
  const float past = angle - lobe.inner;
  return past < lobe.rim ? 1.0f - past / lobe.rim : 0.0f;
}

/// f before the colour: constant radiance over the disk, f · cos is the sampling density where the disk is bright. So
/// it is not reciprocal, and divided by the cosine.
/// @param wo, wi  unit; wo.z > 0
/// @param pdf     solid angle of wi under toon_sample
RELIEF_KERNEL float toon_eval(const Toon& lobe, Vec3f wo, Vec3f wi, float* pdf)
{
  *pdf = 0.0f;
  if (!(wi.z > 0.0f) || toon_is_empty(lobe)) return 0.0f;
  const Vec3f axis = toon_axis(lobe, wo);
  const float cosine = dot(axis, wi);
  // By the sine: next to the axis the cosine has no digits.
  const float angle = angle_of(length(cross(axis, wi)), cosine);
  if (!(angle < lobe.inner + lobe.rim && cosine > 0.0f)) return 0.0f;
  *pdf = warp_cone_pdf(lobe.one_minus_cos);
  return *pdf * toon_intensity(lobe, angle) / wi.z;
}

/// @return z <= 0: the disk reaches below the horizon
RELIEF_KERNEL Vec3f toon_sample(const Toon& lobe, Vec3f wo, Vec2f u)
{
  if (toon_is_empty(lobe)) return {};
  const Vec3f w = warp_cone(lobe.one_minus_cos, u);
  return lobe.is_glossy ? from_local(frame_from_normal(toon_axis(lobe, wo)), w) : w;
}

template <TransportMode>
RELIEF_KERNEL BsdfEval lobe_eval(const Toon& lobe, const LobeHit& hit, const BsdfTables&, Vec3f wi, bool)
{
  BsdfEval e;
  e.f = splat3(toon_eval(lobe, hit.wo, wi, &e.pdf));
  return e;
}

template <TransportMode>
RELIEF_KERNEL LobeSample lobe_sample(const Toon& lobe, const LobeHit& hit, float, Vec2f u)
{
  return lobe_sample_diffuse(toon_sample(lobe, hit.wo, u), false);
}

/// That about the mirror direction.
struct GlossyToon : Toon {
  static constexpr MixtureTraits kTraits{.is_diffuse = false, .fading = LobeFading::kBefore52};
};

template <TransportMode>
RELIEF_KERNEL LobeSample lobe_sample(const GlossyToon& lobe, const LobeHit& hit, float, Vec2f u)
{
  return lobe_sample_glossy(toon_sample(lobe, hit.wo, u), false, 1.0f);
}

}  // namespace relief
