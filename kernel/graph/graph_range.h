// What is known of a value over a small parallelogram of a surface: c + ε₁·d1 + ε₂·d2 ± rest for ε in [−1, 1], and within
// [low, high]. Eight parallelograms at a time.
//
// The first form, affine in the two symbols, gets tight with the square of the parallelogram's size where a function is
// smooth (de Figueiredo and Stolfi 2004, "Affine arithmetic: concepts and applications", with all other symbols as one
// number); the second holds where it is not. Rounding of both is made good for in `rest` and in [low, high].
#pragma once

#include "kernel/math/lanes.h"
#include "kernel/math/lanes_functions.h"

namespace relief {

struct GraphRange {
  F8 c, d1, d2, rest;
  F8 low, high;
};

/// Part of a number that some operations in single precision, contracted or not, may be off by.
inline constexpr float kRangeRounding = 1e-6f;
/// Numbers this large are as good as unknown.
inline constexpr float kRangeLargest = 1e30f;

RELIEF_KERNEL F8 range_radius(const GraphRange& a) { return abs(a.d1) + abs(a.d2) + a.rest; }

/// Brings the two forms together; where one says nothing, neither does the affine form.
RELIEF_KERNEL GraphRange range_closed(GraphRange a)
{
  constexpr float kDenormal = 1e-36f;
  const F8 pad = kRangeRounding * (abs(a.c) + range_radius(a)) + kDenormal;
  a.rest += pad;
  const F8 radius = range_radius(a);
  a.low = max(a.low, a.c - radius - pad);
  a.high = min(a.high, a.c + radius + pad);
  // Also of what is not a number.
  const I8 known = (abs(a.c) < kRangeLargest) & (radius < kRangeLargest);
  const F8 zero{}, half = 0.5f * (a.high - a.low);
  const F8 middle = 0.5f * a.low + 0.5f * a.high;
  // The interval may be much narrower than the affine form.
  const I8 narrow = ~(radius <= 2.0f * half);
  const I8 by_interval = (narrow | ~known) & (abs(a.low) < kRangeLargest) & (abs(a.high) < kRangeLargest);
  a.c = by_interval ? middle : known ? a.c : zero;
  a.d1 = by_interval | ~known ? zero : a.d1;
  a.d2 = by_interval | ~known ? zero : a.d2;
  a.rest = by_interval ? half * (1.0f + kRangeRounding) + kRangeRounding * abs(middle)
           : known     ? a.rest
                       : splat8(kInfinity);
  a.low = a.low >= -kRangeLargest ? a.low : splat8(-kInfinity);
  a.high = a.high <= kRangeLargest ? a.high : splat8(kInfinity);
  return a;
}

/// Of numbers between two bounds. Neither NaN nor crossed bounds come through.
RELIEF_KERNEL GraphRange range_between(F8 low, F8 high)
{
  const I8 is_known = (low <= high) & (low >= -kRangeLargest) & (high <= kRangeLargest);
  const F8 infinite = splat8(kInfinity), zero{};
  const F8 middle = 0.5f * low + 0.5f * high;
  const F8 half = (0.5f * high - 0.5f * low) * (1.0f + kRangeRounding) + kRangeRounding * abs(middle);
  return {is_known ? middle : zero,
          zero,
          zero,
          is_known ? half : infinite,
          low >= -kRangeLargest ? low : -infinite,
          high <= kRangeLargest ? high : infinite};
}
RELIEF_KERNEL GraphRange range_point(F8 a) { return range_between(a, a); }
RELIEF_KERNEL GraphRange range_unknown() { return range_between(splat8(-kInfinity), splat8(kInfinity)); }

/// Lanes in which a value is one number.
RELIEF_KERNEL I8 range_is_point(const GraphRange& a) { return a.low == a.high; }

/// A little wider, by the rounding of a library's function.
RELIEF_KERNEL GraphRange range_padded(F8 low, F8 high)
{
  constexpr float kLibrary = 4e-6f, kLeast = 1e-30f;
  return range_between(low - (kLibrary * abs(low) + kLeast), high + (kLibrary * abs(high) + kLeast));
}

RELIEF_KERNEL GraphRange range_hull(const GraphRange& a, const GraphRange& b)
{
  return range_between(min(a.low, b.low), max(a.high, b.high));
}
/// One of two in each lane.
RELIEF_KERNEL GraphRange range_select(I8 is, const GraphRange& a, const GraphRange& b)
{
  return {is ? a.c : b.c,       is ? a.d1 : b.d1,   is ? a.d2 : b.d2,
          is ? a.rest : b.rest, is ? a.low : b.low, is ? a.high : b.high};
}
/// Within bounds that are known otherwise.
RELIEF_KERNEL GraphRange range_within(GraphRange a, F8 low, F8 high)
{
  a.low = max(a.low, low);
  a.high = min(a.high, high);
  return range_closed(a);
}

/// Sums and so on with an infinity are unknown rather than not a number.
RELIEF_KERNEL F8 range_low(F8 low) { return low > -kInfinity ? low : splat8(-kInfinity); }
RELIEF_KERNEL F8 range_high(F8 high) { return high < kInfinity ? high : splat8(kInfinity); }
RELIEF_KERNEL F8 range_down(F8 a) { return range_low(a - kRangeRounding * abs(a)); }
RELIEF_KERNEL F8 range_up(F8 a) { return range_high(a + kRangeRounding * abs(a)); }

RELIEF_KERNEL GraphRange operator+(const GraphRange& a, const GraphRange& b)
{
  const F8 size = kRangeRounding * (max(abs(a.low), abs(a.high)) + max(abs(b.low), abs(b.high)));
  return range_closed({a.c + b.c, a.d1 + b.d1, a.d2 + b.d2, a.rest + b.rest + size, range_low(a.low + b.low - size),
                       range_high(a.high + b.high + size)});
}
RELIEF_KERNEL GraphRange operator-(const GraphRange& a) { return {-a.c, -a.d1, -a.d2, a.rest, -a.high, -a.low}; }
RELIEF_KERNEL GraphRange operator-(const GraphRange& a, const GraphRange& b) { return a + -b; }
RELIEF_KERNEL GraphRange operator*(const GraphRange& a, const GraphRange& b)
{
  // 0 · ∞ is not a number. Between bounds it means 0; of a value that is 0 all over it may be any.
  const auto product = [](F8 x, F8 y) { return (x == 0.0f) | (y == 0.0f) ? F8{} : x * y; };
  const auto is_zero = [](const GraphRange& x) { return (x.low == 0.0f) & (x.high == 0.0f); };
  const auto is_bounded = [](const GraphRange& x) { return (x.low > -kInfinity) & (x.high < kInfinity); };
  const I8 is_none = (is_zero(a) & ~is_bounded(b)) | (is_zero(b) & ~is_bounded(a));
  const F8 p[4] = {product(a.low, b.low), product(a.low, b.high), product(a.high, b.low), product(a.high, b.high)};
  const F8 rest = abs(a.c) * b.rest + abs(b.c) * a.rest + range_radius(a) * range_radius(b);
  const GraphRange out = range_closed({a.c * b.c, a.c * b.d1 + b.c * a.d1, a.c * b.d2 + b.c * a.d2, rest,
                                       range_down(min(min(p[0], p[1]), min(p[2], p[3]))),
                                       range_up(max(max(p[0], p[1]), max(p[2], p[3])))});
  return range_select(is_none, range_unknown(), out);
}
RELIEF_KERNEL GraphRange operator*(const GraphRange& a, float k) { return a * range_point(splat8(k)); }
RELIEF_KERNEL GraphRange operator+(const GraphRange& a, float k) { return a + range_point(splat8(k)); }

/// A function by its value at the middle and its slopes between bounds: the mean value theorem.
/// @param at           f(a.c)
/// @param slopes       from low to high over [a.low, a.high]; not finite: the bounds say all
/// @param low, high    of f over [a.low, a.high]
RELIEF_KERNEL GraphRange range_of_function(const GraphRange& a, F8 at, F8 slope_low, F8 slope_high, F8 low, F8 high)
{
  const GraphRange bounds = range_padded(low, high);
  const F8 slope = 0.5f * slope_low + 0.5f * slope_high, radius = range_radius(a);
  const F8 rest =
      abs(slope) * a.rest + (0.5f * slope_high - 0.5f * slope_low) * radius + 4e-6f * (abs(at) + abs(slope) * radius);
  const GraphRange affine = range_closed({at, slope * a.d1, slope * a.d2, rest, bounds.low, bounds.high});
  return range_select(rest < kRangeLargest, affine, bounds);
}

/// A growing function whose slopes are not used.
RELIEF_KERNEL GraphRange range_of_monotone(F8 at_low, F8 at_high) { return range_padded(at_low, at_high); }

RELIEF_KERNEL GraphRange range_abs(const GraphRange& a)
{
  const I8 positive = a.low >= 0.0f, negative = a.high <= 0.0f;
  const F8 one = splat8(1.0f), low = min(abs(a.low), abs(a.high)), high = max(abs(a.low), abs(a.high));
  return range_of_function(a, abs(a.c), positive ? one : -one, negative ? -one : one, positive | negative ? low : F8{},
                           high);
}
/// (a + b − |a − b|) / 2, which keeps what both have in common.
RELIEF_KERNEL GraphRange range_min(const GraphRange& a, const GraphRange& b)
{
  const GraphRange both = (a + b - range_abs(a - b)) * 0.5f;
  const GraphRange mixed = range_within(both, min(a.low, b.low), min(a.high, b.high));
  return range_select(a.high <= b.low, a, range_select(b.high <= a.low, b, mixed));
}
RELIEF_KERNEL GraphRange range_max(const GraphRange& a, const GraphRange& b) { return -range_min(-a, -b); }

/// 1/a, and 0 of 0.
RELIEF_KERNEL GraphRange range_reciprocal(const GraphRange& a)
{
  const I8 apart = (a.low > 0.0f) | (a.high < 0.0f);
  const F8 one = splat8(1.0f), c = apart ? a.c : one, low = apart ? a.low : one, high = apart ? a.high : one;
  const F8 s0 = -1.0f / (low * low), s1 = -1.0f / (high * high);
  const GraphRange of = range_of_function(a, 1.0f / c, min(s0, s1), max(s0, s1), 1.0f / high, 1.0f / low);
  const GraphRange zero = range_point(F8{});
  return range_select(apart, of, range_select((a.low == 0.0f) & (a.high == 0.0f), zero, range_unknown()));
}

}  // namespace relief
