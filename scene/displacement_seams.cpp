#include "scene/displacement_seams.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "kernel/texture/texture.h"
#include "scene/displaced_mesh.h"

namespace relief {
namespace {

struct Uv {
  double u = 0, v = 0;
};

/// One triangle's edge: its ends by position, the smaller first, and by vertex.
struct EdgeSide {
  std::uint32_t position0 = 0, position1 = 0;
  std::uint32_t vertex0 = 0, vertex1 = 0;

  auto edge() const { return std::tie(position0, position1); }
  auto key() const { return std::tie(position0, position1, vertex0, vertex1); }
};

/// Sides of all edges, those of one edge together; equal sides once.
std::vector<EdgeSide> edge_sides(const Mesh& mesh)
{
  const std::vector<std::uint32_t> first_at = weld_positions(mesh.P);
  std::vector<EdgeSide> sides;
  sides.reserve(3 * mesh.triangles.size());
  const auto add = [&](std::uint32_t a, std::uint32_t b) {
    if (first_at[a] > first_at[b]) {
      std::swap(a, b);
    }
    if (first_at[a] != first_at[b]) {
      sides.push_back({first_at[a], first_at[b], a, b});
    }
  };
  for (const TriangleIndices& t : mesh.triangles) {
    add(t.v0, t.v1);
    add(t.v1, t.v2);
    add(t.v2, t.v0);
  }
  tbb::parallel_sort(sides.begin(), sides.end(),
                     [](const EdgeSide& a, const EdgeSide& b) { return a.key() < b.key(); });
  sides.erase(
      std::unique(sides.begin(), sides.end(), [](const EdgeSide& a, const EdgeSide& b) { return a.key() == b.key(); }),
      sides.end());
  return sides;
}

/// The height map along edges of one mesh.
class SeamProbe {
 public:
  SeamProbe(const Mesh& mesh, const TextureRef& ref, const HeightMapView& map) : mesh_(mesh), ref_(ref), map_(map) {}

  /// Whether the sides have different coordinates at all.
  bool is_split(std::span<const EdgeSide> sides) const
  {
    const auto differ = [&](std::uint32_t a, std::uint32_t b) {
      const Vec2f p = mesh_.uv[ref_.uv_set][a], q = mesh_.uv[ref_.uv_set][b];
      return p.x != q.x || p.y != q.y;
    };
    return std::any_of(sides.begin(), sides.end(), [&](const EdgeSide& side) {
      return differ(side.vertex0, sides[0].vertex0) || differ(side.vertex1, sides[0].vertex1);
    });
  }

  /// Points along an edge that meet every texel of both sides twice.
  double points_wanted(std::span<const EdgeSide> sides) const
  {
    constexpr double kPointsPerTexel = 2;
    double texels = 0;
    for (const EdgeSide& side : sides) {
      const Uv a = vertex_uv(side.vertex0), b = vertex_uv(side.vertex1);
      texels = std::max({texels, std::abs(b.u - a.u) * map_.width, std::abs(b.v - a.v) * map_.height});
    }
    return std::ceil(kPointsPerTexel * texels);
  }

  /// Largest difference of the sides' heights at fraction t of the edge.
  double gap(std::span<const EdgeSide> sides, double t) const
  {
    double low = static_cast<double>(kInfinity), high = -low;
    for (const EdgeSide& side : sides) {
      const Uv a = vertex_uv(side.vertex0), b = vertex_uv(side.vertex1);
      const double h = height({a.u + t * (b.u - a.u), a.v + t * (b.v - a.v)});
      low = std::min(low, h);
      high = std::max(high, h);
    }
    return high - low;
  }

 private:
  Uv vertex_uv(std::uint32_t vertex) const
  {
    const auto d = [](float x) { return static_cast<double>(x); };
    const Vec2f uv = mesh_.uv[ref_.uv_set][vertex];
    return {d(ref_.m00) * d(uv.x) + d(ref_.m01) * d(uv.y) + d(ref_.m02),
            d(ref_.m10) * d(uv.x) + d(ref_.m11) * d(uv.y) + d(ref_.m12)};
  }

  static AxisTexels axis(double u, int size, Wrap wrap)
  {
    // Both periodic modes repeat after two; taken off in double precision, so that a tile far out is as exact as the first.
    const double near = wrap == Wrap::kClamp ? u : u - 2 * std::floor(u / 2);
    return axis_linear(static_cast<float>(near), size, wrap);
  }

  double height(Uv at) const
  {
    const AxisTexels x = axis(at.u, map_.width, map_.wrap_u);
    const AxisTexels y = axis(at.v, map_.height, map_.wrap_v);
    const auto texel = [&](int i, int j) {
      return static_cast<double>(height_at(map_, std::int64_t{j} * map_.width + i));
    };
    const double top = std::lerp(texel(x.i0, y.i0), texel(x.i1, y.i0), static_cast<double>(x.t));
    const double bottom = std::lerp(texel(x.i0, y.i1), texel(x.i1, y.i1), static_cast<double>(x.t));
    return std::lerp(top, bottom, static_cast<double>(y.t));
  }

  const Mesh& mesh_;
  const TextureRef& ref_;
  const HeightMapView& map_;
};

constexpr double kFewestPoints = 16, kMostPoints = 4096;  // along an edge

/// An edge that triangles share with different texture coordinates.
struct SeamEdge {
  std::span<const EdgeSide> sides;
  double points_wanted = 0;  ///< without the bounds
  double first_point = 0;    ///< number of points that edges before it want
};

/// Number of points to compare along an edge.
/// @param share  of what it wants within the bounds
int num_points_of(const SeamEdge& edge, double share)
{
  const double wanted = std::clamp(edge.points_wanted, kFewestPoints, kMostPoints);
  return static_cast<int>(std::max(std::ceil(share * wanted), kFewestPoints));
}

/// One edge's part in the seams; none where its sides ask for the same heights.
SeamExtent seam_extent(const Mesh& mesh,
                       const SeamEdge& edge,
                       const SeamProbe& probe,
                       double share,
                       double least_gap,
                       float scale)
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
    const double gap = probe.gap(edge.sides, (i + within) / num_points);
    if (gap > least_gap) {
      ++num_gaps;
      extent.largest_gap = std::max(extent.largest_gap, gap * std::abs(static_cast<double>(scale)));
    }
  }
  if (num_gaps > 0) {
    extent.num_edges = 1;
    const EdgeSide& side = edge.sides[0];
    extent.length =
        static_cast<double>(length(mesh.P[side.position1] - mesh.P[side.position0])) * num_gaps / num_points;
  }
  return extent;
}

/// Edges whose sides have different texture coordinates.
std::vector<SeamEdge> seam_edges(std::span<const EdgeSide> sides, const SeamProbe& probe)
{
  std::vector<SeamEdge> edges;
  for (std::size_t begin = 0, end = 0; begin < sides.size(); begin = end) {
    while (end < sides.size() && sides[end].edge() == sides[begin].edge()) {
      ++end;
    }
    const std::span<const EdgeSide> edge = sides.subspan(begin, end - begin);
    if (probe.is_split(edge)) {
      edges.push_back({edge, probe.points_wanted(edge)});
    }
  }
  return edges;
}

/// Whether an edge's sides move along different normals. Without normals triangles move along their own.
bool has_split_normals(const Mesh& mesh, std::span<const EdgeSide> edge)
{
  if (mesh.N.empty()) {
    return true;
  }
  const auto differ = [&](std::uint32_t a, std::uint32_t b) {
    const Normal3f m = mesh.N[a], n = mesh.N[b];
    return m.x != n.x || m.y != n.y || m.z != n.z;
  };
  return std::any_of(edge.begin(), edge.end(), [&](const EdgeSide& side) {
    return differ(side.vertex0, edge[0].vertex0) || differ(side.vertex1, edge[0].vertex1);
  });
}

}  // namespace

SeamExtent seam_extent_sum(const SeamExtent& a, const SeamExtent& b)
{
  return {a.num_edges + b.num_edges, a.length + b.length, std::max(a.largest_gap, b.largest_gap)};
}

DisplacementSeams displacement_seams(const Mesh& mesh,
                                     const DisplacementSettings& settings,
                                     const HeightMapView& map,
                                     HeightRange range)
{
  DisplacementSeams seams;
  if (mesh.uv[settings.height.uv_set].empty()) {
    return seams;
  }
  const double least_gap = 1e-3 * (static_cast<double>(range.high) - static_cast<double>(range.low));
  const std::vector<EdgeSide> sides = edge_sides(mesh);
  const SeamProbe probe(mesh, settings.height, map);
  std::vector<SeamEdge> edges = seam_edges(sides, probe);
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
  tbb::parallel_for(std::size_t{0}, edges.size(), [&](std::size_t i) {
    extents[i] = seam_extent(mesh, edges[i], probe, share, least_gap, settings.scale);
  });
  for (std::size_t i = 0; i < edges.size(); ++i) {
    seams.num_points += static_cast<std::size_t>(num_points_of(edges[i], share));
    seams.all = seam_extent_sum(seams.all, extents[i]);
    if (has_split_normals(mesh, edges[i].sides)) {
      seams.split = seam_extent_sum(seams.split, extents[i]);
    }
  }
  return seams;
}

}  // namespace relief
