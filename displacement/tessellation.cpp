#include "displacement/tessellation.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include "displacement/plane_clearance.h"
#include "displacement/shared_edges.h"

namespace relief {

namespace {

/// Barycentric weights of a lattice vertex and, if it is on an edge, where.
struct LatticeVertex {
  double b[3];
  int edge = -1;           ///< −1: inside
  std::uint32_t step = 0;  ///< along the edge, from its first vertex
  std::uint32_t steps = 1;
};

/// Position along an edge, of `segments` rows, among the points the edge has; every point is met by some row.
std::uint32_t snap(std::uint32_t row, std::uint32_t segments, std::uint32_t edge_segments)
{
  // Every edge has a segment. NOLINTNEXTLINE(clang-analyzer-core.DivideZero)
  return static_cast<std::uint32_t>((2 * std::uint64_t{row} * edge_segments + segments) /
                                    (2 * std::uint64_t{segments}));
}

LatticeVertex edge_vertex(int edge, std::uint32_t step, std::uint32_t steps)
{
  LatticeVertex vertex{{0, 0, 0}, edge, step, steps};
  const int next = edge == 2 ? 0 : edge + 1;
  vertex.b[edge] = static_cast<double>(steps - step) / steps;
  vertex.b[next] = static_cast<double>(step) / steps;
  return vertex;
}

/// Vertex (i, j) of a triangle's lattice: weights near i/n of vertex 1 and j/n of vertex 2.
LatticeVertex triangle_vertex(const TessellatedTriangle& t, std::uint32_t i, std::uint32_t j)
{
  const std::uint32_t n = t.segments, k = n - i - j;
  const std::uint32_t* of_edge = t.edge_segments;
  if (j == 0) return edge_vertex(0, snap(i, n, of_edge[0]), of_edge[0]);
  if (k == 0) return edge_vertex(1, snap(j, n, of_edge[1]), of_edge[1]);
  if (i == 0) return edge_vertex(2, snap(k, n, of_edge[2]), of_edge[2]);
  return {{static_cast<double>(k) / n, static_cast<double>(i) / n, static_cast<double>(j) / n}};
}

/// Vertex (x, y) of the grid at a corner: x leads to the middle of the edge that starts there, y to that of the edge that
/// ends there, and the opposite vertex is the triangle's centre.
LatticeVertex grid_vertex(const TessellatedTriangle& t, int corner, std::uint32_t x, std::uint32_t y)
{
  const std::uint32_t n = t.segments;
  const int next = corner == 2 ? 0 : corner + 1, previous = corner == 0 ? 2 : corner - 1;
  if (y == 0) {
    const std::uint32_t half = t.edge_segments[corner];
    return edge_vertex(corner, snap(x, n, half), 2 * half);
  }
  if (x == 0) {
    const std::uint32_t half = t.edge_segments[previous];
    return edge_vertex(previous, 2 * half - snap(y, n, half), 2 * half);
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

struct Placed {
  Vec3d P;
  double d = 0;
};

/// The surface at weights b. Written as sums of three products, which on an edge do not depend on the order of its ends.
Placed place(const DisplacedMeshView& mesh, const TessellationRule& rule, const DisplacedTriangle& tri, const double* b)
{
  const Vec3d P = b[0] * to_double(tri.P[0]) + b[1] * to_double(tri.P[1]) + b[2] * to_double(tri.P[2]);
  const Vec3d N = b[0] * to_double(tri.N[0]) + b[1] * to_double(tri.N[1]) + b[2] * to_double(tri.N[2]);
  const double nu = length(N);
  if (!(nu > 0)) return {P, 0};
  const double x = b[0] * tri.x[0] + b[1] * tri.x[1] + b[2] * tri.x[2];
  const double y = b[0] * tri.y[0] + b[1] * tri.y[1] + b[2] * tri.y[2];
  const double d = rule.height ? mesh.scale * (rule.height(P, x, y) - mesh.midlevel) : displacement_at(mesh, x, y);
  return {P + (d / nu) * N, d};
}

/// Two heights of one point that differ by less are one height: they have rounding errors, or the seam between them is to
/// be closed. The row of micro-triangles along the seam then leans towards its other side, where the exact methods have a
/// wall.
double seam_tolerance(const DisplacedMeshView& mesh)
{
  if (mesh.seam_edges != nullptr) return HUGE_VAL;
  double low, high;
  stored_to_heights(*mesh.field, mesh.field->range, &low, &high);
  return 1e-6 * std::abs(mesh.scale) * (high - low);
}

/// The corner that computes a corner's point: the first one at the same place with the same height.
std::vector<std::uint32_t> corner_owners(const DisplacedMeshView& mesh,
                                         const TessellationRule& rule,
                                         const std::vector<std::uint32_t>& id)
{
  const std::size_t count = id.size();
  const double tolerance = seam_tolerance(mesh);
  std::vector<double> d(count);
  tbb::parallel_for(std::size_t{0}, count, [&](std::size_t corner) {
    double b[3] = {0, 0, 0};
    b[corner % 3] = 1;
    d[corner] = place(mesh, rule, mesh.triangles[corner / 3], b).d;
  });
  // Owners of one place in a chain that starts at its first corner, whose height nearly all have.
  std::vector<std::uint32_t> owner = id;
  constexpr std::uint32_t kNone = ~0u;
  std::vector<std::uint32_t> next;
  for (std::uint32_t corner = 0; corner < count; ++corner) {
    std::uint32_t at = id[corner];
    if (at == corner || std::abs(d[at] - d[corner]) <= tolerance) continue;
    if (next.empty()) next.assign(count, kNone);
    while (std::abs(d[at] - d[corner]) > tolerance && next[at] != kNone) at = next[at];
    if (std::abs(d[at] - d[corner]) <= tolerance) {
      owner[corner] = at;
    } else {
      next[at] = owner[corner] = corner;
    }
  }
  return owner;
}

/// Whole segments of an edge.
std::uint32_t whole_segments(double wanted)
{
  // A little less, so that an edge of whole texels does not get one more by rounding. More than a million segments are
  // refused when the vertices are counted.
  return static_cast<std::uint32_t>(std::clamp(std::ceil(wanted - 1e-3), 1.0, 1e6));
}

/// Vertices of a triangle with n segments a side.
std::uint64_t triangle_vertices(std::uint64_t n) { return (n + 1) * (n + 2) / 2; }

}  // namespace

std::uint64_t TessellationLayout::bytes() const
{
  // Embree reads 16 bytes at the last vertex.
  const std::uint64_t vertices = (3 * num_vertices + 1) * sizeof(float);
  return vertices + (kind == TessellationKind::kQuads ? num_primitives * 4 * sizeof(std::uint32_t)
                                                      : num_primitives * sizeof(RTCGrid));
}

namespace {

/// Divides triangles by the whole segments of their edges, 3 · triangle + edge, and counts what that makes.
template <typename Segments>
void divide_triangles(std::uint32_t num_triangles, const Segments& segments, TessellationLayout* layout)
{
  layout->triangles.resize(num_triangles);
  const bool grids = layout->kind == TessellationKind::kGrids;
  for (std::uint32_t index = 0; index < num_triangles; ++index) {
    TessellatedTriangle& t = layout->triangles[index];
    for (std::uint32_t k = 0; k < 3; ++k) {
      const std::uint32_t whole = segments(3 * index + k);
      t.edge_segments[k] = grids ? (whole + 1) / 2 : whole;
      t.segments = std::max(t.segments, t.edge_segments[k]);
    }
    t.first_vertex = static_cast<std::uint32_t>(layout->num_vertices);
    t.first_primitive = static_cast<std::uint32_t>(layout->num_primitives);
    const std::uint64_t n = t.segments;
    layout->num_vertices += grids ? 3 * (n + 1) * (n + 1) : triangle_vertices(n);
    layout->num_primitives += grids ? 3 : n * (n + 1) / 2;
    layout->num_micro_triangles += grids ? 6 * n * n : n * n;
  }
}

}  // namespace

TessellationLayout tessellation_layout_make(const DisplacedMeshView& mesh,
                                            TessellationKind kind,
                                            const TessellationRule& rule)
{
  TessellationLayout layout;
  layout.kind = kind;
  const std::vector<std::uint32_t> id = weld_corners({mesh.triangles, mesh.num_triangles});
  layout.corner_owner = corner_owners(mesh, rule, id);
  layout.edge_owner = weld_edges(id);

  std::vector<std::uint32_t> segments(layout.edge_owner.size());
  tbb::parallel_for(std::size_t{0}, segments.size(), [&](std::size_t edge) {
    segments[edge] = whole_segments(rule.segments(mesh.triangles[edge / 3], static_cast<int>(edge % 3)));
  });
  for (std::uint32_t edge = 0; edge < segments.size(); ++edge) {
    std::uint32_t& largest = segments[layout.edge_owner[edge]];
    largest = std::max(largest, segments[edge]);
  }
  divide_triangles(
      mesh.num_triangles, [&](std::uint32_t edge) { return segments[layout.edge_owner[edge]]; }, &layout);
  return layout;
}

TessellationLayout tessellation_layout_make(const DisplacedMeshView& mesh, TessellationKind kind, double rate)
{
  TessellationRule rule;
  rule.segments = [rate](const DisplacedTriangle& tri, int edge) { return rate * texels_along(tri, edge); };
  return tessellation_layout_make(mesh, kind, rule);
}

TessellationLayout tessellation_layout_least(const DisplacedMeshView& mesh, TessellationKind kind, double rate)
{
  TessellationLayout layout;
  layout.kind = kind;
  const auto segments = [&](std::uint32_t edge) {
    return whole_segments(rate * texels_along(mesh.triangles[edge / 3], static_cast<int>(edge % 3)));
  };
  divide_triangles(mesh.num_triangles, segments, &layout);
  return layout;
}

std::uint64_t tessellation_peak_bytes(const TessellationLayout& layout, const TessellationBuild& build)
{
  // Peaks of Embree 3.13.5 beside its inputs, on flat and wavy meshes of .05 to 9 million micro-triangles: 62 to 74 bytes for
  // each (39 to 42 stay), 33 to 51 if compact (19 to 36 stay), and 82 to 116 for each 2 × 2 cells of a grid.
  constexpr std::uint64_t kMicroTriangle = 76, kCompactMicroTriangle = 53, kGridBlock = 116;
  if (layout.kind == TessellationKind::kQuads) {
    return layout.bytes() + layout.num_micro_triangles * (build.compact ? kCompactMicroTriangle : kMicroTriangle);
  }
  std::uint64_t num_blocks = 0;
  for (const TessellatedTriangle& t : layout.triangles) {
    const std::uint64_t blocks = (std::uint64_t{t.segments} + 1) / 2;
    num_blocks += 3 * blocks * blocks;
  }
  return layout.bytes() + num_blocks * kGridBlock;
}

struct Tessellation::MicroTriangle {
  std::uint32_t triangle = 0;
  std::uint64_t vertex[3] = {0, 0, 0};
  double weight[3] = {1, 0, 0};  ///< of the hit
  double b1 = 0, b2 = 0;         ///< of the hit, of the base triangle's vertices 1 and 2

  void add_weights(int k, const LatticeVertex& of)
  {
    b1 += weight[k] * of.b[1];
    b2 += weight[k] * of.b[2];
  }
};

Tessellation::Tessellation(const DisplacedMeshView& mesh, TessellationLayout layout, const TessellationRule& rule)
    : mesh_(mesh), layout_(std::move(layout))
{
  constexpr std::uint64_t kMost = ~std::uint32_t{0};
  constexpr std::uint32_t kMostGridCells = 32766;  // a side
  bool fits = layout_.num_vertices <= kMost && layout_.num_primitives <= kMost;
  if (layout_.kind == TessellationKind::kGrids) {
    for (const TessellatedTriangle& t : layout_.triangles) fits &= t.segments <= kMostGridCells;
  }
  if (!fits) throw std::length_error("a tessellation is finer than Embree can count: a lower rate is needed");
  vertices_ = std::make_unique_for_overwrite<float[]>(3 * layout_.num_vertices + 1);
  if (layout_.kind == TessellationKind::kQuads) {
    indices_ = std::make_unique_for_overwrite<std::uint32_t[]>(4 * layout_.num_primitives);
  } else {
    grids_.resize(layout_.num_primitives);
  }
  tbb::parallel_for(std::uint32_t{0}, mesh_.num_triangles, [&](std::uint32_t index) { fill(index, rule); });
  layout_.edge_owner = {};
  layout_.corner_owner = {};
  // Of every 2^kLog2Owners-th primitive, and the last triangle once more.
  owners_.reserve((layout_.num_primitives >> kLog2Owners) + 2);
  for (std::uint32_t index = 0; index + 1 < mesh_.num_triangles; ++index) {
    const std::uint32_t end = layout_.triangles[index + 1].first_primitive;
    while ((owners_.size() << kLog2Owners) < end) owners_.push_back(index);
  }
  owners_.resize((layout_.num_primitives >> kLog2Owners) + 2, mesh_.num_triangles - 1);
}

void Tessellation::fill(std::uint32_t index, const TessellationRule& rule)
{
  const TessellatedTriangle& t = layout_.triangles[index];
  const DisplacedTriangle& tri = mesh_.triangles[index];
  const double tolerance = seam_tolerance(mesh_);

  const auto position = [&](const LatticeVertex& vertex) {
    Placed own = place(mesh_, rule, tri, vertex.b);
    if (vertex.edge < 0) return own.P;
    if (vertex.step == 0 || vertex.step == vertex.steps) {
      const int corner = vertex.step == 0 ? vertex.edge : (vertex.edge == 2 ? 0 : vertex.edge + 1);
      const std::uint32_t owner = layout_.corner_owner[3 * index + static_cast<std::uint32_t>(corner)];
      double b[3] = {0, 0, 0};
      b[owner % 3] = 1;
      return place(mesh_, rule, mesh_.triangles[owner / 3], b).P;
    }
    const std::uint32_t edge = 3 * index + static_cast<std::uint32_t>(vertex.edge);
    const std::uint32_t owner = layout_.edge_owner[edge];
    if (owner == edge) return own.P;
    // The owner may run the other way. Positions tell: the ends of an edge are places.
    const DisplacedTriangle& other = mesh_.triangles[owner / 3];
    const int first = static_cast<int>(owner % 3);
    const bool same_way = other.P[first] == tri.P[vertex.edge];
    const LatticeVertex there = edge_vertex(first, same_way ? vertex.step : vertex.steps - vertex.step, vertex.steps);
    const Placed shared = place(mesh_, rule, other, there.b);
    return std::abs(shared.d - own.d) <= tolerance ? shared.P : own.P;
  };
  float* out = vertices_.get() + 3 * std::size_t{t.first_vertex};
  const auto put = [&](const LatticeVertex& vertex) {
    const Vec3f P = to_float(position(vertex));
    *out++ = P.x;
    *out++ = P.y;
    *out++ = P.z;
  };

  const std::uint32_t n = t.segments;
  if (layout_.kind == TessellationKind::kGrids) {
    for (int corner = 0; corner < 3; ++corner) {
      const std::uint32_t first = static_cast<std::uint32_t>(corner) * (n + 1) * (n + 1);
      grids_[t.first_primitive + static_cast<std::uint32_t>(corner)] = {
          t.first_vertex + first, n + 1, static_cast<unsigned short>(n + 1), static_cast<unsigned short>(n + 1)};
      for (std::uint32_t y = 0; y <= n; ++y) {
        for (std::uint32_t x = 0; x <= n; ++x) put(grid_vertex(t, corner, x, y));
      }
    }
    return;
  }
  std::uint32_t* index_out = indices_.get() + 4 * std::size_t{t.first_primitive};
  std::uint32_t row = t.first_vertex;
  for (std::uint32_t j = 0; j <= n; ++j) {
    const std::uint32_t next_row = row + (n - j + 1);
    for (std::uint32_t i = 0; i + j <= n; ++i) put(triangle_vertex(t, i, j));
    for (std::uint32_t i = 0; i + j < n; ++i) {
      const std::uint32_t a = row + i, c = next_row + i;
      // Embree takes a quadrilateral whose last two vertices are one for a triangle.
      for (const std::uint32_t v : {a, a + 1, i + j + 1 == n ? c : c + 1, c}) *index_out++ = v;
    }
    row = next_row;
  }
}

Box3 Tessellation::bounds() const
{
  return tbb::parallel_reduce(
      tbb::blocked_range<std::size_t>(0, layout_.num_vertices), box_empty(),
      [&](const tbb::blocked_range<std::size_t>& range, Box3 box) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) box = box_union(box, {vertex(i), vertex(i)});
        return box;
      },
      box_union);
}

RTCGeometry Tessellation::geometry_make(RTCDevice device) const
{
  const bool grids = layout_.kind == TessellationKind::kGrids;
  RTCGeometry geometry = rtcNewGeometry(device, grids ? RTC_GEOMETRY_TYPE_GRID : RTC_GEOMETRY_TYPE_QUAD);
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, vertices_.get(), 0,
                             3 * sizeof(float), layout_.num_vertices);
  if (grids) {
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_GRID, 0, RTC_FORMAT_GRID, grids_.data(), 0, sizeof(RTCGrid),
                               layout_.num_primitives);
  } else {
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT4, indices_.get(), 0,
                               4 * sizeof(std::uint32_t), layout_.num_primitives);
  }
  return geometry;
}

std::vector<SidePoint> Tessellation::side(std::uint32_t triangle, int k) const
{
  const TessellatedTriangle& t = layout_.triangles[triangle];
  const std::uint32_t n = t.segments;
  std::vector<SidePoint> out;
  const auto add = [&](const LatticeVertex& at, std::uint64_t index) {
    // Of a corner the vertex says no side; the ends are those of this one.
    const int next = k == 2 ? 0 : k + 1;
    out.push_back({at.b[next], vertex(t.first_vertex + index)});
  };
  if (layout_.kind == TessellationKind::kGrids) {
    const auto corner = static_cast<std::uint64_t>(k), next = static_cast<std::uint64_t>(k == 2 ? 0 : k + 1);
    const std::uint64_t row = n + 1;
    for (std::uint32_t x = 0; x <= n; ++x) add(grid_vertex(t, k, x, 0), corner * row * row + x);
    for (std::uint32_t y = 0; y <= n; ++y)
      add(grid_vertex(t, static_cast<int>(next), 0, y), next * row * row + y * row);
    return out;
  }
  for (std::uint32_t step = 0; step <= n; ++step) {
    const std::uint32_t i = k == 0 ? step : k == 1 ? n - step : 0, j = k == 0 ? 0 : k == 1 ? step : n - step;
    add(triangle_vertex(t, i, j), std::uint64_t{j} * (n + 1) - std::uint64_t{j} * (std::uint64_t{j} - 1) / 2 + i);
  }
  return out;
}

/// The base triangle of a primitive.
std::uint32_t Tessellation::triangle_of(std::uint32_t primitive) const
{
  // The last triangle that starts at or before the primitive.
  const auto first = layout_.triangles.begin();
  const auto after = std::upper_bound(
      first + owners_[primitive >> kLog2Owners], first + owners_[(primitive >> kLog2Owners) + 1] + 1, primitive,
      [](std::uint32_t p, const TessellatedTriangle& triangle) { return p < triangle.first_primitive; });
  return static_cast<std::uint32_t>(std::prev(after) - first);
}

Tessellation::MicroTriangle Tessellation::micro_triangle(std::uint32_t primitive, float u, float v) const
{
  MicroTriangle micro;
  micro.triangle = triangle_of(primitive);
  const TessellatedTriangle& t = layout_.triangles[micro.triangle];
  const std::uint32_t n = t.segments, local = primitive - t.first_primitive;

  if (layout_.kind == TessellationKind::kGrids) {
    // Embree's u and v span the whole grid.
    const double gx = std::clamp(static_cast<double>(u) * n, 0.0, static_cast<double>(n));
    const double gy = std::clamp(static_cast<double>(v) * n, 0.0, static_cast<double>(n));
    const std::uint32_t x = std::min(static_cast<std::uint32_t>(gx), n - 1);
    const std::uint32_t y = std::min(static_cast<std::uint32_t>(gy), n - 1);
    const double fx = gx - x, fy = gy - y;
    const bool lower = fx + fy <= 1;
    const std::uint32_t at[3][2] = {{lower ? x : x + 1, lower ? y : y + 1}, {x + 1, y}, {x, y + 1}};
    micro.weight[0] = lower ? 1 - fx - fy : fx + fy - 1;
    micro.weight[1] = lower ? fx : 1 - fy;
    micro.weight[2] = lower ? fy : 1 - fx;
    for (int k = 0; k < 3; ++k) {
      micro.vertex[k] =
          t.first_vertex + std::uint64_t{local} * (n + 1) * (n + 1) + std::uint64_t{at[k][1]} * (n + 1) + at[k][0];
      micro.add_weights(k, grid_vertex(t, static_cast<int>(local), at[k][0], at[k][1]));
    }
    return micro;
  }
  // Rows from j on have r(r + 1)/2 quadrilaterals, r = n − j.
  const std::uint64_t left = std::uint64_t{n} * (n + 1) / 2 - local;
  auto rows = static_cast<std::uint64_t>(0.5 * std::sqrt(8.0 * static_cast<double>(left) + 1.0));
  while (rows * (rows + 1) / 2 < left) ++rows;
  while (rows * (rows - 1) / 2 >= left) --rows;
  const auto j = static_cast<std::uint32_t>(n - rows);
  const auto i = static_cast<std::uint32_t>(rows * (rows + 1) / 2 - left);
  // The last one of a row is a triangle.
  const bool lower = u + v <= 1.0f || i + j + 1 == n;
  const double x = static_cast<double>(u), y = static_cast<double>(v);
  const std::uint64_t corner = t.first_vertex + std::uint64_t{j} * (n + 1) - std::uint64_t{j} * (j - 1) / 2 + i;
  const std::uint64_t above = corner + (n - j + 1);
  micro.vertex[0] = lower ? corner : above + 1;
  micro.vertex[1] = corner + 1;
  micro.vertex[2] = above;
  micro.weight[0] = lower ? 1 - x - y : x + y - 1;
  micro.weight[1] = lower ? x : 1 - y;
  micro.weight[2] = lower ? y : 1 - x;
  const bool is_snapped = (j == 0 && t.edge_segments[0] != n) || (i + j + 2 >= n && t.edge_segments[1] != n) ||
                          (i == 0 && t.edge_segments[2] != n);
  if (!is_snapped) [[likely]] {
    micro.b1 = (i + x) / n;
    micro.b2 = (j + y) / n;
    return micro;
  }
  const std::uint32_t at[3][2] = {{lower ? i : i + 1, lower ? j : j + 1}, {i + 1, j}, {i, j + 1}};
  for (int k = 0; k < 3; ++k) micro.add_weights(k, triangle_vertex(t, at[k][0], at[k][1]));
  return micro;
}

MicroHit Tessellation::locate(std::uint32_t primitive, float u, float v) const
{
  const MicroTriangle micro = micro_triangle(primitive, u, v);
  return {micro.triangle, micro.b1, micro.b2};
}

MicroHit Tessellation::hit(std::uint32_t primitive, float u, float v) const
{
  const MicroTriangle micro = micro_triangle(primitive, u, v);
  MicroHit hit{micro.triangle, micro.b1, micro.b2};
  Vec3d P[3];
  for (int k = 0; k < 3; ++k) {
    P[k] = to_double(vertex(micro.vertex[k]));
    hit.P = hit.P + micro.weight[k] * P[k];
  }
  const DisplacedTriangle& tri = mesh_.triangles[micro.triangle];
  const Vec3d N =
      (1 - hit.b1 - hit.b2) * to_double(tri.N[0]) + hit.b1 * to_double(tri.N[1]) + hit.b2 * to_double(tri.N[2]);
  const Vec3d normal = cross(P[1] - P[0], P[2] - P[0]);
  const double squared = dot(normal, normal);
  hit.Ng = squared > 0 ? normal * ((dot(normal, N) < 0 ? -1.0 : 1.0) / std::sqrt(squared)) : N * (1.0 / length(N));
  // Twice the area, as a part of it, over the side's length.
  double least = static_cast<double>(kInfinity);
  for (int k = 0; k < 3; ++k) {
    const Vec3d side = P[(k + 2) % 3] - P[(k + 1) % 3];
    least = std::min(least, micro.weight[k] * micro.weight[k] * squared / std::max(dot(side, side), 1e-300));
  }
  hit.side_distance = std::sqrt(least);
  return hit;
}

/// Micro-triangles around a point.
struct Tessellation::Around : NearPlanes {
  const Tessellation& tessellation;
  std::uint32_t primitive;  ///< that it is on
  std::uint32_t x, y;       ///< of a grid: its cell
};

/// Whether a base triangle's vertices run counter-clockwise around its normals, 1, or clockwise, −1.
double Tessellation::winding(std::uint32_t triangle) const
{
  const DisplacedTriangle& tri = mesh_.triangles[triangle];
  const Vec3d normal = cross(to_double(tri.P[1]) - to_double(tri.P[0]), to_double(tri.P[2]) - to_double(tri.P[0]));
  return dot(normal, to_double(tri.N[0]) + to_double(tri.N[1]) + to_double(tri.N[2])) < 0 ? -1.0 : 1.0;
}

bool Tessellation::add_planes_of(RTCPointQueryFunctionArguments* arguments)
{
  auto& around = *static_cast<Around*>(arguments->userPtr);
  const Tessellation& t = around.tessellation;
  if (arguments->geomID != 0) return false;
  const std::uint32_t triangle = t.triangle_of(arguments->primID);
  const double winding = t.winding(triangle);
  const auto at = [&](std::uint64_t vertex) { return to_double(t.vertex(vertex)); };
  if (t.layout_.kind == TessellationKind::kQuads) {
    const std::uint32_t* v = t.indices_.get() + 4 * std::size_t{arguments->primID};
    around.add(winding, at(v[0]), at(v[1]), at(v[3]));
    if (v[2] != v[3]) around.add(winding, at(v[1]), at(v[2]), at(v[3]));
    return false;
  }
  const std::uint32_t n = t.layout_.triangles[triangle].segments;
  const std::uint64_t first = t.grids_[arguments->primID].startVertexID;
  const auto add_cell = [&](std::uint32_t x, std::uint32_t y) {
    const std::uint64_t a = first + std::uint64_t{y} * (n + 1) + x, b = a + n + 1;
    around.add(winding, at(a), at(a + 1), at(b));
    around.add(winding, at(a + 1), at(b + 1), at(b));
  };
  if (arguments->primID == around.primitive) {
    for (std::uint32_t y = around.y - std::min(around.y, 1u); y <= std::min(around.y + 1, n - 1); ++y) {
      for (std::uint32_t x = around.x - std::min(around.x, 1u); x <= std::min(around.x + 1, n - 1); ++x) add_cell(x, y);
    }
    return false;
  }
  // Of another grid only what is along its border can be near.
  for (std::uint32_t y = 0; y < n; ++y) {
    const bool is_row = y == 0 || y == n - 1;
    for (std::uint32_t x = 0; x < n; x += is_row || n == 1 ? 1 : n - 1) add_cell(x, y);
  }
  return false;
}

Vec3d Tessellation::leave(RTCScene scene,
                          std::uint32_t primitive,
                          float u,
                          float v,
                          const MicroHit& hit,
                          Vec3d error,
                          double reach) const
{
  if (!(hit.side_distance <= reach)) return {};
  const auto cell = [&](float along) {
    const std::uint32_t n = layout_.triangles[hit.triangle].segments;
    return std::min(static_cast<std::uint32_t>(std::max(along, 0.0f) * static_cast<float>(n)), n - 1);
  };
  Around around{{hit.P, error, reach, {}}, *this, primitive, cell(u), cell(v)};
  std::uint64_t ends[3];
  if (layout_.kind == TessellationKind::kQuads) {
    const std::uint32_t* const corners = indices_.get() + 4 * std::size_t{primitive};
    ends[0] = corners[0];
    ends[1] = corners[1];
    ends[2] = corners[3];
  } else {
    const std::uint64_t row = layout_.triangles[hit.triangle].segments + 1;
    ends[0] = grids_[primitive].startVertexID + around.y * row + around.x;
    ends[1] = ends[0] + 1;
    ends[2] = ends[0] + row;
  }
  const Vec3f P0 = vertex(ends[0]), P1 = vertex(ends[1]), P2 = vertex(ends[2]);
  if (!(reach < kMostSidesAround * static_cast<double>(max(length(P1 - P0), length(P2 - P0))))) return {};
  const Vec3f P = to_float(hit.P);
  RTCPointQuery query{P.x, P.y, P.z, 0, static_cast<float>(reach)};
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  rtcPointQuery(scene, &query, &context, add_planes_of, &around);
  return planes_leave(around.planes, hit.Ng);
}

RTCScene tessellation_scene_make(RTCDevice device, const TessellationBuild& build)
{
  RTCScene scene = rtcNewScene(device);
  rtcSetSceneBuildQuality(scene, build.quality);
  rtcSetSceneFlags(scene, build.compact ? static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_COMPACT)
                                        : RTC_SCENE_FLAG_ROBUST);
  return scene;
}

}  // namespace relief
