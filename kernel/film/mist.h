// Mist: how far away things are, from 0 to 1, for compositors.
#pragma once

#include "kernel/math/vec.h"

namespace relief {

/// How mist thickens between its two ends.
enum class MistFalloff : std::uint8_t { kLinear, kQuadratic, kInverseQuadratic };

/// For Aov::kMist.
struct Mist {
  float start = 5, depth = 25;  ///< metres from the camera, and from there on
  MistFalloff falloff = MistFalloff::kQuadratic;
};

/// @param distance  from the camera, metres
RELIEF_KERNEL float mist_eval(const Mist& mist, float distance)
{
  const float t = clamp((distance - mist.start) / mist.depth, 0.0f, 1.0f);
  return mist.falloff == MistFalloff::kLinear      ? t
         : mist.falloff == MistFalloff::kQuadratic ? sqr(t)
                                                   : __builtin_sqrtf(t);
}

}  // namespace relief
