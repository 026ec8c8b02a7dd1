// Where the vertices of a tessellated triangle are: on the lattice of its cells, and in what order they are stored. Lattice
// position (i, j) has weights near i/n of vertex 1 and j/n of vertex 2.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "displacement/tessellation.h"

namespace relief {

/// Barycentric weights of a lattice vertex and, if it is on an edge, where.
struct LatticeVertex {
  double b[3];
  int edge = -1;           ///< −1: inside
  std::uint32_t step = 0;  ///< along the edge, from its first vertex
  std::uint32_t steps = 1;
};

/// Position along an edge, of `segments` rows, among the points the edge has; every point is met by some row.
inline std::uint32_t lattice_snap(std::uint32_t row, std::uint32_t segments, std::uint32_t edge_segments)
{
  // Every edge has a segment. NOLINTNEXTLINE(clang-analyzer-core.DivideZero)
  return static_cast<std::uint32_t>((2 * std::uint64_t{row} * edge_segments + segments) /
                                    (2 * std::uint64_t{segments}));
}

inline LatticeVertex edge_vertex(int edge, std::uint32_t step, std::uint32_t steps)
{
  LatticeVertex vertex{{0, 0, 0}, edge, step, steps};
  const int next = edge == 2 ? 0 : edge + 1;
  vertex.b[edge] = static_cast<double>(steps - step) / steps;
  vertex.b[next] = static_cast<double>(step) / steps;
  return vertex;
}

/// Vertex (i, j) of a triangle's lattice.
inline LatticeVertex triangle_vertex(const TessellatedTriangle& t, std::uint32_t i, std::uint32_t j)
{
  const std::uint32_t n = t.segments, k = n - i - j;
  const std::uint32_t* of_edge = t.edge_segments;
  if (j == 0) return edge_vertex(0, lattice_snap(i, n, of_edge[0]), of_edge[0]);
  if (k == 0) return edge_vertex(1, lattice_snap(j, n, of_edge[1]), of_edge[1]);
  if (i == 0) return edge_vertex(2, lattice_snap(k, n, of_edge[2]), of_edge[2]);
  return {{static_cast<double>(k) / n, static_cast<double>(i) / n, static_cast<double>(j) / n}};
}

/// Vertex (x, y) of the grid at a corner: x leads to the middle of the edge that starts there, y to that of the edge that
/// ends there, and the opposite vertex is the triangle's centre.
inline LatticeVertex grid_vertex(const TessellatedTriangle& t, int corner, std::uint32_t x, std::uint32_t y)
{
  const std::uint32_t n = t.segments;
  const int next = corner == 2 ? 0 : corner + 1, previous = corner == 0 ? 2 : corner - 1;
  if (y == 0) {
    const std::uint32_t half = t.edge_segments[corner];
    return edge_vertex(corner, lattice_snap(x, n, half), 2 * half);
  }
  if (x == 0) {
    const std::uint32_t half = t.edge_segments[previous];
    return edge_vertex(previous, 2 * half - lattice_snap(y, n, half), 2 * half);
  }
  // Whole sixths of 1/n² keep the weights exact, so that grids agree along the sides that they share.
  const std::uint64_t fx = x, fy = y, gx = n - x, gy = n - y;
  const std::uint64_t at_corner = gx * gy, along = fx * gy, across = gx * fy, at_centre = fx * fy;
  const double whole = 6.0 * static_cast<double>(n) * n;
  LatticeVertex vertex{{0, 0, 0}};
  vertex.b[corner] = static_cast<double>(6 * at_corner + 3 * along + 3 * across + 2 * at_centre) / whole;
  vertex.b[next] = static_cast<double>(3 * along + 2 * at_centre) / whole;
  vertex.b[previous] = static_cast<double>(3 * across + 2 * at_centre) / whole;
  return vertex;
}

/// A triangle's lattice in rows that get shorter: row j from weight j/n of vertex 2 on.
struct LatticeRows {
  std::uint64_t n;  ///< cells a side

  std::uint64_t num_vertices() const { return (n + 1) * (n + 2) / 2; }
  std::uint64_t vertex(std::uint64_t i, std::uint64_t j) const { return j * (n + 1) - j * (j - 1) / 2 + i; }
};

/// The first row, of rows with r, r − 1, … 1 entries, that an entry is in, and its place there.
struct RowPlace {
  std::uint32_t row, place;
};
inline RowPlace row_place(std::uint32_t r, std::uint32_t entry)
{
  const std::uint64_t left = std::uint64_t{r} * (std::uint64_t{r} + 1) / 2 - entry;
  auto rows = static_cast<std::uint64_t>(0.5 * std::sqrt(8.0 * static_cast<double>(left) + 1.0));
  while (rows * (rows + 1) / 2 < left) ++rows;
  while (rows * (rows - 1) / 2 >= left) --rows;
  return {static_cast<std::uint32_t>(r - rows), static_cast<std::uint32_t>(rows * (rows + 1) / 2 - left)};
}

/// A triangle's lattice in square blocks of cells, row by row; each has its vertices to itself, row by row. Blocks at the third side
/// have cells beyond it, whose corners are brought to the end of their row. So nothing is left of these cells, and the micro-triangles
/// are those of the lattice.
class LatticeBlocks {
 public:
  /// Cells a side of all blocks that the third side does not end. Where a block's vertices are next to each other, rays took .86 of
  /// what they take in grids of whole lattices; 16 cells were as fast, 4 slower.
  static constexpr std::uint32_t kCells = 8;

  /// @param n  cells a side of the lattice, > 0
  explicit LatticeBlocks(std::uint32_t n) : side_((n + kCells - 1) / kCells), last_(n - kCells * (side_ - 1)) {}

  struct Block {
    std::uint32_t i, j;          ///< of its first vertex
    std::uint32_t cells;         ///< a side
    std::uint32_t first_vertex;  ///< in the triangle
  };

  std::uint64_t num_blocks() const { return std::uint64_t{side_} * (side_ + 1) / 2; }
  std::uint64_t num_vertices() const
  {
    return (num_blocks() - side_) * vertices_in(kCells) + std::uint64_t{side_} * vertices_in(last_);
  }
  /// 2 × 2 cells, or what there is of them: what Embree makes boxes of.
  std::uint64_t num_quarters() const
  {
    constexpr std::uint64_t kFull = std::uint64_t{kCells / 2} * (kCells / 2);
    const std::uint64_t along = (last_ + 1) / 2;
    return (num_blocks() - side_) * kFull + side_ * along * along;
  }
  Block block(std::uint32_t index) const
  {
    const auto [row, column] = row_place(side_, index);
    return at(column, row, index);
  }
  /// A vertex of the lattice, in one of the blocks that have it.
  std::uint32_t vertex(std::uint32_t i, std::uint32_t j) const
  {
    const std::uint32_t row = std::min(j / kCells, side_ - 1), column = std::min(i / kCells, side_ - 1 - row);
    const Block b = at(column, row, row * side_ - row * (row - 1) / 2 + column);
    return b.first_vertex + (j - b.j) * (b.cells + 1) + (i - b.i);
  }

 private:
  static std::uint32_t vertices_in(std::uint32_t cells) { return (cells + 1) * (cells + 1); }
  Block at(std::uint32_t column, std::uint32_t row, std::uint32_t index) const
  {
    // Each row before this one has one block at the third side.
    return {column * kCells, row * kCells, column + row + 1 == side_ ? last_ : kCells,
            (index - row) * vertices_in(kCells) + row * vertices_in(last_)};
  }

  std::uint32_t side_, last_;
};

}  // namespace relief
