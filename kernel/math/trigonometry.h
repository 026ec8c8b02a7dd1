// Sines and angles where the caller's range is known, inlined: the C library's cost a call, a reduction of the argument
// and the registers of whoever asks.
#pragma once

#include "kernel/math/vec.h"

namespace relief {

struct SinCos {
  float sin = 0, cos = 1;
};

/// @param x  in [−π/4, π/4]
/// @return   within 1e-7 of the truth
/// @source   polynomials: Moshier, Cephes library, sinf and cosf
RELIEF_KERNEL SinCos sin_cos_octant(float x)
{
  const float z = x * x;
  const float sine = x + x * z * (-1.6666654611e-1f + z * (8.3321608736e-3f + z * -1.9515295891e-4f));
  const float cosine =
      1.0f - 0.5f * z + z * z * (4.166664568298827e-2f + z * (-1.388731625493765e-3f + z * 2.443315711809948e-5f));
  return {sine, cosine};
}

/// @param turn  angle as a fraction of a turn, |turn| < 2^20; exact reduction, so the error is that of sin_cos_octant
RELIEF_KERNEL SinCos sin_cos_turn(float turn)
{
  const float quarters = __builtin_floorf(4.0f * turn + 0.5f);
  const SinCos rest = sin_cos_octant((turn - 0.25f * quarters) * (2.0f * kPi));
  const auto quadrant = static_cast<std::uint32_t>(static_cast<std::int32_t>(quarters)) & 3u;
  const float sine = (quadrant & 1u) != 0 ? rest.cos : rest.sin;
  const float cosine = (quadrant & 1u) != 0 ? rest.sin : rest.cos;
  return {(quadrant & 2u) != 0 ? -sine : sine, quadrant == 1u || quadrant == 2u ? -cosine : cosine};
}

/// Angle of the vector (x, y).
/// @param y  >= 0
/// @return   [0, π], with a relative error below 4e-7, however small; 0 of the zero vector
/// @source   polynomial: Moshier, Cephes library, atanf
RELIEF_KERNEL float angle_of(float y, float x)
{
  const float along = __builtin_fabsf(x);
  const bool steep = y > along;
  const float high = steep ? y : along, low = steep ? along : y;
  // tan(a − π/4) = (tan a − 1) / (tan a + 1) brings what is above π/8 to below it.
  constexpr float kTanPiOver8 = 0.41421356f;
  const bool wide = low > kTanPiOver8 * high;
  const float t = (wide ? low - high : low) / max(wide ? low + high : high, 1e-37f);
  const float z = t * t;
  const float polynomial =
      -3.33329491539e-1f + z * (1.99777106478e-1f + z * (-1.38776856032e-1f + z * 8.05374449538e-2f));
  float angle = (wide ? 0.25f * kPi : 0.0f) + (t + t * z * polynomial);
  if (steep) angle = 0.5f * kPi - angle;
  return x < 0.0f ? kPi - angle : angle;
}

}  // namespace relief
