// IEEE 754 binary16 to binary32 and back. The bit patterns are handled as integers, so the results do not depend on
// the processor's flush-to-zero and denormals-are-zero modes, which ray tracers like to switch on.
#pragma once

#include <cstdint>

#include "kernel/kernel.h"

#ifdef __F16C__
#include <immintrin.h>
#endif

namespace relief {

inline constexpr float kHalfMax = 65504.0f;

/// Value of a half, exact; infinities and NaN are kept.
RELIEF_KERNEL float float_from_half(std::uint16_t half)
{
#ifdef __F16C__
  return _cvtsh_ss(half);
#else
  constexpr std::uint32_t kExponentMask = 0x1fu << 23;
  constexpr std::uint32_t kRebias = (127 - 15) << 23;
  constexpr std::uint32_t kSmallestNormal = (127 - 14) << 23;
  const std::uint32_t sign = static_cast<std::uint32_t>(half & 0x8000) << 16;
  const std::uint32_t bits = static_cast<std::uint32_t>(half & 0x7fff) << 13;
  const std::uint32_t exponent = bits & kExponentMask;
  std::uint32_t magnitude = bits + kRebias;
  if (exponent == kExponentMask) {
    magnitude += kRebias;
  } else if (exponent == 0) {
    // A subnormal half is the fraction of 2^-14 that remains when an implicit one is added and taken away again.
    const float value = __builtin_bit_cast(float, bits + kSmallestNormal) - __builtin_bit_cast(float, kSmallestNormal);
    magnitude = __builtin_bit_cast(std::uint32_t, value);
  }
  return __builtin_bit_cast(float, sign | magnitude);
#endif
}

/// Nearest half, ties to even; beyond the range of half: infinity; NaN stays NaN.
RELIEF_KERNEL std::uint16_t half_from_float(float value)
{
  const std::uint32_t bits = __builtin_bit_cast(std::uint32_t, value);
  const std::uint32_t sign = (bits >> 16) & 0x8000u;
  const std::uint32_t magnitude = bits & 0x7fffffffu;
  constexpr std::uint32_t kInfinityBits = 0x7f800000u;
  constexpr std::uint32_t kFirstThatRoundsToInfinity = 0x477ff000u;  // 65520
  constexpr std::uint32_t kSmallestNormal = (127 - 14) << 23;
  std::uint32_t half = 0;
  if (magnitude > kInfinityBits) {
    half = 0x7e00u;
  } else if (magnitude >= kFirstThatRoundsToInfinity) {
    half = 0x7c00u;
  } else if (magnitude >= kSmallestNormal) {
    const std::uint32_t odd = (magnitude >> 13) & 1u;
    half = (magnitude - ((127 - 15) << 23) + 0xfffu + odd) >> 13;
  } else {
    // Adding ½ puts the subnormal's unit, 2^-24, at the float's last bit: the addition itself rounds to even.
    const float shifted = __builtin_bit_cast(float, magnitude) + 0.5f;
    half = __builtin_bit_cast(std::uint32_t, shifted) - 0x3f000000u;
  }
  return static_cast<std::uint16_t>(sign | half);
}

}  // namespace relief
