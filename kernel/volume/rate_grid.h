// What is known of a medium that varies, box by box, before rays ask it: what it is taken for, how often that has to be corrected along
// a ray, and how much it shows.
#pragma once

#include <cstddef>
#include <cstdint>

#include "kernel/math/vec.h"

namespace relief {

/// A medium in a box. None of this has to be true for means to be right, but where a number is 0 nothing is looked for.
struct RateBox {
  Vec3f sigma_t;       ///< 1/m: what it is taken for
  float residual = 0;  ///< 1/m: tentative collisions by which that is corrected
  float shows = 0;     ///< 1/m: how often it is asked what it scatters and sends out
  float most = 0;      ///< 1/m: tentative collisions of what is scattered or passes; it is best if sigma_t is not more
};

/// Boxes in nested levels: those of each are twice as long as those of the one before, about the same middle. Outside of the last
/// level there is nothing.
struct RateGrid {
  Vec3f low;              ///< corner of level 0, world, metres
  Vec3f cell;             ///< lengths of a box of level 0, metres, above 0
  std::int32_t size = 0;  ///< boxes along each axis; of several levels a multiple of 4
  std::int32_t num_levels = 1;
  /// Level by level, x first; a level's middle boxes are there, too. Null: there is nothing anywhere.
  const RateBox* boxes = nullptr;
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

/// A ray's way through a grid, from box to box.
struct RateWay {
  const RateGrid* grid;
  /// The ray in boxes of level 0, from the middle; a metre of it; and one over that, infinite where it is 0.
  float O[3], D[3], inverse[3];
  const RateBox* box;  ///< null: outside
  int level, n[3];     ///< the box
  float leaves[3];     ///< metres along the ray: where it gets to the next box along each axis
  float end;           ///< where it leaves the box, or gets in
};

/// A bit farther along a ray than t: a part of a box that does not matter.
RELIEF_KERNEL float rate_way_behind(const RateGrid& grid, int level, float t)
{
  return t * (1.0f + 1e-6f) + 1e-4f * static_cast<float>(1u << level) * min_component(grid.cell);
}

/// Finds the box that a point of the ray is in.
/// @param t  metres
RELIEF_KERNEL void rate_way_find(RateWay& way, float t)
{
  const RateGrid& grid = *way.grid;
  const float half = 0.5f * static_cast<float>(grid.size);
  float at[3], reach = 0;
  for (int i = 0; i < 3; ++i) {
    at[i] = way.O[i] + way.D[i] * t;
    reach = max(reach, __builtin_fabsf(at[i]));
  }
  for (way.level = 0; reach > half && way.level < grid.num_levels; reach *= 0.5f) ++way.level;
  way.box = nullptr;
  way.end = kInfinity;
  if (way.level >= grid.num_levels) {
    const float side = half * static_cast<float>(1u << (grid.num_levels - 1));
    float enters = t, leaves = kInfinity;
    for (int i = 0; i < 3; ++i) {
      if (way.D[i] == 0.0f) {
        if (!(__builtin_fabsf(way.O[i]) <= side)) return;
        continue;
      }
      const float a = (-side - way.O[i]) * way.inverse[i], b = (side - way.O[i]) * way.inverse[i];
      enters = max(enters, min(a, b));
      leaves = min(leaves, max(a, b));
    }
    if (enters < leaves) way.end = rate_way_behind(grid, 0, max(enters, t));
    return;
  }
  const float scale = static_cast<float>(1u << way.level), per_box = 1.0f / scale;
  std::size_t index = static_cast<std::size_t>(way.level);
  for (int i = 2; i >= 0; --i) {
    const int n = static_cast<int>(clamp(at[i] * per_box + half, 0.0f, 2.0f * half - 1.0f));
    way.n[i] = n;
    index = index * static_cast<std::size_t>(grid.size) + static_cast<std::size_t>(n);
    const float border = (static_cast<float>(way.D[i] > 0.0f ? n + 1 : n) - half) * scale;
    way.leaves[i] = way.D[i] != 0.0f ? (border - way.O[i]) * way.inverse[i] : kInfinity;
    way.end = min(way.end, way.leaves[i]);
  }
  way.box = grid.boxes + index;
  // By rounding a point on a border may be in the box that it leaves.
  way.end = max(way.end, rate_way_behind(grid, way.level, t));
}

/// @param D  unit
RELIEF_KERNEL RateWay rate_way_make(const RateGrid& grid, Vec3f O, Vec3f D)
{
  const Vec3f d = D / grid.cell, o = (O - rate_grid_middle(grid)) / grid.cell;
  RateWay way{&grid, {o.x, o.y, o.z}, {d.x, d.y, d.z}, {1.0f / d.x, 1.0f / d.y, 1.0f / d.z}, nullptr, 0, {}, {}, 0};
  rate_way_find(way, 0.0f);
  return way;
}

/// Goes on to the next box.
RELIEF_KERNEL void rate_way_go(RateWay& way)
{
  if (way.box == nullptr) return rate_way_find(way, way.end);
  const RateGrid& grid = *way.grid;
  const int axis = way.leaves[0] <= way.leaves[1] ? (way.leaves[0] <= way.leaves[2] ? 0 : 2)
                                                  : (way.leaves[1] <= way.leaves[2] ? 1 : 2);
  const int step = way.D[axis] > 0.0f ? 1 : -1, n = way.n[axis] + step, size = grid.size;
  const auto is_finer = [&](int i) { return 4 * way.n[i] >= size && 4 * way.n[i] < 3 * size; };
  way.n[axis] = n;
  if (n < 0 || n >= size || (way.level > 0 && is_finer(0) && is_finer(1) && is_finer(2))) {
    // Not by rounding before the border.
    return rate_way_find(way, rate_way_behind(grid, way.level, way.end));
  }
  way.box += step * (axis == 0 ? 1 : axis == 1 ? size : size * size);
  const float scale = static_cast<float>(1u << way.level), half = 0.5f * static_cast<float>(size);
  const float border = (static_cast<float>(step > 0 ? n + 1 : n) - half) * scale;
  way.leaves[axis] = (border - way.O[axis]) * way.inverse[axis];
  way.end = max(way.end, min(way.leaves[0], min(way.leaves[1], way.leaves[2])));
}

}  // namespace relief
