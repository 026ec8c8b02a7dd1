// Gradient noise in 1 to 4 dimensions and sums of its octaves, eight points at a time, with the numbers that Blender's
// Noise Texture has: Perlin's gradients chosen by Bob Jenkins' hash.
//
// Perlin 2002, "Improving Noise" [P]. Jenkins 2006, "lookup3.c, by Bob Jenkins, May 2006, Public Domain" [J].
#pragma once

#include <cmath>

#include "kernel/math/lanes.h"
#include "kernel/math/vec.h"

namespace relief {

RELIEF_KERNEL W8 rotate_left(W8 x, int bits) { return x << bits | x >> (32 - bits); }

/// @source [J] final
RELIEF_KERNEL W8 hash_final(W8 a, W8 b, W8 c)
{
  c = (c ^ b) - rotate_left(b, 14);
  a = (a ^ c) - rotate_left(c, 11);
  b = (b ^ a) - rotate_left(a, 25);
  c = (c ^ b) - rotate_left(b, 16);
  a = (a ^ c) - rotate_left(c, 4);
  b = (b ^ a) - rotate_left(a, 14);
  return (c ^ b) - rotate_left(b, 24);
}

/// Hash of the first `kCount` words of a key.
/// @source [J] hashword: its start value for that many words and no seed
template <int kCount>
RELIEF_KERNEL W8 hash_words(const W8 (&key)[kCount])
{
  static_assert(kCount >= 1 && kCount <= 4);
  constexpr std::uint32_t kStart = 0xdeadbeefu + (static_cast<std::uint32_t>(kCount) << 2) + 13u;
  W8 a = W8{} + kStart, b = a, c = a;
  a += key[0];
  if constexpr (kCount > 1) b += key[1];
  if constexpr (kCount > 2) c += key[2];
  if constexpr (kCount > 3) {
    a = (a - c) ^ rotate_left(c, 4), c += b;
    b = (b - a) ^ rotate_left(a, 6), a += c;
    c = (c - b) ^ rotate_left(b, 8), b += a;
    a = (a - c) ^ rotate_left(c, 16), c += b;
    b = (b - a) ^ rotate_left(a, 19), a += c;
    c = (c - b) ^ rotate_left(b, 4), b += a;
    a += key[3];
  }
  return hash_final(a, b, c);
}

/// A word as a number in [0, 1].
RELIEF_KERNEL F8 unit_of_word(W8 word)
{
  // By halves: there is no conversion of unsigned lanes before AVX-512. Exact but for the rounding of the sum.
  const F8 high = __builtin_convertvector(__builtin_bit_cast(I8, word >> 16), F8);
  const F8 low = __builtin_convertvector(__builtin_bit_cast(I8, word & 0xffffu), F8);
  return (high * 65536.0f + low) / 4294967296.0f;
}

/// Hash of numbers by their bits, in [0, 1].
template <int kCount>
[[gnu::always_inline]] RELIEF_KERNEL F8 hash_unit(const F8 (&key)[kCount])
{
  W8 words[kCount];
  for (int i = 0; i < kCount; ++i) words[i] = bits_of(key[i]);
  return unit_of_word(hash_words(words));
}

/// −a where the bit of the hash is set.
RELIEF_KERNEL F8 negate_by(F8 a, W8 hash, int bit)
{
  return __builtin_bit_cast(F8, bits_of(a) ^ ((hash >> bit & 1u) << 31));
}

/// Product of a lattice point's gradient with the way from it.
/// @source [P] grad; the cases of 1, 2 and 4 dimensions are those of its descendants
template <int kDims>
RELIEF_KERNEL F8 noise_gradient(W8 hash, const F8 (&d)[kDims])
{
  if constexpr (kDims == 1) {
    const F8 size = __builtin_convertvector(__builtin_bit_cast(I8, (hash & 7u) + 1u), F8);
    return negate_by(size, hash, 3) * d[0];
  } else if constexpr (kDims == 2) {
    const W8 h = hash & 7u;
    const F8 u = h < 4u ? d[0] : d[1];
    const F8 v = 2.0f * (h < 4u ? d[1] : d[0]);
    return negate_by(u, h, 0) + negate_by(v, h, 1);
  } else if constexpr (kDims == 3) {
    const W8 h = hash & 15u;
    const F8 u = h < 8u ? d[0] : d[1];
    const I8 is_x = (h == 12u) | (h == 14u);
    const F8 other = is_x ? d[0] : d[2];
    const F8 v = h < 4u ? d[1] : other;
    return negate_by(u, h, 0) + negate_by(v, h, 1);
  } else {
    const W8 h = hash & 31u;
    const F8 u = h < 24u ? d[0] : d[1];
    const F8 v = h < 16u ? d[1] : d[2];
    const F8 s = h < 8u ? d[2] : d[3];
    return negate_by(u, h, 0) + negate_by(v, h, 1) + negate_by(s, h, 2);
  }
}

/// A coordinate of noise that repeats, so that there is a lattice however far away a point is.
RELIEF_KERNEL F8 noise_repeated(F8 x)
{
  constexpr float kPeriod = 100000.0f, kWhole = 1000000.0f;
  const I8 is_far = abs(x) >= kPeriod;
  if (mask_of(is_far) == 0) return x;
  for (int k = 0; k < 8; ++k) {
    // Where floats are whole numbers, points would all lie on the lattice, where noise is 0.
    const float off_lattice = __builtin_fabsf(x[k]) >= kWhole ? 0.5f : 0.0f;
    x[k] = std::fmod(x[k], kPeriod) + off_lattice;
  }
  return x;
}

/// Signed gradient noise, about −1 … 1; 0 where it is not finite.
/// @param at       any floats
/// @param repeats  every 100,000 units along each axis
template <int kDims>
RELIEF_KERNEL F8 noise_signed(const F8 (&at)[kDims], bool repeats = false)
{
  F8 p[kDims];
  for (int i = 0; i < kDims; ++i) p[i] = repeats ? noise_repeated(at[i]) : at[i];
  // Brings the ranges of the dimensions to one.
  constexpr float kScale[] = {0.25f, 0.6616f, 0.9820f, 0.8344f};
  W8 cell[kDims];
  F8 d[kDims], fade[kDims];
  for (int i = 0; i < kDims; ++i) {
    const F8 low = floor(p[i]);
    // Beyond the range of int all lanes' words are the same, and the noise is that of one cell: no lattice is left there.
    cell[i] = __builtin_bit_cast(W8, __builtin_convertvector(clamp(low, -2147483648.0f, 2147483520.0f), I8));
    d[i] = p[i] - low;
    fade[i] = d[i] * d[i] * d[i] * (d[i] * (d[i] * 6.0f - 15.0f) + 10.0f);
  }
  constexpr int kCorners = 1 << kDims;
  F8 value[kCorners];
  for (int corner = 0; corner < kCorners; ++corner) {
    W8 key[kDims];
    F8 from[kDims];
    for (int i = 0; i < kDims; ++i) {
      const std::uint32_t step = static_cast<std::uint32_t>(corner >> i) & 1u;
      key[i] = cell[i] + step;
      from[i] = d[i] - static_cast<float>(step);
    }
    value[corner] = noise_gradient<kDims>(hash_words(key), from);
  }
  for (int i = 0; i < kDims; ++i) {
    for (int k = 0; k < kCorners >> (i + 1); ++k) {
      value[k] = value[2 * k] * (1.0f - fade[i]) + value[2 * k + 1] * fade[i];
    }
  }
  const F8 noise = value[0] * kScale[kDims - 1];
  return abs(noise) < kInfinity ? noise : F8{};
}

/// What a sum of octaves looks like; each may differ between lanes.
struct NoiseOctaves {
  F8 detail;      ///< octaves beyond the first, [0, 15]; the last one by its fraction
  F8 roughness;   ///< size of an octave against the one before, >= 0
  F8 lacunarity;  ///< its frequency against that
};

/// Sum of octaves of signed noise.
/// @param normalize  in [0, 1] around ½, whatever the octaves; else as it comes
/// @param repeats    see noise_signed
template <int kDims>
RELIEF_KERNEL F8 noise_fractal(const F8 (&p)[kDims], const NoiseOctaves& octaves, bool normalize, bool repeats)
{
  const F8 whole = floor(octaves.detail);
  const F8 rest = octaves.detail - whole;
  float most = 0.0f;
  for (int k = 0; k < 8; ++k) most = whole[k] > most ? whole[k] : most;
  const bool any_rest = mask_of(rest != 0.0f) != 0;
  const int last = static_cast<int>(most) + (any_rest ? 1 : 0);
  F8 frequency = splat8(1.0f), amplitude = splat8(1.0f);
  F8 sum{}, sum_with_rest{}, size{}, size_with_rest{};
  for (int octave = 0; octave <= last; ++octave) {
    F8 scaled[kDims];
    for (int i = 0; i < kDims; ++i) scaled[i] = p[i] * frequency;
    const F8 noise = noise_signed<kDims>(scaled, repeats) * amplitude;
    const F8 n = splat8(static_cast<float>(octave));
    const I8 is_whole = n <= whole, is_rest = n == whole + 1.0f;
    sum_with_rest = is_rest ? sum + noise : sum_with_rest;
    size_with_rest = is_rest ? size + amplitude : size_with_rest;
    sum = is_whole ? sum + noise : sum;
    size = is_whole ? size + amplitude : size;
    amplitude *= octaves.roughness;
    frequency *= octaves.lacunarity;
  }
  if (normalize) {
    sum = 0.5f * sum / size + 0.5f;
    sum_with_rest = 0.5f * sum_with_rest / size_with_rest + 0.5f;
  }
  return rest != 0.0f ? (1.0f - rest) * sum + rest * sum_with_rest : sum;
}

}  // namespace relief
