// Sums and products of octaves of signed noise that look like terrain, eight points at a time.
//
// Musgrave, in Ebert et al. 2003, "Texturing and Modeling: A Procedural Approach", chapter 16.
#pragma once

#include "kernel/graph/noise.h"

namespace relief {

enum class MusgraveType : std::uint16_t { kMultifractal, kFbm, kHybrid, kRidged, kHeteroTerrain };

struct MusgraveSettings {
  F8 octaves;     ///< [0, 16]; the last one by its fraction
  F8 falloff;     ///< size of an octave against the one before
  F8 lacunarity;  ///< its frequency against that
  F8 offset, gain;
  bool repeats;  ///< see noise_signed
};

template <int kDims>
RELIEF_KERNEL F8 musgrave_eval(const F8 (&point)[kDims], MusgraveType type, const MusgraveSettings& s)
{
  const F8 whole = floor(s.octaves), rest = s.octaves - whole;
  float most = 0.0f;
  for (int k = 0; k < 8; ++k) most = whole[k] > most ? whole[k] : most;
  const bool is_hetero = type == MusgraveType::kHeteroTerrain, is_ridged = type == MusgraveType::kRidged;
  // Where the first octave is always there, a fraction is one of the second at least.
  const F8 rest_at = is_hetero ? max(whole, splat8(1.0f)) : whole;
  const int last = is_hetero && most < 1.0f ? 1 : static_cast<int>(most);
  F8 p[kDims];
  for (int i = 0; i < kDims; ++i) p[i] = point[i];
  F8 size = splat8(1.0f), weight = splat8(1.0f), signal{};
  F8 value = type == MusgraveType::kMultifractal ? splat8(1.0f) : F8{};
  for (int octave = 0; octave <= last; ++octave) {
    const F8 n = splat8(static_cast<float>(octave));
    // The first octave of these two is always there.
    const bool is_base = octave == 0 && (is_hetero || is_ridged);
    const F8 share = is_base ? splat8(1.0f) : n < whole ? splat8(1.0f) : n == rest_at ? rest : F8{};
    const F8 noise = noise_signed<kDims>(p, s.repeats);
    switch (type) {
      case MusgraveType::kMultifractal:
        value *= share * size * noise + 1.0f;
        break;
      case MusgraveType::kFbm:
        value += share * noise * size;
        break;
      case MusgraveType::kHybrid: {
        const F8 alive = weight > 0.001f ? share : F8{};
        weight = min(weight, splat8(1.0f));
        signal = (noise + s.offset) * size;
        value += alive * weight * signal;
        weight = alive > 0.0f ? weight * s.gain * signal : F8{};
        break;
      }
      case MusgraveType::kRidged: {
        // Only whole octaves.
        const F8 counted = is_base ? splat8(1.0f) : n < whole ? splat8(1.0f) : F8{};
        weight = is_base ? splat8(1.0f) : clamp(signal * s.gain, 0.0f, 1.0f);
        const F8 ridge = s.offset - abs(noise);
        signal = ridge * ridge * weight;
        value += counted * signal * size;
        break;
      }
      case MusgraveType::kHeteroTerrain:
        value = is_base ? s.offset + noise : value + share * (noise + s.offset) * size * value;
        break;
    }
    size *= s.falloff;
    for (int i = 0; i < kDims; ++i) p[i] *= s.lacunarity;
  }
  return value;
}

}  // namespace relief
