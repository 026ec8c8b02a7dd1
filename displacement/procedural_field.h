// The heights of a mesh that nobody has stored: a lattice on every triangle, whose heights are computed tile by tile where
// rays ask for them, and bounds of what is not computed yet.
//
// Lattice coordinates are x = n·b1, y = n·b2 in the triangle's own barycentric weights. Heights are bilinear in a cell, and
// linear in those that the third side cuts, so that the surface over every side is a polyline through the side's lattice
// points. Two triangles of a side agree on those points and on their heights, bit by bit, so the surface is closed: where
// one of them has a finer lattice, its points on the side lie on the other's polyline. (Smits and others 2000, "Direct Ray
// Tracing of Displacement Mapped Triangles", have flat micro-triangles instead.)
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "displacement/displaced_triangle.h"
#include "displacement/height_source.h"
#include "displacement/lattice_cache.h"
#include "kernel/math/vec.h"
#include "kernel/shape/displacement_settings.h"

namespace relief {

/// A base triangle, or a part of one, and its lattice.
struct LatticeTriangle {
  std::uint32_t base = 0;                      ///< triangle of the mesh
  Vec2f corner[3] = {{0, 0}, {1, 0}, {0, 1}};  ///< weights of the base triangle's vertices 1 and 2 at its corners
  std::int32_t n = 1;                          ///< cells along each side
  std::int32_t side_n[3] = {1, 1, 1};          ///< of the side from corner k to the next: divides n

  /// Weights of the base triangle's vertices 1 and 2 at a point with weights b1 and b2 of this one's.
  Vec2f base_weights(float b1, float b2) const
  {
    return (1.0f - b1 - b2) * corner[0] + b1 * corner[1] + b2 * corner[2];
  }
};

/// A square of tiles in a triangle's lattice: 2^level a side, the first at (i, j)·2^level. Level 0 is a tile.
struct LatticeNode {
  std::int32_t level = 0, i = 0, j = 0;
};

/// The place of a tile has 14 bits an axis.
static_assert(kMostHeightCells <= kTileCells << 14);

class ProceduralField {
 public:
  /// @param source     must outlive the field
  /// @param midlevel   height that stands for those that are no numbers
  /// @param cache      for all fields of a scene; must outlive the field
  /// @cost  bounds of all triangles; parallel over triangles
  ProceduralField(const HeightSource& source,
                  std::vector<LatticeTriangle> triangles,
                  float midlevel,
                  LatticeCache& cache);

  const std::vector<LatticeTriangle>& triangles() const { return triangles_; }
  /// Bounds of a triangle's heights.
  LatticeRange range(std::uint32_t triangle) const { return ranges_[triangle]; }
  /// The node that holds all of a triangle.
  LatticeNode root(std::uint32_t triangle) const;
  /// Bounds of the heights over a node's children: (2i, 2j), (2i + 1, 2j), (2i, 2j + 1), (2i + 1, 2j + 1).
  /// @param node  of level 1 or more
  void children(std::uint32_t triangle, const LatticeNode& node, LatticeRange* out) const;
  /// The heights of a tile.
  HeightTileCache::Pin tile(std::uint32_t triangle, std::int32_t i, std::int32_t j) const;
  /// Height at a lattice point; computed each time.
  float lattice_height(std::uint32_t triangle, std::int32_t i, std::int32_t j) const;

  /// Slopes at a point, a lattice unit: linear between lattice points, and at these over one unit to either side, as if the
  /// lattice went on beyond the triangle. So they are continuous where cells meet.
  /// @param b1, b2  weights of the triangle's vertices 1 and 2
  /// @param tile    the field of its tile (i, j), from which the heights of other lattice points are taken
  LatticeSlopes smooth_slopes(std::uint32_t triangle,
                              double b1,
                              double b2,
                              const HeightFieldView& tile,
                              std::int32_t tile_i,
                              std::int32_t tile_j) const;

  /// Whether the source knows no bounds: heights are then held within those of some points.
  bool is_sampled() const { return is_sampled_; }
  std::size_t bytes() const  ///< besides the cache
  {
    return triangles_.size() * (sizeof(LatticeTriangle) + sizeof(LatticeRange));
  }

 private:
  struct Request;
  void find_ranges();
  float rounded(float h) const;
  Request request(const LatticeTriangle& triangle, std::int32_t i, std::int32_t j) const;
  void eval(std::uint32_t base, const Request* requests, std::size_t count, float* h) const;
  void make_tile(std::uint32_t triangle, std::int32_t i, std::int32_t j, HeightTile* tile) const;
  std::uint64_t tile_key(std::uint32_t triangle, std::int32_t i, std::int32_t j) const;
  std::uint64_t node_key(std::uint32_t triangle, const LatticeNode& node) const;
  void find_children(std::uint32_t triangle, const LatticeNode& node, LatticeRange* out) const;

  HeightSource source_;
  std::vector<LatticeTriangle> triangles_;
  std::vector<LatticeRange> ranges_;
  float midlevel_;
  LatticeRange all_;     ///< of all triangles
  float side_grid_ = 0;  ///< heights on sides are multiples of this, so that what is interpolated has no rounding
  bool is_sampled_ = false;
  LatticeCache& cache_;
  std::uint64_t first_triangle_;  ///< of this field in the cache
};

}  // namespace relief
