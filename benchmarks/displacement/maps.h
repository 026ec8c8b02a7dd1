// Height maps for benchmarks, made on the spot: they tile, have detail down to single texels, and are the same on every
// machine up to the rounding of its mathematical library.
#pragma once

#include <cstdint>
#include <vector>

namespace relief {

/// What a map looks like.
enum class BenchMap : std::uint8_t {
  kDomes,   ///< round domes of several sizes
  kWoven,   ///< a basket's weave of strands
  kHide,    ///< folds and grains of a skin
  kPanels,  ///< plates with gaps and rivets
  kHammered,
  kEngraved,  ///< curls cut into a plate
  kRock,
  kRoof,   ///< overlapping tiles, with steps
  kDunes,  ///< sand ripples and pebbles
  kWaves
};

/// @param size  texels a side
/// @return      16-bit heights, row by row; the whole range is used, nearly
/// @cost        about 0.3 µs a texel; parallel over rows
std::vector<std::uint16_t> bench_map_make(BenchMap kind, int size);

}  // namespace relief
