// One point of the unit square for a choice and for a place on what is chosen: which light and where on it, which lobe and
// where in it. The first number chooses, and what the interval of the chosen one leaves of it is stretched to be half of the
// place. So the points on each light or lobe are as even as all points are: those of an interval of one coordinate of a net.
// Chosen by a number of its own, each would get a random part of the points, whose error falls as that of random ones:
// with four half shadowed lamps six times the variance at 64 samples and twenty times at 1,024.
#pragma once

#include <limits>

#include "kernel/sample/sobol.h"

namespace relief {

/// The point before the choice.
struct ChoicePoint {
  double x = 0;  ///< [0, 1): each choice uses up some of its bits
  float y = 0;   ///< [0, 1)
};

/// @param x_bits, y_bits  of a point of sample_2d
/// @return                x with digits after the thirty-second, which are as random in nested scrambling as these
RELIEF_KERNEL constexpr ChoicePoint choice_point(std::uint32_t x_bits, std::uint32_t y_bits)
{
  const std::uint64_t digits = static_cast<std::uint64_t>(x_bits) << 32 | hash_mix_32(x_bits ^ y_bits * 0x9e3779b1u);
  return {static_cast<double>(digits >> 11) * 0x1p-53, unit_float(y_bits)};
}

/// What a choice leaves of the number that it was made by: where in the interval of the chosen one it is.
/// @param rest   the number less what is before the interval; rounding may have put it outside
/// @param width  > 0, of the interval
/// @return       [0, 1)
template <class Real>
RELIEF_KERNEL constexpr Real choice_rest(Real rest, Real width)
{
  constexpr Real kBelowOne = 1 - std::numeric_limits<Real>::epsilon() / 2;
  const Real x = rest / width;
  return x > 0 ? (x < kBelowOne ? x : kBelowOne) : 0;
}

/// The place that a point is when all choices are made.
RELIEF_KERNEL constexpr Vec2f choice_place(ChoicePoint u)
{
  constexpr float kBelowOne = 1.0f - 0x1p-24f;
  return {min(static_cast<float>(u.x), kBelowOne), u.y};
}

}  // namespace relief
