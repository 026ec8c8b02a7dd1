#include "displacement/seam_walls_make.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "displacement/shared_edges.h"

namespace relief {

namespace {

/// Lattice coordinates of one triangle along an edge, from one of its ends to the other.
struct Side {
  double x[2], y[2];
};

/// @param start  the corner that it begins at, from weld_corners
Side side_of(std::span<const DisplacedTriangle> triangles,
             std::span<const std::uint32_t> corners,
             std::uint32_t edge,
             std::uint32_t start)
{
  const DisplacedTriangle& tri = triangles[edge / 3];
  std::uint32_t first = edge % 3, last = edge_end(edge) % 3;
  if (corners[edge] != start) std::swap(first, last);
  return {{tri.x[first], tri.x[last]}, {tri.y[first], tri.y[last]}};
}

/// Whether two stretches of an axis differ by whole periods only.
bool is_same(const double* a, const double* b, const LatticeAxis& axis)
{
  constexpr double kRounding = 1e-9;  // of coordinates below 2^16 cells, in doubles
  const double periods = axis.wrap == Wrap::kClamp ? 0 : std::round((b[0] - a[0]) / axis.num_cells);
  const double shift = periods * axis.num_cells;
  return std::abs(b[0] - a[0] - shift) < kRounding && std::abs(b[1] - a[1] - shift) < kRounding;
}

}  // namespace

std::vector<SeamWall> seam_walls_make(std::span<const DisplacedTriangle> triangles, const HeightFieldView& field)
{
  const std::vector<std::uint32_t> corners = weld_corners(triangles), first = weld_edges(corners);
  std::vector<SeamWall> walls;
  const auto add = [&](std::uint32_t edge, std::uint32_t other) {
    const Side own = side_of(triangles, corners, edge, corners[edge]);
    const Side there = side_of(triangles, corners, other, corners[edge]);
    if (is_same(own.x, there.x, field.x) && is_same(own.y, there.y, field.y)) return;
    walls.push_back({edge, {there.x[0], there.x[1]}, {there.y[0], there.y[1]}});
  };
  // Edges between the same ends in a chain that starts at the first of them.
  constexpr std::uint32_t kNone = ~0u;
  std::vector<std::uint32_t> next(first.size(), kNone), last(first.size());
  for (std::uint32_t edge = 0; edge < first.size(); ++edge) {
    if (first[edge] != edge) next[last[first[edge]]] = edge;
    last[first[edge]] = edge;
  }
  std::vector<std::uint32_t> group;
  for (std::uint32_t edge = 0; edge < first.size(); ++edge) {
    if (first[edge] != edge || next[edge] == kNone || corners[edge] == corners[edge_end(edge)]) continue;
    group.clear();
    for (std::uint32_t at = edge; at != kNone; at = next[at]) group.push_back(at);
    const std::size_t count = group.size();
    for (std::size_t k = 0; k < count; ++k) {
      add(group[k], group[(k + 1) % count]);
      if (count > 2) add(group[k], group[(k + count - 1) % count]);
    }
  }
  std::sort(walls.begin(), walls.end(), [](const SeamWall& a, const SeamWall& b) { return a.edge < b.edge; });
  return walls;
}

}  // namespace relief
