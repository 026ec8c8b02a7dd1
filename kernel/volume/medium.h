// A medium: how much of light it takes away and scatters on a metre, where to, and how much it sends out. Media that fill the
// same place add up.
#pragma once

#include <cmath>
#include <cstdint>

#include "kernel/state/medium_state.h"
#include "kernel/volume/phase.h"

namespace relief {

/// Phase functions that one medium has at most.
inline constexpr int kMostPhases = 4;

struct Medium {
  Vec3f sigma_t;   ///< 1/m; not less than what the phases scatter
  Vec3f emission;  ///< W/m³/sr; below 0 it takes light away
  Phase phases[kMostPhases];
  int num_phases = 0;
};

/// Absorption coefficient that turns white into `color` over `distance`.
/// @param color     [0, 1]; darker than 1e-6 counts as 1e-6, so that the coefficient stays finite
/// @param distance  metres, > 0; infinity: no absorption
/// @return          1/m
RELIEF_KERNEL Vec3f volume_sigma_a(Vec3f color, float distance)
{
  const auto channel = [distance](float c) { return -std::log(clamp(c, 1e-6f, 1.0f)) / distance; };
  return {channel(color.x), channel(color.y), channel(color.z)};
}

/// What several media are together.
struct MediaSum {
  Vec3f sigma_t, sigma_s, emission;
  const Medium* media[kMostMedia];
  int size = 0;
};

RELIEF_KERNEL void media_add(MediaSum& sum, const Medium& medium)
{
  sum.media[sum.size++] = &medium;
  sum.sigma_t += medium.sigma_t;
  sum.emission += medium.emission;
  for (int i = 0; i < medium.num_phases; ++i) sum.sigma_s += medium.phases[i].sigma_s;
}

/// How much light is scattered from one direction to another.
struct PhaseEval {
  Vec3f f;        ///< 1/m/sr
  float pdf = 0;  ///< of media_sample, solid angle
};

/// By how much of all that is scattered a phase function is chosen.
RELIEF_KERNEL float scattering_share(Vec3f sigma_s) { return (sigma_s.x + sigma_s.y + sigma_s.z) * (1.0f / 3.0f); }

/// @param D   unit, along the light's way
/// @param wi  unit, where it goes
RELIEF_KERNEL PhaseEval media_eval(const MediaSum& sum, Vec3f D, Vec3f wi)
{
  PhaseEval eval;
  float shares = 0;
  const float cosine = dot(D, wi);
  for (int m = 0; m < sum.size; ++m) {
    for (int i = 0; i < sum.media[m]->num_phases; ++i) {
      const Phase& phase = sum.media[m]->phases[i];
      const float pdf = phase_pdf(phase, cosine), share = scattering_share(phase.sigma_s);
      eval.f += phase.sigma_s * pdf;
      eval.pdf += share * pdf;
      shares += share;
    }
  }
  if (shares > 0.0f) eval.pdf /= shares;
  return eval;
}

/// @pre something scatters
RELIEF_KERNEL Vec3f media_sample(const MediaSum& sum, Vec3f D, Vec2f u)
{
  float left = u.x * scattering_share(sum.sigma_s);
  const Phase* chosen = nullptr;
  for (int m = 0; m < sum.size; ++m) {
    for (int i = 0; i < sum.media[m]->num_phases; ++i) {
      const Phase& phase = sum.media[m]->phases[i];
      const float share = scattering_share(phase.sigma_s);
      if (!(share > 0.0f)) continue;
      chosen = &phase;
      if (left < share) return phase_sample(phase, D, {min(left / share, 1.0f - 0x1p-24f), u.y});
      left -= share;
    }
  }
  return phase_sample(*chosen, D, {u.x, u.y});
}

}  // namespace relief
