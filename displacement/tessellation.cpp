#include "displacement/tessellation.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <unordered_map>
#include <utility>

#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include "displacement/plane_clearance.h"
#include "displacement/shared_edges.h"
#include "displacement/tessellation_lattice.h"

namespace relief {

namespace {

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

/// Whether two vertices read the map at one place, or whole periods apart: then their heights need not be compared, as they differ by
/// less than a tenth of seam_tolerance.
bool read_alike(const DisplacedMeshView& mesh,
                const DisplacedTriangle& a,
                int of_a,
                const DisplacedTriangle& b,
                int of_b)
{
  const auto are_alike = [](const LatticeAxis& axis, double x, double y) {
    constexpr double kTexels = 1e-8;
    double apart = x - y;
    if (apart != 0 && axis.wrap != Wrap::kClamp) apart -= axis.num_cells * std::nearbyint(apart / axis.num_cells);
    return std::abs(apart) <= kTexels;
  };
  return are_alike(mesh.field->x, a.x[of_a], b.x[of_b]) && are_alike(mesh.field->y, a.y[of_a], b.y[of_b]);
}

bool corners_read_alike(const DisplacedMeshView& mesh, std::uint32_t a, std::uint32_t b)
{
  return read_alike(mesh, mesh.triangles[a / 3], static_cast<int>(a % 3), mesh.triangles[b / 3],
                    static_cast<int>(b % 3));
}

/// An edge as the one that computes its points has it.
struct SharedEdge {
  bool same_way;  ///< both run from the same end to the same end
  bool alike;     ///< both read the map at the same places
};

SharedEdge shared_edge(const DisplacedMeshView& mesh, std::uint32_t edge, std::uint32_t owner)
{
  // Positions tell which way: the ends of an edge are places.
  const bool same_way = mesh.triangles[owner / 3].P[owner % 3] == mesh.triangles[edge / 3].P[edge % 3];
  const std::uint32_t ends[2] = {owner, edge_end(owner)};
  return {same_way, corners_read_alike(mesh, edge, ends[same_way ? 0 : 1]) &&
                        corners_read_alike(mesh, edge_end(edge), ends[same_way ? 1 : 0])};
}

/// The corner that computes a corner's point: the first one at the same place with the same height.
std::vector<std::uint32_t> corner_owners(const DisplacedMeshView& mesh,
                                         const TessellationRule& rule,
                                         const std::vector<std::uint32_t>& id)
{
  const std::size_t count = id.size();
  const double tolerance = seam_tolerance(mesh);
  std::vector<std::uint32_t> owner = id;
  std::vector<std::uint8_t> is_apart(count);
  tbb::parallel_for(std::size_t{0}, count, [&](std::size_t corner) {
    is_apart[corner] =
        id[corner] != corner && !corners_read_alike(mesh, static_cast<std::uint32_t>(corner), id[corner]);
  });
  const auto d_at = [&](std::uint32_t corner) {
    double b[3] = {0, 0, 0};
    b[corner % 3] = 1;
    return place(mesh, rule, mesh.triangles[corner / 3], b).d;
  };
  // Those with heights of their own, by the first corner at their place, whose height nearly all have.
  std::unordered_map<std::uint32_t, std::vector<std::pair<std::uint32_t, double>>> others;
  for (std::uint32_t corner = 0; corner < count; ++corner) {
    if (is_apart[corner] == 0) continue;
    const double d = d_at(corner);
    if (std::abs(d_at(id[corner]) - d) <= tolerance) continue;
    auto& known = others[id[corner]];
    const auto same = std::find_if(known.begin(), known.end(),
                                   [&](const auto& other) { return std::abs(other.second - d) <= tolerance; });
    owner[corner] = same != known.end() ? same->first : corner;
    if (same == known.end()) known.emplace_back(corner, d);
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

/// What a triangle is divided into.
struct Division {
  std::uint64_t vertices, primitives, micro_triangles;
};

Division division_of(TessellationKind kind, std::uint32_t segments)
{
  const std::uint64_t n = segments;
  switch (kind) {
    case TessellationKind::kGrids:
      return {3 * (n + 1) * (n + 1), 3, 6 * n * n};
    case TessellationKind::kBlocks: {
      const LatticeBlocks blocks(segments);
      return {blocks.num_vertices(), blocks.num_blocks(), n * n};
    }
    case TessellationKind::kQuads:
      break;
  }
  return {LatticeRows{n}.num_vertices(), n * (n + 1) / 2, n * n};
}

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
    const Division division = division_of(layout->kind, t.segments);
    layout->num_vertices += division.vertices;
    layout->num_primitives += division.primitives;
    layout->num_micro_triangles += division.micro_triangles;
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
  tbb::parallel_for(std::uint32_t{0}, static_cast<std::uint32_t>(segments.size()), [&](std::uint32_t edge) {
    const std::uint32_t owner = layout.edge_owner[edge];
    if (owner != edge && shared_edge(mesh, edge, owner).alike) return;  // which asks for as many
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

TessellationLayout tessellation_layout_as(TessellationKind kind, const TessellationLayout& layout)
{
  TessellationLayout other;
  other.kind = kind;
  other.edge_owner = layout.edge_owner;
  other.corner_owner = layout.corner_owner;
  divide_triangles(
      static_cast<std::uint32_t>(layout.triangles.size()),
      [&](std::uint32_t edge) { return layout.triangles[edge / 3].edge_segments[edge % 3]; }, &other);
  return other;
}

std::uint64_t tessellation_peak_bytes(const TessellationLayout& layout, const TessellationBuild& build)
{
  // Peaks of Embree 3.13.5 beside its inputs, on flat and wavy meshes of .05 to 9 million micro-triangles: 62 to 74 bytes for
  // each (39 to 42 stay), 33 to 51 if compact (19 to 36 stay), and for each 2 × 2 cells 82 to 116 of a grid, 87 to 131 of blocks. Of
  // a million of these on Embree makes the tree where what it sorts was, and 68 to 71 are enough.
  constexpr std::uint64_t kMicroTriangle = 76, kCompactMicroTriangle = 53, kGridQuarter = 116, kBlockQuarter = 134,
                          kManyBlocks = 1'000'000, kQuarterOfMany = 80;
  if (layout.kind == TessellationKind::kQuads) {
    return layout.bytes() + layout.num_micro_triangles * (build.compact ? kCompactMicroTriangle : kMicroTriangle);
  }
  const bool blocks = layout.kind == TessellationKind::kBlocks;
  std::uint64_t num_quarters = 0;
  for (const TessellatedTriangle& t : layout.triangles) {
    const std::uint64_t along = (std::uint64_t{t.segments} + 1) / 2;
    num_quarters += blocks ? LatticeBlocks(t.segments).num_quarters() : 3 * along * along;
  }
  return layout.bytes() + num_quarters * (!blocks                      ? kGridQuarter
                                          : num_quarters < kManyBlocks ? kBlockQuarter
                                                                       : kQuarterOfMany);
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

namespace {

void put(Vec3f P, float* out)
{
  out[0] = P.x;
  out[1] = P.y;
  out[2] = P.z;
}

/// @param n  cells a side
RTCGrid square_grid(std::uint32_t first_vertex, std::uint32_t n)
{
  return {first_vertex, n + 1, static_cast<unsigned short>(n + 1), static_cast<unsigned short>(n + 1)};
}

}  // namespace

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
  fill(rule);
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

/// Points that several base triangles have, evaluated once.
struct Tessellation::SharedPoints {
  std::vector<Vec3f> corners, on_edges;
  std::vector<std::uint32_t> of_corner;  ///< by corner: its place in `corners`
  std::vector<std::uint32_t>
      first_of_edge;  ///< by edge that computes its points: the place of the first between its ends

  SharedPoints(const DisplacedMeshView& mesh, const TessellationLayout& layout, const TessellationRule& rule)
      : of_corner(layout.corner_owner.size()), first_of_edge(layout.edge_owner.size())
  {
    std::vector<std::uint32_t> owned;
    std::uint64_t num_on_edges = 0;
    for (std::uint32_t k = 0; k < of_corner.size(); ++k) {
      const std::uint32_t owner = layout.corner_owner[k];
      of_corner[k] = owner == k ? static_cast<std::uint32_t>(owned.size()) : of_corner[owner];
      if (owner == k) owned.push_back(k);
      if (layout.edge_owner[k] != k) continue;
      first_of_edge[k] = static_cast<std::uint32_t>(num_on_edges);
      num_on_edges += steps_of(layout, k) - 1;
    }
    corners.resize(owned.size());
    tbb::parallel_for(std::size_t{0}, owned.size(), [&](std::size_t k) {
      double b[3] = {0, 0, 0};
      b[owned[k] % 3] = 1;
      corners[k] = to_float(place(mesh, rule, mesh.triangles[owned[k] / 3], b).P);
    });
    on_edges.resize(num_on_edges);
    tbb::parallel_for(std::uint32_t{0}, static_cast<std::uint32_t>(first_of_edge.size()), [&](std::uint32_t edge) {
      if (layout.edge_owner[edge] != edge) return;
      const std::uint32_t steps = steps_of(layout, edge);
      for (std::uint32_t step = 1; step < steps; ++step) {
        const LatticeVertex at = edge_vertex(static_cast<int>(edge % 3), step, steps);
        on_edges[first_of_edge[edge] + step - 1] = to_float(place(mesh, rule, mesh.triangles[edge / 3], at.b).P);
      }
    });
  }

  /// Steps along a whole edge.
  static std::uint32_t steps_of(const TessellationLayout& layout, std::uint32_t edge)
  {
    const std::uint32_t segments = layout.triangles[edge / 3].edge_segments[edge % 3];
    return layout.kind == TessellationKind::kGrids ? 2 * segments : segments;
  }
};

/// A vertex of a base triangle, the same to the last bit in all that have it.
Vec3f Tessellation::position(std::uint32_t index,
                             const LatticeVertex& vertex,
                             const TessellationRule& rule,
                             const SharedPoints& shared) const
{
  const DisplacedTriangle& tri = mesh_.triangles[index];
  if (vertex.edge < 0) return to_float(place(mesh_, rule, tri, vertex.b).P);
  const std::uint32_t edge = 3 * index + static_cast<std::uint32_t>(vertex.edge);
  if (vertex.step == 0) return shared.corners[shared.of_corner[edge]];
  if (vertex.step == vertex.steps) return shared.corners[shared.of_corner[edge_end(edge)]];
  const std::uint32_t owner = layout_.edge_owner[edge];
  const Vec3f* const points = &shared.on_edges[shared.first_of_edge[owner]];
  if (owner == edge) return points[vertex.step - 1];
  const SharedEdge as = shared_edge(mesh_, edge, owner);
  const std::uint32_t step = as.same_way ? vertex.step : vertex.steps - vertex.step;
  if (as.alike) return points[step - 1];
  const Placed own = place(mesh_, rule, tri, vertex.b);
  const LatticeVertex there = edge_vertex(static_cast<int>(owner % 3), step, vertex.steps);
  const double d = place(mesh_, rule, mesh_.triangles[owner / 3], there.b).d;
  return std::abs(d - own.d) <= seam_tolerance(mesh_) ? points[step - 1] : to_float(own.P);
}

/// All vertices of a base triangle's lattice.
/// @param out  in rows, see LatticeRows
void Tessellation::fill_rows(std::uint32_t index,
                             const TessellationRule& rule,
                             const SharedPoints& shared,
                             float* out) const
{
  const TessellatedTriangle& t = layout_.triangles[index];
  const std::uint32_t n = t.segments;
  for (std::uint32_t j = 0; j <= n; ++j) {
    for (std::uint32_t i = 0; i + j <= n; ++i, out += 3)
      put(position(index, triangle_vertex(t, i, j), rule, shared), out);
  }
}

void Tessellation::fill_quads(std::uint32_t index, const TessellationRule& rule, const SharedPoints& shared)
{
  const TessellatedTriangle& t = layout_.triangles[index];
  const std::uint32_t n = t.segments;
  fill_rows(index, rule, shared, vertices_.get() + 3 * std::size_t{t.first_vertex});
  std::uint32_t* out = indices_.get() + 4 * std::size_t{t.first_primitive};
  std::uint32_t row = t.first_vertex;
  for (std::uint32_t j = 0; j < n; ++j) {
    const std::uint32_t next_row = row + (n - j + 1);
    for (std::uint32_t i = 0; i + j < n; ++i) {
      const std::uint32_t a = row + i, c = next_row + i;
      // Embree takes a quadrilateral whose last two vertices are one for a triangle.
      for (const std::uint32_t v : {a, a + 1, i + j + 1 == n ? c : c + 1, c}) *out++ = v;
    }
    row = next_row;
  }
}

void Tessellation::fill_grids(std::uint32_t index, const TessellationRule& rule, const SharedPoints& shared)
{
  const TessellatedTriangle& t = layout_.triangles[index];
  const std::uint32_t n = t.segments;
  float* out = vertices_.get() + 3 * std::size_t{t.first_vertex};
  for (std::uint32_t corner = 0; corner < 3; ++corner) {
    grids_[t.first_primitive + corner] = square_grid(t.first_vertex + corner * (n + 1) * (n + 1), n);
    for (std::uint32_t y = 0; y <= n; ++y) {
      for (std::uint32_t x = 0; x <= n; ++x, out += 3)
        put(position(index, grid_vertex(t, static_cast<int>(corner), x, y), rule, shared), out);
    }
  }
}

/// @param rows  room for the lattice
void Tessellation::fill_blocks(std::uint32_t index,
                               const TessellationRule& rule,
                               const SharedPoints& shared,
                               std::vector<float>* rows)
{
  const TessellatedTriangle& t = layout_.triangles[index];
  const LatticeRows lattice{t.segments};
  const LatticeBlocks blocks(t.segments);
  rows->resize(3 * lattice.num_vertices());
  fill_rows(index, rule, shared, rows->data());
  for (std::uint32_t k = 0; k < blocks.num_blocks(); ++k) {
    const LatticeBlocks::Block block = blocks.block(k);
    const std::uint32_t first = t.first_vertex + block.first_vertex;
    grids_[t.first_primitive + k] = square_grid(first, block.cells);
    float* out = vertices_.get() + 3 * std::size_t{first};
    for (std::uint32_t j = block.j; j <= block.j + block.cells; ++j) {
      const float* row = rows->data() + 3 * lattice.vertex(0, j);
      for (std::uint32_t i = block.i; i <= block.i + block.cells; ++i, out += 3)
        std::copy_n(row + 3 * std::size_t{std::min(i, t.segments - j)}, 3, out);
    }
  }
}

/// Evaluates all vertices, and says which are next to each other.
void Tessellation::fill(const TessellationRule& rule)
{
  const SharedPoints shared(mesh_, layout_, rule);
  tbb::parallel_for(tbb::blocked_range<std::uint32_t>(0, mesh_.num_triangles), [&](const auto& range) {
    std::vector<float> rows;
    for (std::uint32_t index = range.begin(); index < range.end(); ++index) {
      switch (layout_.kind) {
        case TessellationKind::kQuads:
          fill_quads(index, rule, shared);
          break;
        case TessellationKind::kGrids:
          fill_grids(index, rule, shared);
          break;
        case TessellationKind::kBlocks:
          fill_blocks(index, rule, shared, &rows);
          break;
      }
    }
  });
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

RTCGeometryType Tessellation::geometry_type() const
{
  return layout_.kind == TessellationKind::kQuads ? RTC_GEOMETRY_TYPE_QUAD : RTC_GEOMETRY_TYPE_GRID;
}

RTCGeometry Tessellation::geometry_make(RTCDevice device) const
{
  RTCGeometry geometry = rtcNewGeometry(device, geometry_type());
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, vertices_.get(), 0,
                             3 * sizeof(float), layout_.num_vertices);
  if (layout_.kind != TessellationKind::kQuads) {
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
    const bool in_blocks = layout_.kind == TessellationKind::kBlocks;
    add(triangle_vertex(t, i, j), in_blocks ? LatticeBlocks(n).vertex(i, j) : LatticeRows{n}.vertex(i, j));
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

namespace {

/// A cell of a grid, and a place in it.
struct GridPlace {
  std::uint32_t x, y;
  double u, v;
};

/// @param u, v  as Embree reports them: they span the whole grid
/// @param n     cells a side
GridPlace grid_place(float u, float v, std::uint32_t n)
{
  const double gx = std::clamp(static_cast<double>(u) * n, 0.0, static_cast<double>(n));
  const double gy = std::clamp(static_cast<double>(v) * n, 0.0, static_cast<double>(n));
  const std::uint32_t x = std::min(static_cast<std::uint32_t>(gx), n - 1);
  const std::uint32_t y = std::min(static_cast<std::uint32_t>(gy), n - 1);
  return {x, y, gx - x, gy - y};
}

}  // namespace

Tessellation::MicroTriangle Tessellation::micro_triangle(std::uint32_t primitive, float u, float v) const
{
  MicroTriangle micro;
  micro.triangle = triangle_of(primitive);
  const TessellatedTriangle& t = layout_.triangles[micro.triangle];
  const std::uint32_t n = t.segments, local = primitive - t.first_primitive;

  if (layout_.kind == TessellationKind::kGrids) {
    const auto [x, y, fx, fy] = grid_place(u, v, n);
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
  std::uint32_t i, j;
  double x, y;  // in the cell
  bool lower;   // half of it
  std::uint64_t corner, above;
  if (layout_.kind == TessellationKind::kBlocks) {
    const LatticeBlocks::Block block = LatticeBlocks(n).block(local);
    GridPlace at = grid_place(u, v, block.cells);
    // A hit on the third side may be rounded beyond it.
    const std::uint32_t last = n - 1 - block.i - block.j - at.y;
    if (at.x > last || (at.x == last && at.u + at.v > 1)) {
      at.x = last;
      at.u = 1 - at.v;
    }
    i = block.i + at.x;
    j = block.j + at.y;
    x = at.u;
    y = at.v;
    lower = x + y <= 1.0;
    corner = std::uint64_t{t.first_vertex} + block.first_vertex + at.y * (block.cells + 1) + at.x;
    above = corner + block.cells + 1;
  } else {
    const RowPlace at = row_place(n, local);
    i = at.place;
    j = at.row;
    x = static_cast<double>(u);
    y = static_cast<double>(v);
    lower = u + v <= 1.0f;
    corner = t.first_vertex + LatticeRows{n}.vertex(i, j);
    above = corner + (n - j + 1);
  }
  // The last one of a row is a triangle.
  lower |= i + j + 1 == n;
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
  std::vector<std::uint32_t> seen{};  ///< blocks; Embree names them once for each box that it has of them
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
  if (t.layout_.kind == TessellationKind::kBlocks) {
    if (std::find(around.seen.begin(), around.seen.end(), arguments->primID) != around.seen.end()) return false;
    around.seen.push_back(arguments->primID);
    const LatticeBlocks::Block block =
        LatticeBlocks(n).block(arguments->primID - t.layout_.triangles[triangle].first_primitive);
    for (std::uint32_t y = 0; y < block.cells; ++y) {
      for (std::uint32_t x = 0; x < block.cells && block.i + x + block.j + y < n; ++x) {
        const std::uint64_t a = first + std::uint64_t{y} * (block.cells + 1) + x, b = a + block.cells + 1;
        if (!around.may_reach({at(a), at(a + 1), at(b), at(b + 1)})) continue;
        around.add(winding, at(a), at(a + 1), at(b));
        if (block.i + x + block.j + y + 1 < n) around.add(winding, at(a + 1), at(b + 1), at(b));
      }
    }
    return false;
  }
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
  } else if (layout_.kind == TessellationKind::kBlocks) {
    std::copy_n(micro_triangle(primitive, u, v).vertex, 3, ends);
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
