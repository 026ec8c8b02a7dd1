// Bounds of how much light a medium takes away and scatters on a metre, box by box: the rates at which tentative collisions are made
// along a ray.
#pragma once

#include <cstddef>
#include <cstdint>

#include "kernel/math/vec.h"

namespace relief {

/// Boxes in nested levels: those of each are twice as long as those of the one before, about the same middle. Outside of the last
/// level there is nothing.
struct RateGrid {
  Vec3f low;              ///< corner of level 0, world, metres
  Vec3f cell;             ///< lengths of a box of level 0, metres, above 0
  std::int32_t size = 0;  ///< boxes along each axis; of several levels a multiple of 4
  std::int32_t num_levels = 1;
  const float* rates = nullptr;  ///< 1/m, level by level, x first; a level's middle boxes are there, too
};

/// A part of a ray in which the rate is one number.
struct RateStretch {
  float rate = 0;         ///< 1/m
  float end = kInfinity;  ///< metres along the ray
};

RELIEF_KERNEL Vec3f rate_grid_middle(const RateGrid& grid)
{
  return grid.low + grid.cell * (0.5f * static_cast<float>(grid.size));
}

/// The level that a point is in; num_levels: outside.
RELIEF_KERNEL int rate_grid_level(const RateGrid& grid, Vec3f P)
{
  const float half = 0.5f * static_cast<float>(grid.size);
  int level = 0;
  float reach = max_component(abs((P - rate_grid_middle(grid)) / grid.cell));
  for (; reach > half && level < grid.num_levels; reach *= 0.5f) ++level;
  return level;
}

/// A ray as a grid sees it: in boxes of level 0, from the middle.
struct RateRay {
  Vec3f O, D;     ///< D a metre
  Vec3f inverse;  ///< of D's components; infinite where these are 0
};

/// @param D  unit
RELIEF_KERNEL RateRay rate_ray_make(const RateGrid& grid, Vec3f O, Vec3f D)
{
  const Vec3f d = D / grid.cell;
  return {(O - rate_grid_middle(grid)) / grid.cell, d, {1.0f / d.x, 1.0f / d.y, 1.0f / d.z}};
}

/// @param t  metres along the ray
RELIEF_KERNEL RateStretch rate_grid_at(const RateGrid& grid, const RateRay& ray, float t)
{
  const float half = 0.5f * static_cast<float>(grid.size);
  const Vec3f q = ray.O + ray.D * t;
  int level = 0;
  for (float reach = max_component(abs(q)); reach > half && level < grid.num_levels; reach *= 0.5f) ++level;
  const float o[3] = {ray.O.x, ray.O.y, ray.O.z}, d[3] = {ray.D.x, ray.D.y, ray.D.z};
  const float inverse[3] = {ray.inverse.x, ray.inverse.y, ray.inverse.z}, at[3] = {q.x, q.y, q.z};
  if (level >= grid.num_levels) {
    // Where it gets in, if it does.
    const float side = half * static_cast<float>(1u << (grid.num_levels - 1));
    float enters = t, leaves = kInfinity;
    for (int i = 0; i < 3; ++i) {
      if (d[i] == 0.0f) {
        if (!(__builtin_fabsf(o[i]) <= side)) return {};
        continue;
      }
      const float a = (-side - o[i]) * inverse[i], b = (side - o[i]) * inverse[i];
      enters = max(enters, min(a, b));
      leaves = min(leaves, max(a, b));
    }
    if (!(enters < leaves)) return {};
    return {0.0f, max(enters, t) * (1.0f + 1e-6f) + 1e-4f * min_component(grid.cell)};
  }
  const float scale = static_cast<float>(1u << level), per_box = 1.0f / scale;
  std::size_t index = static_cast<std::size_t>(level);
  float end = kInfinity;
  for (int i = 2; i >= 0; --i) {
    const int n = static_cast<int>(clamp(__builtin_floorf(at[i] * per_box + half), 0.0f, 2.0f * half - 1.0f));
    index = index * static_cast<std::size_t>(grid.size) + static_cast<std::size_t>(n);
    const float border = (static_cast<float>(d[i] > 0.0f ? n + 1 : n) - half) * scale;
    if (d[i] != 0.0f) end = min(end, (border - o[i]) * inverse[i]);
  }
  // By rounding a point on a border may be in the box that it leaves; what is gone on by is a part of a box that does not matter.
  return {grid.rates[index], max(end, t * (1.0f + 1e-6f) + 1e-4f * scale * min_component(grid.cell))};
}

}  // namespace relief
