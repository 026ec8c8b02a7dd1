// Bounds of gradient noise and of sums of its octaves over small parallelograms.
//
// The noise has continuous second derivatives, also from one cell of its lattice to the next, so that its plane at the
// middle and their largest size bound it, wherever the parallelogram reaches.
#pragma once

#include "kernel/graph/graph_range.h"
#include "kernel/graph/musgrave.h"

namespace relief {

/// Noise at a point with its slopes.
template <int kDims>
struct NoiseSlopes {
  F8 value, slope[kDims];
};

/// As noise_signed, of points that are no farther away than its lattice.
template <int kDims>
RELIEF_KERNEL NoiseSlopes<kDims> noise_slopes(const F8 (&p)[kDims])
{
  constexpr float kScale[] = {0.25f, 0.6616f, 0.9820f, 0.8344f};
  W8 cell[kDims];
  F8 d[kDims], fade[kDims], fade_slope[kDims];
  for (int i = 0; i < kDims; ++i) {
    const F8 low = floor(p[i]);
    cell[i] = __builtin_bit_cast(W8, __builtin_convertvector(low, I8));
    d[i] = p[i] - low;
    fade[i] = d[i] * d[i] * d[i] * (d[i] * (d[i] * 6.0f - 15.0f) + 10.0f);
    fade_slope[i] = 30.0f * d[i] * d[i] * (d[i] * (d[i] - 2.0f) + 1.0f);
  }
  constexpr int kCorners = 1 << kDims;
  F8 value[kCorners], slope[kCorners][kDims];
  for (int corner = 0; corner < kCorners; ++corner) {
    W8 key[kDims];
    F8 from[kDims];
    for (int i = 0; i < kDims; ++i) {
      const std::uint32_t step = static_cast<std::uint32_t>(corner >> i) & 1u;
      key[i] = cell[i] + step;
      from[i] = d[i] - static_cast<float>(step);
    }
    const W8 hash = hash_words(key);
    value[corner] = noise_gradient<kDims>(hash, from);
    for (int axis = 0; axis < kDims; ++axis) {
      F8 unit[kDims];
      for (int i = 0; i < kDims; ++i) unit[i] = splat8(i == axis ? 1.0f : 0.0f);
      slope[corner][axis] = noise_gradient<kDims>(hash, unit);
    }
  }
  for (int i = 0; i < kDims; ++i) {
    for (int k = 0; k < kCorners >> (i + 1); ++k) {
      const F8 step = value[2 * k + 1] - value[2 * k];
      for (int axis = 0; axis < kDims; ++axis) {
        slope[k][axis] = slope[2 * k][axis] * (1.0f - fade[i]) + slope[2 * k + 1][axis] * fade[i];
      }
      slope[k][i] += step * fade_slope[i];
      value[k] = value[2 * k] * (1.0f - fade[i]) + value[2 * k + 1] * fade[i];
    }
  }
  NoiseSlopes<kDims> out;
  out.value = value[0] * kScale[kDims - 1];
  for (int axis = 0; axis < kDims; ++axis) out.slope[axis] = slope[0][axis] * kScale[kDims - 1];
  return out;
}

/// How large signed noise, its slope along an axis and its second derivatives get: of one to four dimensions. Largest sums over
/// the corners of a cell, each with its worst gradient, at 10⁴, 10⁶, 8·10⁶ and 4·10⁶ points of the cell, and 1 % more
/// (GraphBounds.NoiseIsNoSteeperThanTheySay).
inline constexpr float kNoiseLargest[] = {1.01f, 1.01f, 1.03f, 1.30f};
inline constexpr float kNoiseSlope[] = {2.73f, 3.10f, 3.73f, 4.75f};
inline constexpr float kNoiseBend[] = {15.2f, 11.8f, 12.0f, 15.0f};
inline constexpr float kNoiseTwist[] = {0.0f, 7.9f, 10.8f, 14.9f};

/// @param p  coordinates
template <int kDims>
RELIEF_KERNEL GraphRange noise_signed_range(const GraphRange (&p)[kDims], bool repeats)
{
  constexpr float kBound = kNoiseLargest[kDims - 1], kMostNear = 90000.0f, kMostRadius = 1.0f;
  // Beyond, noise is that of a lattice that begins anew, or of none.
  I8 is_near = splat8(0.0f) == 0.0f;
  F8 c[kDims], radius[kDims], widest{};
  for (int i = 0; i < kDims; ++i) {
    radius[i] = range_radius(p[i]) + 4.0f * kRangeRounding * abs(p[i].c);
    widest = max(widest, radius[i]);
    is_near &= (abs(p[i].c) + radius[i] <= kMostNear) & (radius[i] <= kMostRadius);
  }
  const GraphRange whole = range_between(splat8(-kBound), splat8(kBound));
  static_cast<void>(repeats);
  if (mask_of(is_near) == 0) return whole;
  for (int i = 0; i < kDims; ++i) c[i] = is_near ? p[i].c : F8{};
  const NoiseSlopes<kDims> at = noise_slopes<kDims>(c);
  F8 d1{}, d2{}, rest{}, steep{}, bent{};
  for (int i = 0; i < kDims; ++i) {
    d1 += at.slope[i] * p[i].d1;
    d2 += at.slope[i] * p[i].d2;
    rest += abs(at.slope[i]) * (p[i].rest + 4.0f * kRangeRounding * abs(p[i].c));
    steep += kNoiseSlope[kDims - 1] * radius[i];
    bent += 0.5f * kNoiseBend[kDims - 1] * radius[i] * radius[i];
    for (int j = 0; j < i; ++j) bent += kNoiseTwist[kDims - 1] * radius[i] * radius[j];
  }
  const F8 rounding = splat8(4e-6f);
  GraphRange out =
      range_closed({at.value, d1, d2, rest + bent + rounding, max(splat8(-kBound), at.value - steep - rounding),
                    min(splat8(kBound), at.value + steep + rounding)});
  return range_select(is_near, out, whole);
}

/// As noise_fractal, with settings that are the same all over.
template <int kDims>
RELIEF_KERNEL GraphRange
noise_fractal_range(const GraphRange (&p)[kDims], const NoiseOctaves& octaves, bool normalize, bool repeats)
{
  const F8 whole = floor(octaves.detail), rest = octaves.detail - whole;
  float most = 0.0f;
  for (int k = 0; k < 8; ++k) most = whole[k] > most ? whole[k] : most;
  const bool any_rest = mask_of(rest != 0.0f) != 0;
  const int last = static_cast<int>(most) + (any_rest ? 1 : 0);
  F8 frequency = splat8(1.0f), amplitude = splat8(1.0f), size{}, size_with_rest{};
  GraphRange sum = range_point(F8{}), sum_with_rest = sum;
  for (int octave = 0; octave <= last; ++octave) {
    GraphRange scaled[kDims];
    for (int i = 0; i < kDims; ++i) scaled[i] = p[i] * range_point(frequency);
    const GraphRange noise = noise_signed_range<kDims>(scaled, repeats) * range_point(amplitude);
    const F8 n = splat8(static_cast<float>(octave));
    const I8 is_whole = n <= whole, is_rest = n == whole + 1.0f;
    const GraphRange next = sum + noise;
    sum_with_rest = range_select(is_rest, next, sum_with_rest);
    size_with_rest = is_rest ? size + amplitude : size_with_rest;
    sum = range_select(is_whole, next, sum);
    size = is_whole ? size + amplitude : size;
    amplitude *= octaves.roughness;
    frequency *= octaves.lacunarity;
  }
  if (normalize) {
    sum = sum * range_point(0.5f / size) + 0.5f;
    sum_with_rest = sum_with_rest * range_point(size_with_rest > 0.0f ? 0.5f / size_with_rest : F8{}) + 0.5f;
  }
  const GraphRange mixed = sum * range_point(1.0f - rest) + sum_with_rest * range_point(rest);
  return range_select(rest != 0.0f, mixed, sum);
}

/// As musgrave_eval, with settings that are the same all over.
template <int kDims>
RELIEF_KERNEL GraphRange musgrave_range(const GraphRange (&point)[kDims], MusgraveType type, const MusgraveSettings& s)
{
  const F8 whole = floor(s.octaves), rest = s.octaves - whole;
  float most = 0.0f;
  for (int k = 0; k < 8; ++k) most = whole[k] > most ? whole[k] : most;
  const bool is_hetero = type == MusgraveType::kHeteroTerrain, is_ridged = type == MusgraveType::kRidged;
  const F8 rest_at = is_hetero ? max(whole, splat8(1.0f)) : whole;
  const int last = is_hetero && most < 1.0f ? 1 : static_cast<int>(most);
  GraphRange p[kDims];
  for (int i = 0; i < kDims; ++i) p[i] = point[i];
  const GraphRange one = range_point(splat8(1.0f)), offset = range_point(s.offset), gain = range_point(s.gain);
  const GraphRange lacunarity = range_point(s.lacunarity);
  F8 size_at = splat8(1.0f);
  GraphRange weight = one, signal = range_point(F8{});
  GraphRange value = type == MusgraveType::kMultifractal ? one : signal;
  for (int octave = 0; octave <= last; ++octave) {
    const F8 n = splat8(static_cast<float>(octave));
    const bool is_base = octave == 0 && (is_hetero || is_ridged);
    const F8 share_at = is_base ? splat8(1.0f) : n < whole ? splat8(1.0f) : n == rest_at ? rest : F8{};
    const GraphRange share = range_point(share_at), size = range_point(size_at);
    const GraphRange noise = noise_signed_range<kDims>(p, s.repeats);
    switch (type) {
      case MusgraveType::kMultifractal:
        value = value * (share * size * noise + 1.0f);
        break;
      case MusgraveType::kFbm:
        value = value + share * noise * size;
        break;
      case MusgraveType::kHybrid: {
        // Where the weight may fall below .001, octaves may be there or not.
        const I8 surely = weight.low > 0.00101f, never = weight.high <= 0.00099f;
        const GraphRange alive =
            range_select(surely, share, range_select(never, range_point(F8{}), range_between(F8{}, share_at)));
        weight = range_min(weight, one);
        signal = (noise + offset) * size;
        value = value + alive * weight * signal;
        const GraphRange next = weight * gain * signal;
        weight = range_select(surely & (share_at > 0.0f), next, range_hull(next, range_point(F8{})));
        break;
      }
      case MusgraveType::kRidged: {
        const GraphRange counted = range_point(is_base ? splat8(1.0f) : n < whole ? splat8(1.0f) : F8{});
        weight = is_base ? one : range_max(range_min(signal * gain, one), range_point(F8{}));
        const GraphRange ridge = offset - range_abs(noise);
        const GraphRange square = range_within(ridge * ridge, F8{}, splat8(kInfinity));
        signal = square * weight;
        value = value + counted * signal * size;
        break;
      }
      case MusgraveType::kHeteroTerrain:
        value = is_base ? offset + noise : value + share * (noise + offset) * size * value;
        break;
    }
    size_at *= s.falloff;
    for (int i = 0; i < kDims; ++i) p[i] = p[i] * lacunarity;
  }
  return value;
}

}  // namespace relief
