// What traversals need of lanes besides kernel/math/lanes.h: small integers as floats, shuffles, four doubles side by side.
#pragma once

#include "displacement/vec3d.h"
#include "kernel/math/lanes.h"

namespace relief {

using D4 [[gnu::vector_size(32)]] = double;
using I4 [[gnu::vector_size(32)]] = std::int64_t;

/// Small integers as floats; by way of 32 bits, which is one instruction less than GCC makes of it by itself.
template <typename Small>
RELIEF_KERNEL F8 widen(Small lanes)
{
  return __builtin_convertvector(__builtin_convertvector(lanes, I8), F8);
}

RELIEF_KERNEL F8 load8(const std::uint16_t* from)
{
  using U16 [[gnu::vector_size(16)]] = std::uint16_t;
  U16 lanes;
  __builtin_memcpy(&lanes, from, sizeof lanes);
  return widen(lanes);
}
RELIEF_KERNEL F8 load8(const std::uint8_t* from)
{
  using U8 [[gnu::vector_size(8)]] = std::uint8_t;
  U8 lanes;
  __builtin_memcpy(&lanes, from, sizeof lanes);
  return widen(lanes);
}
/// Lane k of the result is lane k + 1; the last is lane 7.
RELIEF_KERNEL F8 shift_down(F8 a) { return __builtin_shufflevector(a, a, 1, 2, 3, 4, 5, 6, 7, 7); }
/// Lanes 0…3 of a, then lanes 0…3 of b.
RELIEF_KERNEL F8 join_low_halves(F8 a, F8 b) { return __builtin_shufflevector(a, b, 0, 1, 2, 3, 8, 9, 10, 11); }

RELIEF_KERNEL D4 abs(D4 a) { return a < 0.0 ? -a : a; }
RELIEF_KERNEL D4 max(D4 a, D4 b) { return a > b ? a : b; }
RELIEF_KERNEL D4 min(D4 a, D4 b) { return a < b ? a : b; }
RELIEF_KERNEL D4 sqrt(D4 a)
{
#ifdef __AVX__
  return __builtin_bit_cast(D4, _mm256_sqrt_pd(__builtin_bit_cast(__m256d, a)));
#else
  for (int k = 0; k < 4; ++k) a[k] = __builtin_sqrt(a[k]);
  return a;
#endif
}
/// a·b + c, rounded once where the machine can.
RELIEF_KERNEL F8 fused(F8 a, F8 b, F8 c)
{
#ifdef __FMA__
  return __builtin_bit_cast(
      F8, _mm256_fmadd_ps(__builtin_bit_cast(__m256, a), __builtin_bit_cast(__m256, b), __builtin_bit_cast(__m256, c)));
#else
  return a * b + c;
#endif
}
RELIEF_KERNEL double fused(double a, double b, double c)
{
#ifdef __FMA__
  return __builtin_fma(a, b, c);
#else
  return a * b + c;
#endif
}
RELIEF_KERNEL D4 fused(D4 a, D4 b, D4 c)
{
#ifdef __FMA__
  return __builtin_bit_cast(D4, _mm256_fmadd_pd(__builtin_bit_cast(__m256d, a), __builtin_bit_cast(__m256d, b),
                                                __builtin_bit_cast(__m256d, c)));
#else
  return a * b + c;
#endif
}
/// Lanes 1, 2, 0: the next vertex of a triangle. Lane 3 stays.
RELIEF_KERNEL D4 next_vertex(D4 a) { return __builtin_shufflevector(a, a, 1, 2, 0, 3); }
RELIEF_KERNEL double max_of_vertices(D4 a) { return max(max(a[0], a[1]), a[2]); }
RELIEF_KERNEL double sum_of_vertices(D4 a) { return a[0] + a[1] + a[2]; }

}  // namespace relief
