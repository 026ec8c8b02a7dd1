// Sines, exponentials and logarithms of eight floats at a time.
//
// Polynomials and splits of constants: Moshier, Cephes library, sinf, cosf, expf and logf.
#pragma once

#include <cmath>

#include "kernel/math/lanes.h"
#include "kernel/math/vec.h"

namespace relief {

struct SinCos8 {
  F8 sin, cos;
};

/// @param x         in [−π/4, π/4]
/// @param quarters  whole: quarters of a turn that are added
RELIEF_KERNEL SinCos8 sin_cos_octant(F8 x, F8 quarters)
{
  const F8 z = x * x;
  const F8 sine = x + x * z * (-1.6666654611e-1f + z * (8.3321608736e-3f + z * -1.9515295891e-4f));
  const F8 cosine =
      1.0f - 0.5f * z + z * z * (4.166664568298827e-2f + z * (-1.388731625493765e-3f + z * 2.443315711809948e-5f));
  const I8 quadrant = __builtin_convertvector(quarters, I8) & 3;
  const I8 is_odd = (quadrant & 1) != 0;
  const F8 s = is_odd ? cosine : sine, c = is_odd ? sine : cosine;
  return {(quadrant & 2) != 0 ? -s : s, ((quadrant == 1) | (quadrant == 2)) ? -c : c};
}

/// @param turn  angles as fractions of a turn, |turn| < 2^20
/// @return      within 1e-7 of the truth
RELIEF_KERNEL SinCos8 sin_cos_turn(F8 turn)
{
  const F8 quarters = floor(4.0f * turn + 0.5f);
  return sin_cos_octant((turn - 0.25f * quarters) * (2.0f * kPi), quarters);
}

/// Sines and cosines of angles below this need no exact reduction.
inline constexpr float kLargestAngle = 8192.0f;

/// @param x  radians, |x| <= kLargestAngle
/// @return   within 2e-7 of the truth
RELIEF_KERNEL SinCos8 sin_cos(F8 x)
{
  const F8 quarters = floor(x * 0.636619772f + 0.5f);
  // π/2 in three parts of which the first two times `quarters` are exact.
  const F8 rest =
      ((x - quarters * 1.5703125f) - quarters * 4.837512969970703125e-4f) - quarters * 7.549789948768648e-8f;
  return sin_cos_octant(rest, quarters);
}

/// @return  relative error below 2e-7; the ends of [−87, 88] beyond it
RELIEF_KERNEL F8 exp8(F8 x)
{
  const F8 bounded = clamp(x, -87.0f, 88.0f);
  const F8 n = floor(bounded * 1.44269504f + 0.5f);
  const F8 r = (bounded - n * 0.693359375f) - n * -2.12194440e-4f;
  F8 p = splat8(1.9875691500e-4f);
  p = p * r + 1.3981999507e-3f;
  p = p * r + 8.3334519073e-3f;
  p = p * r + 4.1665795894e-2f;
  p = p * r + 1.6666665459e-1f;
  p = p * r + 5.0000001201e-1f;
  p = p * r * r + r + 1.0f;
  const I8 exponent = __builtin_convertvector(n, I8) + 127;
  return p * __builtin_bit_cast(F8, exponent << 23);
}

/// @param x  positive, normal
RELIEF_KERNEL F8 log8(F8 x)
{
  const W8 bits = bits_of(x);
  // Mantissas in [√½, √2).
  const W8 shifted = bits - 0x3f3504f3u;
  const F8 n = __builtin_convertvector(__builtin_bit_cast(I8, shifted) >> 23, F8);
  const F8 m = __builtin_bit_cast(F8, (shifted & 0x7fffffu) + 0x3f3504f3u) - 1.0f;
  const F8 z = m * m;
  F8 p = splat8(7.0376836292e-2f);
  p = p * m - 1.1514610310e-1f;
  p = p * m + 1.1676998740e-1f;
  p = p * m - 1.2420140846e-1f;
  p = p * m + 1.4249322787e-1f;
  p = p * m - 1.6668057665e-1f;
  p = p * m + 2.0000714765e-1f;
  p = p * m - 2.4999993993e-1f;
  p = p * m + 3.3333331174e-1f;
  p = p * m * z + n * -2.12194440e-4f - 0.5f * z;
  return m + p + n * 0.693359375f;
}

}  // namespace relief
