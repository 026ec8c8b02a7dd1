// Micro-triangles made on demand: the points of 16 × 16 cells of a lattice, and two levels of boxes over them. A cache of bounded
// size keeps those that rays meet. Two triangles a cell (i, j): (i, j), (i + 1, j), (i, j + 1) and (i + 1, j + 1), (i, j + 1), (i + 1, j).
#pragma once

#include <cstdint>
#include <type_traits>

#include "displacement/tile_cache.h"
#include "kernel/math/vec.h"

namespace relief {

/// Boxes side by side, in 255ths of a tile's box along each axis; they hold what is below them. Nothing: low > high.
template <int kNum>
struct TileBoxes {
  std::uint8_t low[3][kNum], high[3][kNum];
};

struct alignas(64) PointTile {
  static constexpr int kCells = 16;     ///< a side
  static constexpr int kLeafCells = 2;  ///< a side of a leaf: eight triangles
  static constexpr int kNodeCells = 4;  ///< a side of a node, 2 × 2 leaves; the tile is 4 × 4 nodes
  static constexpr int kRow = kCells + 1;
  static constexpr int kPoints = kRow * kRow;

  float low[3], step[3];    ///< a box's coordinate q along an axis is at low + step · q
  TileBoxes<16> nodes;      ///< 4y + x: node (x, y)
  TileBoxes<8> leaves[16];  ///< of each node, 2y + x: leaf (x, y) within it; the other four are nothing
  /// Of point (i, j), at j · kRow + i; axis by axis, object space. Beyond a triangle's third side rows and columns end with their last
  /// point again, so that triangles there have no area. Four are read at a time.
  float P[3][kPoints + 3];

  Vec3f point(int i, int j) const
  {
    const int at = j * kRow + i;
    return {P[0][at], P[1][at], P[2][at]};
  }
};
static_assert(std::is_trivially_destructible_v<PointTile>);

/// Makes the boxes from the points.
/// @param num_rows  cells (i, j) with i + j < num_rows are there; boxes of the others are nothing
void point_tile_finish(PointTile* tile, int num_rows);

using PointTileCache = MadeTileCache<PointTile>;

}  // namespace relief
