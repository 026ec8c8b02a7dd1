// What is to be known of a light, or of a group of lights, to choose among many: where it is, whither it shines, how much.
// Every kind has a `light_bounds(Kind, light, emission)`, where `emission` is the light_scalar of what it sends, as an uneven
// light does on average. Suns have none: they are a group by themselves.
#pragma once

#include <cmath>

#include "kernel/light/light.h"

namespace relief {

/// Cone of directions: unit axis and half angle in radians, [0, π].
struct LightCone {
  Vec3f axis{0, 0, 1};
  float angle = 0;
};

/// Mean over all directions of the part of its intensity that a light has there, and the same times three and the cosine
/// to its axis: the expansion of that part to first order is mean + slope × cosine.
struct LightProfile {
  float mean = 1, slope = 0;
};
inline constexpr LightProfile kFlatProfile{1.0f / 4.0f, 1.0f / 2.0f};
inline constexpr LightProfile kTwoSidedProfile{1.0f / 2.0f, 0.0f};
/// One within a cone, nothing outside.
RELIEF_KERNEL LightProfile light_cone_profile(float cosine)
{
  return {0.5f * (1.0f - cosine), 0.75f * (1.0f - cosine * cosine)};
}

/// What the build of the light tree knows of a light or a group; the tree's nodes are made from these.
struct LightBounds {
  Vec3f low{kInfinity, kInfinity, kInfinity}, high{-kInfinity, -kInfinity, -kInfinity};
  LightCone spread;
  float falloff = 0;       ///< radians
  float profile_mean = 1;  ///< of a light: see LightProfile
  Vec3f profile_slope;     ///< of a light: LightProfile::slope along its axis
  bool is_flat = false;    ///< a light whose intensity is its cosine
  float intensity = 0;     ///< 0: empty group
  bool two_sided = false;
  bool has_dim_side = false;  ///< not all that it sends out is known by the above, see Light::dark_side
};

/// Completes the bounds of one light, whose spread is known.
RELIEF_KERNEL void light_bounds_add_profile(LightBounds& bounds, LightProfile profile)
{
  bounds.profile_mean = profile.mean;
  bounds.profile_slope = bounds.spread.axis * profile.slope;
}

}  // namespace relief
