// The detail of displaced surfaces that a path's rays ask for.
#pragma once

#include "displacement/displacement_set.h"
#include "kernel/sample/dimensions.h"
#include "kernel/sample/sobol.h"
#include "kernel/state/path_state.h"

namespace relief {

/// Width of the texels that a ray meets, as a part of its cone's. Averaged heights shade otherwise than the real ones do:
/// at half a cone the mean of pictures of rough surfaces was 1 % off.
inline constexpr float kTexelsPerCone = 0.25f;
/// Bounced rays stand for wide cones, but what a single one meets must still look like the surface: averaged heights
/// have lost what was in between.
inline constexpr float kWidestLodSpread = 1.0f / 16;

struct PathLod {
  float dither, factor;

  PathLod(const PathState& state, std::uint32_t path)
      : dither(sample_1d(state.pixel_hash[path], state.sample_index[path], kLodDimension)),
        factor(kTexelsPerCone * __builtin_exp2f(dither))
  {
  }
  LodCone cone(float width, float spread) const
  {
    return {factor * width, factor * min(spread, kWidestLodSpread), dither};
  }
};

}  // namespace relief
