#include "displacement/seams.h"

#include <tbb/parallel_for.h>

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

/// @param start  the corner that it begins at, welded
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

bool is_same(const Side& a, const Side& b, const HeightFieldView& field)
{
  return is_same(a.x, b.x, field.x) && is_same(a.y, b.y, field.y);
}

/// Calls f with the edges between the same two places, where there are several.
/// @param corners  welded: by position, or by position and normal
template <class F>
void each_shared_edge(std::span<const std::uint32_t> corners, F&& f)
{
  const std::vector<std::uint32_t> first = weld_edges(corners);
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
    f(std::span<const std::uint32_t>(group));
  }
}

constexpr double kFewestPoints = 16, kMostPoints = 4096;  // along an edge

/// A seam of the report.
struct SeamEdge {
  std::vector<Side> sides;
  double length = 0;  ///< metres
  bool split = false;
  double points_wanted = 0;  ///< that meet every texel of all sides twice
  double first_point = 0;    ///< number of points that edges before it want
};

double points_wanted(const std::vector<Side>& sides)
{
  constexpr double kPointsPerTexel = 2;
  double texels = 0;
  for (const Side& side : sides) {
    texels = std::max({texels, std::abs(side.x[1] - side.x[0]), std::abs(side.y[1] - side.y[0])});
  }
  return std::ceil(kPointsPerTexel * texels);
}

std::vector<SeamEdge> seam_edges(const DisplacedMeshView& mesh)
{
  const std::span triangles(mesh.triangles, mesh.num_triangles);
  const std::vector<std::uint32_t> places = weld_positions(triangles), corners = weld_corners(triangles);
  std::vector<SeamEdge> edges;
  each_shared_edge(places, [&](std::span<const std::uint32_t> group) {
    const std::uint32_t start = places[group[0]];
    SeamEdge seam;
    for (const std::uint32_t edge : group) {
      const Side side = side_of(triangles, places, edge, start);
      const auto is_known = [&](const Side& known) { return is_same(known, side, *mesh.field); };
      if (std::none_of(seam.sides.begin(), seam.sides.end(), is_known)) seam.sides.push_back(side);
      const auto welded = [&](std::uint32_t e) { return std::minmax({corners[e], corners[edge_end(e)]}); };
      seam.split = seam.split || welded(edge) != welded(group[0]);
    }
    if (seam.sides.size() < 2) return;
    const DisplacedTriangle& tri = triangles[group[0] / 3];
    seam.length = length(to_double(tri.P[edge_end(group[0]) % 3]) - to_double(tri.P[group[0] % 3]));
    seam.points_wanted = points_wanted(seam.sides);
    edges.push_back(std::move(seam));
  });
  return edges;
}

/// Largest difference of the sides' heights at a fraction of the edge.
double gap_at(const SeamEdge& edge, const HeightFieldView& field, double fraction)
{
  double low = static_cast<double>(kInfinity), high = -low;
  for (const Side& side : edge.sides) {
    const double h = interpolate_height(field, side.x[0] + fraction * (side.x[1] - side.x[0]),
                                        side.y[0] + fraction * (side.y[1] - side.y[0]));
    low = std::min(low, h);
    high = std::max(high, h);
  }
  return high - low;
}

/// Number of points to compare along an edge.
/// @param share  of what it wants within the bounds
int num_points_of(const SeamEdge& edge, double share)
{
  const double wanted = std::clamp(edge.points_wanted, kFewestPoints, kMostPoints);
  return static_cast<int>(std::max(std::ceil(share * wanted), kFewestPoints));
}

/// One edge's part in the seams; none where its sides ask for the same heights.
SeamExtent seam_extent(const DisplacedMeshView& mesh, const SeamEdge& edge, double share, double least_gap)
{
  SeamExtent extent;
  const int num_points = num_points_of(edge, share);
  // Where tiles and points are in step, fewer points than texels would all see the same one; and the edges of a regular mesh
  // would all see the same few.
  constexpr double kGoldenRatio = 0.6180339887498949;
  const bool is_sparse = num_points < edge.points_wanted;
  int num_gaps = 0;
  for (int i = 0; i < num_points; ++i) {
    const double turn = (edge.first_point + i) * kGoldenRatio;
    const double within = is_sparse ? turn - std::floor(turn) : 0.5;
    const double gap = gap_at(edge, *mesh.field, (i + within) / num_points);
    if (gap <= least_gap) continue;
    ++num_gaps;
    extent.largest_gap = std::max(extent.largest_gap, gap * std::abs(mesh.scale));
  }
  if (num_gaps > 0) {
    extent.num_edges = 1;
    extent.length = edge.length * num_gaps / num_points;
  }
  return extent;
}

}  // namespace

std::vector<SeamWall> seam_walls_make(std::span<const DisplacedTriangle> triangles, const HeightFieldView& field)
{
  const std::vector<std::uint32_t> corners = weld_corners(triangles);
  std::vector<SeamWall> walls;
  const auto add = [&](std::uint32_t edge, std::uint32_t other) {
    const Side own = side_of(triangles, corners, edge, corners[edge]);
    const Side there = side_of(triangles, corners, other, corners[edge]);
    if (is_same(own, there, field)) return;
    walls.push_back({edge, {there.x[0], there.x[1]}, {there.y[0], there.y[1]}});
  };
  each_shared_edge(corners, [&](std::span<const std::uint32_t> group) {
    const std::size_t count = group.size();
    for (std::size_t k = 0; k < count; ++k) {
      add(group[k], group[(k + 1) % count]);
      if (count > 2) add(group[k], group[(k + count - 1) % count]);
    }
  });
  std::sort(walls.begin(), walls.end(), [](const SeamWall& a, const SeamWall& b) { return a.edge < b.edge; });
  return walls;
}

SeamExtent seam_extent_sum(const SeamExtent& a, const SeamExtent& b)
{
  return {a.num_edges + b.num_edges, a.length + b.length, std::max(a.largest_gap, b.largest_gap)};
}

SeamReport seam_report(const DisplacedMeshView& mesh)
{
  double low = 0, high = 0;
  stored_to_heights(*mesh.field, mesh.field->range, &low, &high);
  const double least_gap = 1e-3 * (high - low);
  std::vector<SeamEdge> edges = seam_edges(mesh);
  // Many tiles along many edges could ask for any number of points. A mesh has its share of them, a third of a second of
  // one processor; where that is less than wanted, what is found is an estimate.
  constexpr double kMostPointsOfMesh = 1 << 22;
  double wanted = 0;
  for (SeamEdge& edge : edges) {
    edge.first_point = wanted;
    wanted += std::clamp(edge.points_wanted, kFewestPoints, kMostPoints);
  }
  const double share = std::min(1.0, kMostPointsOfMesh / wanted);
  std::vector<SeamExtent> extents(edges.size());
  tbb::parallel_for(std::size_t{0}, edges.size(),
                    [&](std::size_t i) { extents[i] = seam_extent(mesh, edges[i], share, least_gap); });
  SeamReport report;
  for (std::size_t i = 0; i < edges.size(); ++i) {
    report.num_points += static_cast<std::size_t>(num_points_of(edges[i], share));
    report.all = seam_extent_sum(report.all, extents[i]);
    if (edges[i].split) report.split = seam_extent_sum(report.split, extents[i]);
  }
  return report;
}

}  // namespace relief
