// What all computed heights of a scene keep from ray to ray, of bounded size: tiles, and bounds of what is below the nodes of
// lattices.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

#include "displacement/height_tile.h"
#include "displacement/zero_pages.h"

namespace relief {

/// Bounds of heights. Nothing where low > high.
struct LatticeRange {
  float low = 0, high = 0;
};

/// Bounds of nodes' four children. What was kept last stays.
class NodeRangeCache {
 public:
  explicit NodeRangeCache(std::size_t bytes);

  /// @param key  of the node, below 2⁶⁴ − 1
  /// @return     false: they are not kept
  bool find(std::uint64_t key, LatticeRange* children) const;
  void keep(std::uint64_t key, const LatticeRange* children);
  /// Better bounds of one child, if the node's are kept.
  void improve(std::uint64_t key, int child, LatticeRange range);

  std::size_t bytes() const { return num_taken_.load(std::memory_order_relaxed) * sizeof(Line); }

 private:
  /// Written by whoever needs it; readers take a copy and look whether it was whole.
  struct alignas(64) Line {
    std::atomic<std::uint32_t> version;  ///< odd while it is written
    std::atomic<std::uint64_t> key;      ///< plus one; 0: empty
    std::atomic<float> low[4], high[4];
  };
  Line& line_of(std::uint64_t key) const;

  std::size_t num_lines_;
  ZeroPages lines_;
  std::atomic<std::uint64_t> num_taken_{0};
};

struct LatticeCache {
  /// @param bytes  at most; memory is taken as it is needed
  explicit LatticeCache(std::size_t bytes) : nodes(bytes / 16), tiles(bytes - bytes / 16) {}

  std::size_t bytes() const { return nodes.bytes() + tiles.bytes(); }

  NodeRangeCache nodes;
  HeightTileCache tiles;
  std::uint64_t num_triangles = 0;  ///< of all fields so far: their keys are numbered by them
};

}  // namespace relief
