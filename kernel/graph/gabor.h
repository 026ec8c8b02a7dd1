// Gabor noise: waves of one frequency in soft spots that are strewn over cells, eight points at a time. The numbers are
// those of Blender's Gabor Texture.
//
// Lagae et al. 2009, "Procedural Noise using Sparse Gabor Convolution" [L]. Tavernier et al. 2019, "Making Gabor Noise Fast
// and Normalized": a fixed number of spots a cell, weights of ±1. Tricard et al. 2019, "Procedural Phasor Noise": sums of
// complex numbers.
#pragma once

#include "kernel/graph/noise.h"
#include "kernel/math/lanes_functions.h"

namespace relief {

inline constexpr int kGaborSpots = 8;  ///< a cell

/// Direction of waves; each may differ between lanes.
struct GaborWaves {
  F8 frequency;          ///< waves a cell
  F8 isotropy;           ///< [0, 1]: share of a random turn of each spot
  F8 direction[3];       ///< unit; two dimensions: x, y
  F8 azimuth_turns;      ///< of the direction, as fractions of a turn
  F8 inclination_turns;  ///< from z; three dimensions
};

/// Direction of a spot's waves.
/// @param cell  its cell and its number
template <int kDims>
RELIEF_KERNEL void gabor_direction(const F8 (&key)[kDims + 1], const GaborWaves& waves, F8 (&direction)[kDims])
{
  if constexpr (kDims == 2) {
    // Half a turn in all: the waves of a direction are those of its opposite.
    const F8 turn = waves.azimuth_turns + 0.5f * waves.isotropy * (hash_unit(key) - 0.5f);
    const SinCos8 at = sin_cos_turn(turn);
    direction[0] = at.cos;
    direction[1] = at.sin;
  } else {
    for (int i = 0; i < 3; ++i) direction[i] = waves.direction[i];
    const I8 is_random = waves.isotropy != 0.0f;
    if (mask_of(is_random) == 0) return;
    const F8 first = hash_unit(key), second = hash_unit({key[2], key[0], key[3], key[1]});
    const SinCos8 polar = sin_cos_turn(waves.inclination_turns + 0.5f * first * waves.isotropy);
    const SinCos8 around = sin_cos_turn(waves.azimuth_turns + 0.5f * second * waves.isotropy);
    direction[0] = is_random ? polar.sin * around.cos : direction[0];
    direction[1] = is_random ? polar.sin * around.sin : direction[1];
    direction[2] = is_random ? polar.cos : direction[2];
  }
}

/// Sum of all spots that reach a point.
/// @param p  any floats
/// @return   cosine and sine sums
/// @source   [L] Eq. 6 and 8, with Hann's window so that spots end softly at a distance of 1
template <int kDims>
RELIEF_KERNEL SinCos8 gabor_noise(const F8 (&p)[kDims], const GaborWaves& waves)
{
  F8 cell[kDims], local[kDims];
  for (int i = 0; i < kDims; ++i) {
    cell[i] = floor(p[i]);
    local[i] = p[i] - cell[i];
  }
  SinCos8 sum{};
  constexpr int kCells = kDims == 2 ? 9 : 27;
  for (int n = 0; n < kCells * kGaborSpots; ++n) {
    F8 from[kDims], key[kDims + 1];
    for (int i = 0, rest = n / kGaborSpots; i < kDims; ++i, rest /= 3) {
      const auto offset = static_cast<float>(rest % 3 - 1);
      key[i] = cell[i] + offset;
      from[i] = local[i] - offset;
    }
    const auto number = static_cast<float>(n % kGaborSpots * 3);
    key[kDims] = splat8(number + 1.0f);
    if constexpr (kDims == 2) {
      from[0] -= hash_unit(key);
      from[1] -= hash_unit({key[2], key[0], key[1]});
    } else {
      from[0] -= hash_unit(key);
      from[1] -= hash_unit({key[2], key[0], key[3], key[1]});
      from[2] -= hash_unit({key[3], key[2], key[1], key[0]});
    }
    F8 distance_squared{};
    for (int i = 0; i < kDims; ++i) distance_squared += from[i] * from[i];
    const I8 is_near = distance_squared < 1.0f;
    if (mask_of(is_near) == 0) continue;
    key[kDims] = splat8(number);
    F8 direction[kDims];
    gabor_direction<kDims>(key, waves, direction);
    key[kDims] = splat8(number + 2.0f);
    const F8 window = 0.5f + 0.5f * sin_cos_turn(0.5f * clamp(distance_squared, 0.0f, 1.0f)).cos;
    const F8 size = exp8(-kPi * clamp(distance_squared, 0.0f, 1.0f)) * window;
    const F8 weight = hash_unit(key) < 0.5f ? -size : size;
    F8 turns{};
    for (int i = 0; i < kDims; ++i) turns += from[i] * (waves.frequency * direction[i]);
    const SinCos8 wave = sin_cos_turn(clamp(turns, -1e6f, 1e6f));
    sum.cos += is_near ? weight * wave.cos : F8{};
    sum.sin += is_near ? weight * wave.sin : F8{};
  }
  return sum;
}

}  // namespace relief
