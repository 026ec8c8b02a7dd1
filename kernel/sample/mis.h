// Multiple importance sampling weights (Veach 1997, §9.2.2) for one sample from each of two techniques.
#pragma once

#include "kernel/math/vec.h"

namespace relief {

/// @param pdf    of the technique that made the sample, > 0
/// @param other  of the other one for the same sample, same measure; 0: it cannot make it
RELIEF_KERNEL constexpr float mis_balance(float pdf, float other) { return pdf / (pdf + other); }

/// Power heuristic with exponent 2. Written with the ratio, so that squares neither overflow nor underflow: an infinite
/// `pdf` (a delta) has weight 1, an infinite `other` weight 0.
RELIEF_KERNEL constexpr float mis_power(float pdf, float other)
{
  if (other == 0.0f) return 1.0f;
  if (pdf >= other) return 1.0f / (1.0f + sqr(other / pdf));
  const float ratio = sqr(pdf / other);
  return ratio / (1.0f + ratio);
}

}  // namespace relief
