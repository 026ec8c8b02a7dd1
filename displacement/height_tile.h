// Small height maps made on demand: 32 × 32 cells of a triangle's lattice, with a texel more on all sides and the pyramid
// that the traversals descend. A cache of bounded size keeps those that rays meet.
#pragma once

#include "displacement/height_field.h"
#include "displacement/tile_cache.h"

namespace relief {

inline constexpr int kTileCells = 32;
/// Texel (c, r) of a tile is the lattice point (c − 1, r − 1) from its first cell's corner.
inline constexpr int kTileTexels = kTileCells + 3;
inline constexpr int kTileLines = 10;  ///< of the pyramid over kTileTexels + 1 cells a side

struct HeightTile {
  HeightFieldView field;  ///< once the texels are there
  float texels[kTileTexels * kTileTexels];
  PyramidLine lines[kTileLines];
};

/// Makes a tile's field from its texels.
void height_tile_finish(HeightTile* tile);

using HeightTileCache = MadeTileCache<HeightTile>;

}  // namespace relief
