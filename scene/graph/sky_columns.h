// Columns of a sky's table from fewer ones. What depends strongly on the angle to the sun are the phase functions, which are
// factors of sums along a ray; the sums themselves vary little as the ray turns.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "scene/graph/sky_model.h"

namespace relief {

/// Sums along a ray at a column of the table.
struct SkySums {
  Vec3f air, dust;  ///< linear Rec.709, without the phase functions
  Vec3f even;       ///< what has none
};
inline SkySums operator+(const SkySums& a, const SkySums& b) { return {a.air + b.air, a.dust + b.dust, a.even + b.even}; }
inline SkySums operator*(const SkySums& a, float s) { return {a.air * s, a.dust * s, a.even * s}; }

/// Columns between two of those that are computed.
inline constexpr std::size_t kSkyStride = 8;
inline constexpr std::size_t kSkyKnots = kSkyColumns / 2 / kSkyStride + 1;

/// By cubics through the knots, which lie evenly from the one meridian of symmetry to the other.
/// @param knots  kSkyKnots
/// @param place  0 to kSkyColumns / 2
inline SkySums sky_sums_at(std::span<const SkySums> knots, float place)
{
  constexpr auto kLast = static_cast<std::ptrdiff_t>(kSkyKnots) - 1;
  const float x = place / kSkyStride;
  const auto first = static_cast<std::ptrdiff_t>(std::fmin(x, static_cast<float>(kLast - 1)));
  const float t = x - static_cast<float>(first), s = 1 - t;
  const auto at = [&](std::ptrdiff_t i) {
    const std::ptrdiff_t mirrored = i < 0 ? -i : i > kLast ? 2 * kLast - i : i;
    return knots[static_cast<std::size_t>(mirrored)];
  };
  return at(first - 1) * (-0.5f * t * s * s) + at(first) * (1 + t * t * (1.5f * t - 2.5f)) +
         at(first + 1) * (1 + s * s * (1.5f * s - 2.5f)) + at(first + 2) * (-0.5f * s * t * t);
}

}  // namespace relief
