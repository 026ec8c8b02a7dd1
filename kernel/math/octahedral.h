// Unit vectors in 32 bits. Source: Cigolle et al. 2014, "A Survey of Efficient Representations for Independent Unit
// Vectors", JCGT 3(2), the octahedral map with 16 bits a coordinate.
#pragma once

#include "kernel/math/vec.h"

namespace relief {

/// @param v  unit
/// @return   within 7e-5 rad of v once decoded
RELIEF_KERNEL std::uint32_t octahedral_encode(Vec3f v)
{
  const float scale = 1.0f / (__builtin_fabsf(v.x) + __builtin_fabsf(v.y) + __builtin_fabsf(v.z));
  Vec2f p{v.x * scale, v.y * scale};
  if (v.z < 0.0f) {
    p = {__builtin_copysignf(1.0f - __builtin_fabsf(p.y), p.x), __builtin_copysignf(1.0f - __builtin_fabsf(p.x), p.y)};
  }
  const auto bits = [](float x) {
    return static_cast<std::uint32_t>(__builtin_lrintf((clamp(x, -1.0f, 1.0f) + 1.0f) * 32767.5f));
  };
  return bits(p.x) << 16 | bits(p.y);
}

/// @return unit
RELIEF_KERNEL Vec3f octahedral_decode(std::uint32_t code)
{
  const auto coordinate = [](std::uint32_t bits) { return static_cast<float>(bits) * (1.0f / 32767.5f) - 1.0f; };
  const Vec2f p{coordinate(code >> 16), coordinate(code & 0xffffu)};
  Vec3f v{p.x, p.y, 1.0f - __builtin_fabsf(p.x) - __builtin_fabsf(p.y)};
  if (v.z < 0.0f) {
    v.x = __builtin_copysignf(1.0f - __builtin_fabsf(p.y), p.x);
    v.y = __builtin_copysignf(1.0f - __builtin_fabsf(p.x), p.y);
  }
  return normalize(v);
}

}  // namespace relief
