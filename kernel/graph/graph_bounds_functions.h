// What the ranges of opcodes are made of that are more than a line: graph_bounds.h has them all.
#pragma once

#include "kernel/graph/graph_eval.h"
#include "kernel/graph/graph_range_registers.h"
#include "kernel/graph/noise_range.h"
#include "kernel/graph/voronoi_range.h"

namespace relief {

/// One instruction's operands.
struct GraphRangeOperands {
  const GraphProgramView& program;
  const TextureView* textures;
  GraphRangeRegisters& registers;
  const std::uint16_t* immediates;
  const std::uint16_t* outputs;
  const std::uint16_t* inputs;
  const std::uint16_t*& next;  ///< instruction

  GraphRange in(int i) const { return graph_range_operand(program, registers, inputs[i]); }
  void set(int i, const GraphRange& value) const { registers.lanes[outputs[i]] = value; }
};

namespace graph_bounds {

RELIEF_KERNEL F8 each(F8 a, float (*f)(float))
{
  for (int k = 0; k < 8; ++k) a[k] = f(a[k]);
  return a;
}
RELIEF_KERNEL GraphRange unit() { return range_between(F8{}, splat8(1.0f)); }
/// 1 where it is sure, 0 where it is sure not.
RELIEF_KERNEL GraphRange truth(I8 surely, I8 never)
{
  return range_between(surely ? splat8(1.0f) : F8{}, never ? F8{} : splat8(1.0f));
}
/// Whether operands from `first` on are single numbers.
RELIEF_KERNEL bool are_points(const GraphRangeOperands& o, int first, int count)
{
  for (int i = first; i < first + count; ++i) {
    if (mask_of(range_is_point(o.in(i))) != 0xffu) return false;
  }
  return true;
}

RELIEF_KERNEL void power(const GraphRangeOperands& o)
{
  const GraphRange a = o.in(0), b = o.in(1);
  F8 low, high, at, slope_low, slope_high;
  for (int k = 0; k < 8; ++k) {
    const float a0 = a.low[k], a1 = a.high[k], b0 = b.low[k], b1 = b.high[k];
    low[k] = -kInfinity;
    high[k] = kInfinity;
    at[k] = 0.0f;
    slope_low[k] = -kInfinity;
    slope_high[k] = kInfinity;
    if (!(a0 > -kInfinity && a1 < kInfinity && b0 > -kInfinity && b1 < kInfinity)) continue;
    if (a0 > 0.0f) {
      const float p[4] = {graph_power(a0, b0), graph_power(a0, b1), graph_power(a1, b0), graph_power(a1, b1)};
      low[k] = min(min(p[0], p[1]), min(p[2], p[3]));
      high[k] = max(max(p[0], p[1]), max(p[2], p[3]));
      if (b0 != b1) continue;
      const float s0 = b0 * graph_power(a0, b0 - 1.0f), s1 = b0 * graph_power(a1, b0 - 1.0f);
      at[k] = graph_power(a.c[k], b0);
      slope_low[k] = min(s0, s1);
      slope_high[k] = max(s0, s1);
      // Between, powers of 1 turn; these are of 0.
      if (!(a.c[k] > 0.0f)) slope_high[k] = kInfinity;
    } else if (b0 == b1 && b0 > 0.0f) {
      const float most = graph_power(max(__builtin_fabsf(a0), __builtin_fabsf(a1)), b0);
      const bool is_even = __builtin_fmodf(b0, 2.0f) == 0.0f;
      low[k] = a0 == 0.0f || is_even ? 0.0f : -most;
      high[k] = most;
    } else if (b0 == 0.0f && b1 == 0.0f) {
      low[k] = high[k] = 1.0f;
    } else if (b0 >= 0.0f) {
      // Whole exponents among others that give 0 of what is negative.
      const float largest = max(__builtin_fabsf(a0), __builtin_fabsf(a1));
      high[k] = max(1.0f, max(graph_power(largest, b0), graph_power(largest, b1)));
      low[k] = a0 == 0.0f ? 0.0f : -high[k];
    }
  }
  o.set(0, range_of_function(a, at, slope_low, slope_high, low, high));
}

RELIEF_KERNEL void logarithm(const GraphRangeOperands& o)
{
  const GraphRange a = o.in(0), base = o.in(1);
  F8 low, high;
  for (int k = 0; k < 8; ++k) {
    // Between bases on one side of 1 both logarithms and their quotient are extreme at ends.
    const bool is_apart =
        base.low[k] > 1.0f || (base.low[k] > 0.0f && base.high[k] < 1.0f) || base.low[k] == base.high[k];
    const bool is_known = is_apart && base.high[k] < kInfinity && a.low[k] > 0.0f && a.high[k] < kInfinity;
    low[k] = is_known ? kInfinity : -kInfinity;
    high[k] = -low[k];
    for (int end = 0; is_known && end < 4; ++end) {
      const float value =
          graph_logarithm(end % 2 == 0 ? a.low[k] : a.high[k], end / 2 == 0 ? base.low[k] : base.high[k]);
      low[k] = min(low[k], value);
      high[k] = max(high[k], value);
    }
    if (a.high[k] <= 0.0f || base.high[k] <= 0.0f) low[k] = high[k] = 0.0f;
  }
  o.set(0, range_padded(low, high));
}

RELIEF_KERNEL void exponent(const GraphRangeOperands& o)
{
  const GraphRange a = o.in(0);
  const auto f = [](float x) { return std::exp(x); };
  const F8 low = each(a.low, f), high = each(a.high, f);
  o.set(0, range_of_function(a, each(a.c, f), low, high, low, high));
}

RELIEF_KERNEL void modulo(const GraphRangeOperands& o)
{
  const GraphRange a = o.in(0), b = o.in(1);
  const F8 size = max(abs(b.low), abs(b.high));
  // Within one period: a shift.
  F8 periods;
  I8 is_one;
  for (int k = 0; k < 8; ++k) {
    const float n0 = std::trunc(a.low[k] / b.low[k]), n1 = std::trunc(a.high[k] / b.low[k]);
    is_one[k] = b.low[k] == b.high[k] && n0 == n1 && __builtin_fabsf(n0) < 1e6f &&
                        __builtin_fabsf(std::fmod(a.low[k], b.low[k])) > 1e-4f * size[k] &&
                        __builtin_fabsf(std::fmod(a.high[k], b.low[k])) > 1e-4f * size[k]
                    ? -1
                    : 0;
    periods[k] = is_one[k] != 0 ? n0 : 0.0f;
  }
  const GraphRange shifted = a - range_point(is_one ? b.low : F8{}) * range_point(periods);
  const GraphRange whole = range_between(max(-size, min(a.low, F8{})), min(size, max(a.high, F8{})));
  o.set(0, range_select(is_one, shifted, whole));
}

/// Sine of an angle, or of one a quarter of a turn further.
RELIEF_KERNEL GraphRange sine_of(const GraphRange& a, double quarter)
{
  F8 low, high, at, slope_low, slope_high;
  constexpr double kTurn = 6.283185307179586, kHalf = 0.5 * kTurn;
  const auto extremes = [](double from, double to, float* least, float* most) {
    double s0 = std::sin(from), s1 = std::sin(to);
    *least = static_cast<float>(s0 < s1 ? s0 : s1);
    *most = static_cast<float>(s0 > s1 ? s0 : s1);
    // Crests at a quarter of a turn, valleys at three.
    if (std::floor((to - 0.25 * kTurn) / kTurn) != std::floor((from - 0.25 * kTurn) / kTurn)) *most = 1.0f;
    if (std::floor((to + 0.25 * kTurn) / kTurn) != std::floor((from + 0.25 * kTurn) / kTurn)) *least = -1.0f;
  };
  for (int k = 0; k < 8; ++k) {
    const double from = static_cast<double>(a.low[k]) + quarter, to = static_cast<double>(a.high[k]) + quarter;
    low[k] = -1.0f;
    high[k] = 1.0f;
    at[k] = 0.0f;
    slope_low[k] = -1.0f;
    slope_high[k] = 1.0f;
    if (!(to - from < kHalf && __builtin_fabs(from) < 1e6)) continue;
    float l, h;
    extremes(from, to, &l, &h);
    low[k] = l;
    high[k] = h;
    extremes(from + 0.25 * kTurn, to + 0.25 * kTurn, &l, &h);
    slope_low[k] = l;
    slope_high[k] = h;
    at[k] = static_cast<float>(std::sin(static_cast<double>(a.c[k]) + quarter));
  }
  const GraphRange wide = range_between(splat8(-1.0f), splat8(1.0f));
  const I8 known = (a.high - a.low < 3.0f) & (abs(a.low) < 1e6f);
  return range_select(known, range_of_function(a, at, slope_low, slope_high, low, high), wide);
}

RELIEF_KERNEL void tangent(const GraphRangeOperands& o)
{
  const GraphRange a = o.in(0);
  F8 low, high;
  for (int k = 0; k < 8; ++k) {
    constexpr double kHalf = 3.141592653589793;
    const double n0 = std::floor(static_cast<double>(a.low[k]) / kHalf + 0.499999);
    const bool known =
        a.high[k] < 1e6f && a.low[k] > -1e6f && n0 == std::floor(static_cast<double>(a.high[k]) / kHalf + 0.500001);
    low[k] = known ? std::tan(a.low[k]) : -kInfinity;
    high[k] = known ? std::tan(a.high[k]) : kInfinity;
  }
  o.set(0, range_padded(low, high));
}

RELIEF_KERNEL void arctangent2(const GraphRangeOperands& o)
{
  const GraphRange y = o.in(0), x = o.in(1);
  F8 low, high;
  for (int k = 0; k < 8; ++k) {
    low[k] = -3.1415930f;
    high[k] = 3.1415930f;
    const bool is_apart = x.low[k] > 0.0f || y.low[k] > 0.0f || y.high[k] < 0.0f;
    if (!is_apart ||
        !(x.low[k] > -kInfinity && x.high[k] < kInfinity && y.low[k] > -kInfinity && y.high[k] < kInfinity))
      continue;
    // Angles of a rectangle without the origin are extreme at its corners.
    const float p[4] = {std::atan2(y.low[k], x.low[k]), std::atan2(y.low[k], x.high[k]),
                        std::atan2(y.high[k], x.low[k]), std::atan2(y.high[k], x.high[k])};
    low[k] = min(min(p[0], p[1]), min(p[2], p[3]));
    high[k] = max(max(p[0], p[1]), max(p[2], p[3]));
  }
  o.set(0, range_padded(low, high));
}

/// A growing function.
RELIEF_KERNEL void growing(const GraphRangeOperands& o, float (*f)(float))
{
  const GraphRange a = o.in(0);
  o.set(0, range_padded(each(a.low, f), each(a.high, f)));
}

RELIEF_KERNEL void table(const GraphRangeOperands& o)
{
  const float* table = o.program.tables + (o.immediates[0] | std::uint32_t{o.immediates[1]} << 16);
  const int last = o.immediates[2] - 1;
  const bool interpolated = o.immediates[3] != 0, goes_on = o.immediates[4] != 0 && last > 0;
  const GraphRange a = o.in(0);
  F8 low, high, at, slope_low, slope_high;
  for (int k = 0; k < 8; ++k) {
    low[k] = -kInfinity;
    high[k] = kInfinity;
    at[k] = slope_low[k] = 0.0f;
    slope_high[k] = kInfinity;
    const bool beyond = !(a.low[k] >= 0.0f && a.high[k] <= 1.0f);
    if (!(a.low[k] <= a.high[k])) continue;
    if (goes_on && !(a.low[k] > -kInfinity && a.high[k] < kInfinity)) continue;
    const auto place = [&](float x) { return clamp(x, 0.0f, 1.0f) * static_cast<float>(last); };
    const int first = static_cast<int>(place(a.low[k]) - 1e-3f), end = static_cast<int>(place(a.high[k]) + 1e-3f) + 1;
    const int from = first > 0 ? first : 0, to = end < last ? end : last;
    low[k] = high[k] = table[from];
    float s0 = kInfinity, s1 = -kInfinity;
    for (int i = from + 1; i <= to; ++i) {
      low[k] = min(low[k], table[i]);
      high[k] = max(high[k], table[i]);
      const float slope = (table[i] - table[i - 1]) * static_cast<float>(last);
      s0 = min(s0, slope);
      s1 = max(s1, slope);
    }
    if (goes_on && beyond) {
      // Straight on from either end.
      const float before = min(a.low[k], 0.0f) * static_cast<float>(last);
      const float after = (max(a.high[k], 1.0f) - 1.0f) * static_cast<float>(last);
      const float ends[2] = {table[0] + (table[1] - table[0]) * before,
                             table[last] + (table[last] - table[last - 1]) * after};
      for (const float value : ends) {
        low[k] = min(low[k], value);
        high[k] = max(high[k], value);
      }
    }
    if (!interpolated || beyond || from == to) continue;
    const float c = place(a.c[k]);
    const int i = static_cast<int>(c) < last - 1 ? static_cast<int>(c) : last - 1;
    at[k] = table[i] + (table[i + 1] - table[i]) * (c - static_cast<float>(i));
    slope_low[k] = s0;
    slope_high[k] = s1;
  }
  o.set(0, range_of_function(a, at, slope_low, slope_high, low, high));
}

/// How large octaves are together, each smaller by a factor than the one before.
/// @param last  number of the last one, rounded up; < 32
RELIEF_KERNEL F8 sum_of_octaves(F8 last, F8 factor)
{
  F8 sum = splat8(1.0f), amplitude = sum;
  for (int n = 1; n < 32; ++n) {
    amplitude *= factor;
    sum += last > static_cast<float>(n - 1) ? amplitude : F8{};
  }
  return sum;
}

template <int kDims>
RELIEF_KERNEL void noise(const GraphRangeOperands& o)
{
  GraphRange p[kDims];
  for (int i = 0; i < kDims; ++i) p[i] = o.in(i);
  if (!are_points(o, kDims, 3)) {
    // Normalized sums keep within what one octave does.
    const F8 most = splat8(0.5f * kNoiseLargest[kDims - 1]);
    if (o.immediates[0] != 0) return o.set(0, range_between(0.5f - most, 0.5f + most));
    const F8 all = 2.0f * most * sum_of_octaves(clamp(o.in(kDims).high, 0.0f, 15.0f), max(o.in(kDims + 1).high, F8{}));
    return o.set(0, range_between(-all, all));
  }
  const NoiseOctaves octaves{clamp(o.in(kDims).low, 0.0f, 15.0f), max(o.in(kDims + 1).low, F8{}), o.in(kDims + 2).low};
  o.set(0, noise_fractal_range<kDims>(p, octaves, o.immediates[0] != 0, o.immediates[1] != 0));
}

template <int kDims>
RELIEF_KERNEL void signed_noise(const GraphRangeOperands& o)
{
  GraphRange p[kDims];
  for (int i = 0; i < kDims; ++i) p[i] = o.in(i);
  o.set(0, noise_signed_range<kDims>(p, o.immediates[0] != 0));
}

/// Bounds of Musgrave's noises by how large an octave is, which hold however their settings vary.
RELIEF_KERNEL GraphRange musgrave_whole(const GraphRangeOperands& o, int num_dims)
{
  const auto size_of = [](const GraphRange& a) { return max(abs(a.low), abs(a.high)); };
  const F8 noise = splat8(kNoiseLargest[num_dims - 1]), last = clamp(o.in(num_dims).high, 0.0f, 16.0f);
  const F8 falloff = size_of(o.in(num_dims + 1)), lifted = noise + size_of(o.in(num_dims + 3));
  const auto type = static_cast<MusgraveType>(o.immediates[0]);
  const bool multiplies = type == MusgraveType::kMultifractal || type == MusgraveType::kHeteroTerrain;
  if (!multiplies) {
    // Weights of octaves are at most 1.
    const F8 one = type == MusgraveType::kFbm ? noise : type == MusgraveType::kHybrid ? lifted : lifted * lifted;
    const F8 all = one * sum_of_octaves(last + 1.0f, falloff);
    return range_between(-all, all);
  }
  const F8 step = type == MusgraveType::kMultifractal ? noise : lifted;
  F8 product = type == MusgraveType::kMultifractal ? splat8(1.0f) : lifted, size = splat8(1.0f);
  for (int n = 0; n <= 17; ++n) {
    product *= last + 1.0f >= static_cast<float>(n) ? 1.0f + step * size : splat8(1.0f);
    size *= falloff;
  }
  return range_between(-product, product);
}

template <int kDims>
RELIEF_KERNEL void musgrave(const GraphRangeOperands& o)
{
  if (!are_points(o, kDims, 5)) return o.set(0, musgrave_whole(o, kDims));
  GraphRange p[kDims];
  for (int i = 0; i < kDims; ++i) p[i] = o.in(i);
  const MusgraveSettings settings{clamp(o.in(kDims).low, 0.0f, 16.0f),
                                  o.in(kDims + 1).low,
                                  o.in(kDims + 2).low,
                                  o.in(kDims + 3).low,
                                  o.in(kDims + 4).low,
                                  o.immediates[1] != 0};
  o.set(0, musgrave_range<kDims>(p, static_cast<MusgraveType>(o.immediates[0]), settings));
}

template <int kDims>
RELIEF_KERNEL void hash(const GraphRangeOperands& o)
{
  if (!are_points(o, 0, kDims)) return o.set(0, unit());
  F8 key[kDims];
  for (int i = 0; i < kDims; ++i) key[i] = o.in(i).low;
  o.set(0, range_padded(hash_unit(key), hash_unit(key)));
}

template <int kDims>
RELIEF_KERNEL void voronoi(const GraphRangeOperands& o)
{
  GraphRange p[kDims], settings_of[6], out[9];
  for (int i = 0; i < kDims; ++i) p[i] = o.in(i);
  for (int i = 0; i < 6; ++i) settings_of[i] = o.in(kDims + i);
  const auto feature = static_cast<VoronoiFeature>(o.immediates[0]);
  const auto metric = static_cast<VoronoiMetric>(o.immediates[1]);
  const unsigned flags = o.immediates[2];
  voronoi_whole<kDims>(p, feature, metric, (flags & kVoronoiNormalize) != 0, settings_of, out);
  if (are_points(o, kDims, 6)) {
    const NoiseOctaves octaves{clamp(o.in(kDims + 3).low, 0.0f, 15.0f), clamp(o.in(kDims + 4).low, 0.0f, 1.0f),
                               o.in(kDims + 5).low};
    const auto eval = [&]<bool kPcg>() {
      const VoronoiSettings<kDims, kPcg> settings{
          feature, metric, o.in(kDims).low, o.in(kDims + 1).low, o.in(kDims + 2).low, flags};
      return voronoi_range<kDims, kPcg>(p, settings, octaves);
    };
    const bool is_pcg = (flags & kVoronoiPcg) != 0 && kDims > 1;
    const GraphRange distance = is_pcg ? eval.template operator()<true>() : eval.template operator()<false>();
    const I8 is_known = (distance.low > -kInfinity) & (distance.high < kInfinity);
    out[0] = out[8] = range_select(is_known, distance, out[0]);
  }
  for (int i = 0; i < 9; ++i) o.set(i, out[i]);
}

/// Three numbers that are known where those that they are made of are.
RELIEF_KERNEL void color(const GraphRangeOperands& o, Vec3f (*f)(Vec3f), const GraphRange (&known)[3])
{
  GraphRange out[3] = {known[0], known[1], known[2]};
  if (are_points(o, 0, 3)) {
    const F8 c[3] = {o.in(0).low, o.in(1).low, o.in(2).low};
    F8 of[3];
    for (int k = 0; k < 8; ++k) {
      const Vec3f v = f({c[0][k], c[1][k], c[2][k]});
      of[0][k] = v.x;
      of[1][k] = v.y;
      of[2][k] = v.z;
    }
    for (int i = 0; i < 3; ++i) out[i] = range_padded(of[i], of[i]);
  }
  for (int i = 0; i < 3; ++i) o.set(i, out[i]);
}

RELIEF_KERNEL void to_hues(const GraphRangeOperands& o, Vec3f (*f)(Vec3f), bool is_lightness)
{
  const GraphRange r = o.in(0), g = o.in(1), b = o.in(2);
  const GraphRange most = range_max(range_max(r, g), b), least = range_min(range_min(r, g), b);
  const I8 is_color = is_lightness ? (least.low >= 0.0f) & (most.high <= 1.0f) : least.low >= 0.0f;
  const GraphRange saturation = range_select(is_color, unit(), range_unknown());
  const GraphRange hue = range_between(F8{}, splat8(1.0001f));
  const GraphRange light = is_lightness ? range_min((most + least) * 0.5f, range_point(splat8(1.0f))) : most;
  const GraphRange known[3] = {hue, saturation, light};
  color(o, f, known);
}

RELIEF_KERNEL void from_hues(const GraphRangeOperands& o, Vec3f (*f)(Vec3f), bool is_lightness)
{
  const GraphRange saturation = o.in(1), light = o.in(2), one = range_point(splat8(1.0f));
  GraphRange all;
  if (is_lightness) {
    const GraphRange chroma = (one - range_abs(light * 2.0f - one)) * saturation;
    all = light + range_between(splat8(-0.5f), splat8(0.5f)) * chroma;
  } else {
    // Between the value and what is left of it without saturation.
    all = range_hull(light, light * (one - saturation));
  }
  const GraphRange known[3] = {all, all, all};
  color(o, f, known);
}

/// What an image can give.
/// @param flags  ImageFlags
RELIEF_KERNEL GraphRange of_texels(const TextureView& texture, std::uint16_t flags)
{
  // Colours that are divided by opacity may be anything.
  const bool is_unit = texture.format != TexelFormat::kHalf && (flags & kImageDivide) == 0;
  return is_unit ? range_between(splat8(-1e-4f), splat8(1.0001f)) : range_unknown();
}
/// What an image gives over rectangles of coordinates, one a lane.
/// @param u, v  v up
RELIEF_KERNEL void image_ranges(const GraphRangeOperands& o,
                                int texture_index,
                                const GraphRange& u,
                                const GraphRange& v,
                                bool is_finest,
                                unsigned flags,
                                GraphRange (&rgba)[4])
{
  const TextureView& texture = o.textures[texture_index];
  const ImageBounds bounds = o.registers.images != nullptr ? o.registers.images[texture_index] : ImageBounds{};
  if (bounds.num_levels == 0) {
    for (GraphRange& channel : rgba) channel = of_texels(texture, static_cast<std::uint16_t>(flags));
    return;
  }
  F8 low[4], high[4];
  for (int k = 0; k < 8; ++k) {
    const float us[2] = {u.low[k], u.high[k]}, vs[2] = {v.low[k], v.high[k]};
    const TexelRange range = image_range(texture, bounds, us, vs, is_finest, flags);
    for (int c = 0; c < 4; ++c) {
      // Rounding of the sixteen products of a filter, which is relative to the largest.
      const float pad = 4e-6f * max(__builtin_fabsf(range.low[c]), __builtin_fabsf(range.high[c]));
      low[c][k] = range.low[c] - pad;
      high[c][k] = range.high[c] + pad;
    }
  }
  for (int c = 0; c < 4; ++c) rgba[c] = range_padded(low[c], high[c]);
}

RELIEF_KERNEL void image(const GraphRangeOperands& o)
{
  GraphRange rgba[4];
  const I8 is_point = (o.in(2).low == 0.0f) & (o.in(2).high == 0.0f);
  image_ranges(o, o.immediates[0], o.in(0), o.in(1), mask_of(is_point) == 0xffu, o.immediates[1], rgba);
  for (int c = 0; c < 4; ++c) o.set(c, rgba[c]);
}

/// Of the sides of a box, whose shares add up to 1; each may be mirrored.
RELIEF_KERNEL void image_box(const GraphRangeOperands& o)
{
  const GraphRange one = range_point(splat8(1.0f)), p[3] = {o.in(0), o.in(1), o.in(2)};
  constexpr int kSides[3][2] = {{1, 2}, {0, 2}, {1, 0}};
  GraphRange sides[3][4];
  for (int side = 0; side < 3; ++side) {
    const GraphRange& u = p[kSides[side][0]];
    image_ranges(o, o.immediates[0], range_hull(u, one - u), p[kSides[side][1]], true, o.immediates[1], sides[side]);
  }
  for (int c = 0; c < 4; ++c) o.set(c, range_hull(range_hull(sides[0][c], sides[1][c]), sides[2][c]));
}

/// Of all tiles that a rectangle may reach, and of what is missing.
RELIEF_KERNEL void image_tiles(const GraphRangeOperands& o)
{
  const float* tiles = o.program.tables + (o.immediates[2] | std::uint32_t{o.immediates[3]} << 16);
  const I8 is_point = (o.in(2).low == 0.0f) & (o.in(2).high == 0.0f);
  const bool is_finest = mask_of(is_point) == 0xffu;
  const GraphRange u = o.in(0), v = o.in(1);
  GraphRange all[4];
  const float missing[4] = {kMissingImage.x, kMissingImage.y, kMissingImage.z, kMissingImage.w};
  for (int c = 0; c < 4; ++c) all[c] = range_point(splat8(missing[c]));
  for (int row = 0; row < o.immediates[1]; ++row) {
    for (int column = 0; column < kImageTileColumns; ++column) {
      const float tile = tiles[row * kImageTileColumns + column];
      if (tile < 0.0f) continue;
      const auto within = [](const GraphRange& at, int number, F8& low, F8& high) {
        const auto first = static_cast<float>(number);
        const F8 least = splat8(number == 0 ? -1.0f : 0.0f), most = splat8(1.0f);
        low = max(at.low - first, least);
        high = min(at.high - first, most);
        return low <= high;
      };
      F8 u0, u1, v0, v1;
      const I8 is_met = within(u, column, u0, u1) & within(v, row, v0, v1);
      if (mask_of(is_met) == 0) continue;
      const I8 is_single = (u.low >= static_cast<float>(column)) & (u.high < static_cast<float>(column + 1)) &
                           (v.low >= static_cast<float>(row)) & (v.high < static_cast<float>(row + 1));
      GraphRange of_tile[4];
      const F8 zero{};
      image_ranges(o, static_cast<int>(tile), range_between(is_met ? u0 : zero, is_met ? u1 : zero),
                   range_between(is_met ? v0 : zero, is_met ? v1 : zero), is_finest, o.immediates[0], of_tile);
      for (int c = 0; c < 4; ++c) {
        const GraphRange met = range_select(is_single, of_tile[c], range_hull(all[c], of_tile[c]));
        all[c] = range_select(is_met, met, all[c]);
      }
    }
  }
  for (int c = 0; c < 4; ++c) o.set(c, all[c]);
}

RELIEF_KERNEL void voxels(const GraphRangeOperands& o)
{
  const VoxelView& v = o.program.voxels[o.immediates[0]];
  const Affine3& m = v.lattice_from_object;
  const auto axis = [&](float x, float y, float z, float p) {
    const auto number = [](float a) { return range_point(splat8(a)); };
    return o.in(0) * number(x) + o.in(1) * number(y) + o.in(2) * number(z) + number(p);
  };
  const GraphRange at[3] = {axis(m.x.x, m.y.x, m.z.x, m.p.x), axis(m.x.y, m.y.y, m.z.y, m.p.y),
                            axis(m.x.z, m.y.z, m.z.z, m.p.z)};
  F8 low[3], high[3];
  for (int k = 0; k < 8; ++k) {
    const VoxelRange range =
        voxels_range(v, {at[0].low[k], at[1].low[k], at[2].low[k]}, {at[0].high[k], at[1].high[k], at[2].high[k]});
    const float lows[3] = {range.low.x, range.low.y, range.low.z},
                highs[3] = {range.high.x, range.high.y, range.high.z};
    for (int c = 0; c < 3; ++c) {
      low[c][k] = lows[c];
      high[c][k] = highs[c];
    }
  }
  for (int c = 0; c < 3; ++c) o.set(c, range_padded(low[c], high[c]));
}

RELIEF_KERNEL void set_all(const GraphRangeOperands& o, int count, const GraphRange& value)
{
  for (int i = 0; i < count; ++i) o.set(i, value);
}

RELIEF_KERNEL void grid(const GraphRangeOperands& o)
{
  const float* table = o.program.tables + (o.immediates[0] | std::uint32_t{o.immediates[1]} << 16);
  const int count = o.immediates[2] * o.immediates[3];
  for (int c = 0; c < 3; ++c) {
    float low = table[c], high = low;
    for (int i = 1; i < count; ++i) {
      low = min(low, table[3 * i + c]);
      high = max(high, table[3 * i + c]);
    }
    o.set(c, range_padded(splat8(low), splat8(high)));
  }
}

}  // namespace graph_bounds

}  // namespace relief
