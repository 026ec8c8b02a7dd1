// Bounds on floating-point rounding error.
#pragma once

#include "kernel/math/vec.h"

namespace relief {

/// Half the distance from 1 to the next float: the relative error of one rounded operation.
inline constexpr float kUnitRoundoff = 5.9604644775390625e-8f;

/// Bound on the relative error of n rounded operations in sequence.
/// @source Higham 2002, Lemma 3.1; pbrt-v4 §6.8.1
RELIEF_KERNEL constexpr float gamma_bound(int n)
{
  return static_cast<float>(n) * kUnitRoundoff / (1.0f - static_cast<float>(n) * kUnitRoundoff);
}

/// Least t_min of a ray that leaves a surface: Embree's robust mode counts t = t_min as a hit, and an origin that lies
/// exactly in its surface's plane (z = 0, say) has a hit at exactly 0.
inline constexpr float kLeastDistance = 1.17549435e-38f;

/// The next larger float. @pre x is finite and not negative
RELIEF_KERNEL constexpr float next_float_up(float x)
{
  return __builtin_bit_cast(float, __builtin_bit_cast(std::uint32_t, x) + 1u);
}

/// Least t_min of a ray that goes on behind a hit at t. Next to 0 a denormal would do, were they not flushed to 0 while rays are
/// traced: the hit would be found for ever.
/// @param t  not infinite, not NaN
RELIEF_KERNEL constexpr float t_min_behind(float t) { return t < kLeastDistance ? kLeastDistance : next_float_up(t); }

}  // namespace relief
