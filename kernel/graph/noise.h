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

/// The same of three dimensions, times kNoiseGradientUnit.
#ifdef __AVX2__
inline constexpr float kNoiseGradientUnit = 2.0f;
RELIEF_KERNEL F8 noise_gradient_by_table(W8 hash, const F8 (&d)[3])
{
  // Components are ±2 or 0: floats of which only the first byte is not 0, and a table of sixteen bytes is one instruction.
  constexpr char p = 0x40, n = static_cast<char>(0xc0);
  const W8 index = (hash & 15u) << 24 | 0x00808080u;
  const auto component = [index](__m128i of_hash) {
    const __m256i table = _mm256_broadcastsi128_si256(of_hash);
    return __builtin_bit_cast(F8, _mm256_shuffle_epi8(table, __builtin_bit_cast(__m256i, index)));
  };
  return component(_mm_setr_epi8(p, n, p, n, p, n, p, n, 0, 0, 0, 0, p, 0, n, 0)) * d[0] +
         component(_mm_setr_epi8(p, p, n, n, 0, 0, 0, 0, p, n, p, n, p, n, p, n)) * d[1] +
         component(_mm_setr_epi8(0, 0, 0, 0, p, p, n, n, p, p, n, n, 0, p, 0, n)) * d[2];
}
#else
inline constexpr float kNoiseGradientUnit = 1.0f;
RELIEF_KERNEL F8 noise_gradient_by_table(W8 hash, const F8 (&d)[3]) { return noise_gradient<3>(hash, d); }
#endif

/// Where a point is in its cell of the lattice.
template <int kDims>
struct NoiseCell {
  W8 low[kDims];   ///< its lower corner
  F8 d[kDims];     ///< from there, [0, 1)
  F8 fade[kDims];  ///< weight of the upper sides
};

/// Noise between the corners whose last kFixed axes are as in kCorner, a bit each, in units of their gradients' products. The
/// corners are no loop, which keeps nothing for the next and takes a quarter longer.
template <int kDims, int kFixed = 0, unsigned kCorner = 0>
[[gnu::always_inline]] RELIEF_KERNEL F8 noise_between(const NoiseCell<kDims>& cell)
{
  if constexpr (kFixed == kDims) {
    W8 key[kDims];
    F8 from[kDims];
    for (int i = 0; i < kDims; ++i) {
      key[i] = cell.low[i] + (kCorner >> i & 1u);
      from[i] = cell.d[i] - static_cast<float>(kCorner >> i & 1u);
    }
    if constexpr (kDims == 3)
      return noise_gradient_by_table(hash_words(key), from);
    else
      return noise_gradient<kDims>(hash_words(key), from);
  } else {
    constexpr int kAxis = kDims - 1 - kFixed;
    const F8 low = noise_between<kDims, kFixed + 1, kCorner>(cell);
    const F8 high = noise_between<kDims, kFixed + 1, kCorner | 1u << kAxis>(cell);
    return low * (1.0f - cell.fade[kAxis]) + high * cell.fade[kAxis];
  }
}

/// Noise that repeats does so every so many units, so that there is a lattice however far away a point is.
inline constexpr float kNoisePeriod = 100000.0f;

template <int kDims>
RELIEF_KERNEL F8 noise_repeated(const F8 (&at)[kDims]);

/// Signed gradient noise, about −1 … 1; 0 where it is not finite.
/// @param at       any floats
/// @param repeats  every kNoisePeriod along each axis
template <int kDims>
RELIEF_KERNEL F8 noise_signed(const F8 (&at)[kDims], bool repeats = false)
{
  if (repeats) {
    I8 is_far{};
    for (int i = 0; i < kDims; ++i) is_far |= abs(at[i]) >= kNoisePeriod;
    if (mask_of(is_far) != 0) [[unlikely]]
      return noise_repeated<kDims>(at);
  }
  // Brings the ranges of the dimensions to one.
  constexpr float kScale[] = {0.25f, 0.6616f, 0.9820f, 0.8344f};
  NoiseCell<kDims> cell;
  for (int i = 0; i < kDims; ++i) {
    const F8 low = floor(at[i]);
    // Beyond the range of int all lanes' words are the same, and the noise is that of one cell: no lattice is left there.
    cell.low[i] = __builtin_bit_cast(W8, __builtin_convertvector(clamp(low, -2147483648.0f, 2147483520.0f), I8));
    const F8 d = at[i] - low;
    cell.d[i] = d;
    cell.fade[i] = d * d * d * (d * (d * 6.0f - 15.0f) + 10.0f);
  }
  const F8 noise = noise_between<kDims>(cell) * (kScale[kDims - 1] / (kDims == 3 ? kNoiseGradientUnit : 1.0f));
  return abs(noise) < kInfinity ? noise : F8{};
}

/// The same of points some of which are a period away or more.
template <int kDims>
[[gnu::noinline]] RELIEF_KERNEL F8 noise_repeated(const F8 (&at)[kDims])
{
  constexpr float kWhole = 1000000.0f;
  F8 p[kDims];
  for (int i = 0; i < kDims; ++i) {
    p[i] = at[i];
    for (int k = 0; k < 8; ++k) {
      if (!(__builtin_fabsf(p[i][k]) >= kNoisePeriod)) continue;
      // Where floats are whole numbers, points would all lie on the lattice, where noise is 0.
      const float off_lattice = __builtin_fabsf(p[i][k]) >= kWhole ? 0.5f : 0.0f;
      p[i][k] = std::fmod(p[i][k], kNoisePeriod) + off_lattice;
    }
  }
  return noise_signed<kDims>(p);
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
