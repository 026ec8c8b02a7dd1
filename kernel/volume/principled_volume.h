// Principled Volume, as Cycles has it.
#pragma once

#include "kernel/graph/blackbody.h"
#include "kernel/volume/volume_inputs.h"

namespace relief {

struct PrincipledVolume {
  static constexpr const char* kName = "principled";
  static constexpr VolumeInput kInputs[] = {{"color", true, 0.5f},
                                            {"density", false, 1},
                                            {"anisotropy", false, 0, true},
                                            {"absorptionColor", true, 0},
                                            {"emissionStrength", false, 0},
                                            {"emissionColor", true, 1, true},
                                            {"blackbodyIntensity", false, 0},
                                            {"blackbodyTint", true, 1, true},
                                            {"temperature", false, 1000}};
  static constexpr int kPhases = 1;
};

/// Light that a black body of a volume sends out, as Cycles has it: not Planck's spectra, but colours of a luminance of 1 times
/// the law of Stefan and Boltzmann, as far as `share` says. Below 0 where such a colour is out of gamut.
RELIEF_KERNEL Vec3f volume_blackbody(float share, Vec3f tint, float kelvins)
{
  constexpr float kScaled = 5.670373e-8f * 1e-6f * kInvPi;
  if (!(share > 0.0f)) return {};
  const float t = max(kelvins, 0.0f);
  const float intensity = kScaled * (1.0f + share * (sqr(sqr(t)) - 1.0f));
  return tint * blackbody_color(t) * intensity;
}

/// @source  Cycles: the emission is not weighted by the mixes that it is in, and none is cut off at 0
RELIEF_KERNEL void medium_add(PrincipledVolume, float weight, VolumeNumbers& in, Medium& medium)
{
  const Vec3f scattered = max(in.color(), Vec3f{});
  const float density = weight * max(in.number(), 0.0f);
  medium_add_phase(medium, scattered * density, in.number());
  const Vec3f kept = max(in.color(), Vec3f{});
  const Vec3f root{__builtin_sqrtf(kept.x), __builtin_sqrtf(kept.y), __builtin_sqrtf(kept.z)};
  const Vec3f absorbed = max(Vec3f{1, 1, 1} - scattered, Vec3f{}) * max(Vec3f{1, 1, 1} - root, Vec3f{});
  medium.sigma_t += (scattered + absorbed) * density;
  const float strength = max(in.number(), 0.0f);
  medium.emission += in.color() * strength;
  const float share = in.number();
  const Vec3f tint = in.color();
  medium.emission += volume_blackbody(share, tint, in.number());
}

template <typename Bounds>
RELIEF_KERNEL void rate_add(PrincipledVolume, float weight, Bounds& in, MediumRate& rate)
{
  const ValueBounds color = in.color();
  const float density = in.number().high;
  in.number();
  const ValueBounds kept = in.color();
  // c + (1 − c) k for what is absorbed, k ≤ 1: it grows with c.
  const float k = max(1.0f - __builtin_sqrtf(max(kept.low, 0.0f)), 0.0f), c = max(color.high, 0.0f);
  rate.sigma_t += bounds_product(c < 1.0f ? c + (1.0f - c) * k : c, bounds_product(weight, density));
  const float strength = in.number().high;
  rate.emits |= counts(in.color()) && strength > 0.0f;
  rate.emits |= in.number().high > 0.0f;
}

}  // namespace relief
