// The medium that the closures of RELIEF_volume come to.
#pragma once

#include <span>

#include "kernel/bsdf/closure_kinds.h"
#include "kernel/graph/blackbody.h"
#include "kernel/graph/graph_registers.h"
#include "kernel/volume/medium.h"
#include "kernel/volume/volume_closure.h"

namespace relief {

/// Phase functions that a closure has.
RELIEF_KERNEL constexpr int volume_closure_phases(VolumeClosureKind kind)
{
  return kind == VolumeClosureKind::kScatter || kind == VolumeClosureKind::kPrincipled ? 1 : 0;
}

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

/// What a medium's closures come to at one point.
/// @param at  of the medium's program, which has run
/// @source    Cycles: the Principled Volume's emission is not weighted by the mixes that it is in, and none is cut off at 0
RELIEF_KERNEL Medium medium_resolve(std::span<const VolumeClosureSpec> closures, const GraphLane& at)
{
  Medium medium;
  for (const VolumeClosureSpec& closure : closures) {
    int place = closure.first_result;
    const auto number = [&] { return closure_input(graph_result(at, place++)); };
    const auto color = [&] {
      const float r = number(), g = number();
      return Vec3f{r, g, number()};
    };
    const auto scatter = [&medium](Vec3f sigma_s, float anisotropy) {
      medium.phases[medium.num_phases++] = {sigma_s, clamp(anisotropy, -kMostAnisotropy, kMostAnisotropy)};
    };
    const float weight = max(number(), 0.0f);
    if (!(weight > 0.0f)) continue;
    const Vec3f first_color = color();
    const float first_number = number();
    switch (closure.kind) {
      case VolumeClosureKind::kAbsorption:
        medium.sigma_t += max(Vec3f{1, 1, 1} - first_color, Vec3f{}) * (weight * max(first_number, 0.0f));
        break;
      case VolumeClosureKind::kScatter: {
        const Vec3f sigma_s = max(first_color, Vec3f{}) * (weight * max(first_number, 0.0f));
        medium.sigma_t += sigma_s;
        scatter(sigma_s, number());
        break;
      }
      case VolumeClosureKind::kPrincipled: {
        const Vec3f scattered = max(first_color, Vec3f{});
        const float density = weight * max(first_number, 0.0f);
        scatter(scattered * density, number());
        const Vec3f kept = max(color(), Vec3f{});
        const Vec3f root{__builtin_sqrtf(kept.x), __builtin_sqrtf(kept.y), __builtin_sqrtf(kept.z)};
        const Vec3f absorbed = max(Vec3f{1, 1, 1} - scattered, Vec3f{}) * max(Vec3f{1, 1, 1} - root, Vec3f{});
        medium.sigma_t += (scattered + absorbed) * density;
        const float strength = max(number(), 0.0f);
        medium.emission += color() * strength;
        const float share = number();
        const Vec3f tint = color();
        medium.emission += volume_blackbody(share, tint, number());
        break;
      }
      case VolumeClosureKind::kEmission:
        medium.emission += first_color * (weight * first_number);
        break;
    }
  }
  return medium;
}

}  // namespace relief
