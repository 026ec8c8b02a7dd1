// Eight floats side by side, by the compiler's vector types: one AVX2 register, or two SSE registers in the baseline.
#pragma once

#include <cstdint>

#include <immintrin.h>

#include "kernel/kernel.h"

namespace relief {

using F8 [[gnu::vector_size(32)]] = float;
using I8 [[gnu::vector_size(32)]] = std::int32_t;
using W8 [[gnu::vector_size(32)]] = std::uint32_t;

RELIEF_KERNEL F8 splat8(float x) { return F8{x, x, x, x, x, x, x, x}; }
RELIEF_KERNEL F8 min(F8 a, F8 b) { return a < b ? a : b; }
RELIEF_KERNEL F8 max(F8 a, F8 b) { return a > b ? a : b; }
RELIEF_KERNEL F8 abs(F8 a)
{
  I8 bits;
  __builtin_memcpy(&bits, &a, sizeof bits);
  bits &= 0x7fffffff;
  __builtin_memcpy(&a, &bits, sizeof a);
  return a;
}
RELIEF_KERNEL F8 sqrt(F8 a)
{
  for (int k = 0; k < 8; ++k) a[k] = __builtin_sqrtf(a[k]);
  return a;
}
/// Bit k is set where lane k of a comparison is true.
RELIEF_KERNEL unsigned mask_of(I8 m)
{
#ifdef __AVX__
  return static_cast<unsigned>(_mm256_movemask_ps(__builtin_bit_cast(__m256, m)));
#else
  __m128 half[2];
  __builtin_memcpy(half, &m, sizeof half);
  return static_cast<unsigned>(_mm_movemask_ps(half[0]) | _mm_movemask_ps(half[1]) << 4);
#endif
}

RELIEF_KERNEL F8 load8(const float* from)
{
  F8 lanes;
  __builtin_memcpy(&lanes, from, sizeof lanes);
  return lanes;
}
RELIEF_KERNEL F8 floor(F8 a)
{
  for (int k = 0; k < 8; ++k) a[k] = __builtin_floorf(a[k]);
  return a;
}
RELIEF_KERNEL F8 clamp(F8 a, float low, float high) { return min(max(a, splat8(low)), splat8(high)); }
RELIEF_KERNEL W8 bits_of(F8 a) { return __builtin_bit_cast(W8, a); }
RELIEF_KERNEL void store8(float* to, F8 lanes) { __builtin_memcpy(to, &lanes, sizeof lanes); }

}  // namespace relief
