// TFDM, the method that RMIP is measured against: the min-max mipmap as a quadtree in texture space, each node bounded in
// space on the fly.
//
// T. Thonat, F. Beaune, X. Sun, N. Carr, T. Boubekeur, "Tessellation-Free Displacement Mapping for Ray Tracing", ACM TOG
// 40(6), 2021. Three differences, all in its favour. Nodes are bounded by the exact hull of bounds3d.h instead of affine
// arithmetic (which SpaceBounds::kAffine asks for), in a frame of the ray's own: t, and two axes across the ray, one of them
// level with the base triangle, so that a node misses as soon as its range across the ray excludes 0. The four children of a
// node are tested side by side.
// A cell is intersected by the exact leaf test, on the part of the ray's curve inside it. Reading order: traverse,
// root_intersect, children_intersect, cell_on_curve_intersect.
#include "displacement/method.h"
#include "displacement/traverse_rmip.h"

namespace relief {

namespace {

RELIEF_KERNEL unsigned mask_of(I4 m)
{
#ifdef __AVX__
  return static_cast<unsigned>(_mm256_movemask_pd(__builtin_bit_cast(__m256d, m)));
#else
  __m128d half[2];
  __builtin_memcpy(half, &m, sizeof half);
  return static_cast<unsigned>(_mm_movemask_pd(half[0]) | _mm_movemask_pd(half[1]) << 2);
#endif
}

RELIEF_KERNEL D4 splat4(double x) { return D4{x, x, x, x}; }

RELIEF_KERNEL D4 load4(const std::uint16_t* from)
{
  using U16 [[gnu::vector_size(8)]] = std::uint16_t;
  U16 lanes;
  __builtin_memcpy(&lanes, from, sizeof lanes);
  return __builtin_convertvector(lanes, D4);
}

/// One coordinate of P and N as affine functions of the lattice.
struct Coordinate {
  double P0, Px, Py, N0, Nx, Ny;
  double pad;
};

/// What all nodes are tested with. Lattice coordinates are relative to vertex 0.
struct NodeFrame {
  Coordinate level, upright, t;  ///< two axes across the ray, and along it
  Coordinate weights[3];         ///< barycentric: P0 + Px·x + Py·y
  double x0, x1, y0, y1;         ///< the triangle's rectangle
  double origin_x, origin_y;     ///< lattice coordinates of vertex 0
  double d_zero, d_step;         ///< displacement of stored bounds
  bool affine;                   ///< nodes are bounded by boxes of object space, as published
};

RELIEF_KERNEL NodeFrame frame_make(const MetricSearch& c,
                                   const LatticeFrame& lattice,
                                   const RayFrame& ray,
                                   SpaceBounds bounds)
{
  const DisplacedTriangle& tri = c.tri;
  NodeFrame f;
  Vec3d D;
  double d[3];
  d[ray.kz] = 1.0 / ray.Sz;
  d[ray.kx] = ray.Sx * d[ray.kz];
  d[ray.ky] = ray.Sy * d[ray.kz];
  D = {d[0], d[1], d[2]};
  const Vec3d Pu = to_double(tri.P[1]) - to_double(tri.P[0]), Pv = to_double(tri.P[2]) - to_double(tri.P[0]);
  const Vec3d n = cross(Pu, Pv);
  Vec3d level = cross(n, D);
  if (!(dot(level, level) > 1e-12 * dot(n, n) * dot(D, D))) {
    // Straight down: any axis across the ray is level.
    level = cross(D, __builtin_fabs(D.x) < 0.5 * length(D) ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0});
  }
  const auto along = [](Vec3d axis, D4 v) { return axis.x * v[0] + axis.y * v[1] + axis.z * v[2]; };
  const auto coordinate = [&](Vec3d axis) {
    return Coordinate{along(axis, lattice.P0),
                      along(axis, lattice.Px),
                      along(axis, lattice.Py),
                      along(axis, lattice.N0),
                      along(axis, lattice.Nx),
                      along(axis, lattice.Ny),
                      4.0 * length(axis) * lattice.pad[0]};
  };
  f.level = coordinate(level);
  f.upright = coordinate(cross(D, level));
  f.t = coordinate(D * (1.0 / dot(D, D)));

  const double xu = tri.x[1] - tri.x[0], xv = tri.x[2] - tri.x[0];
  const double yu = tri.y[1] - tri.y[0], yv = tri.y[2] - tri.y[0];
  const double inverse = 1.0 / (xu * yv - xv * yu);
  constexpr double kWeightPad = 1e-9;
  f.weights[1] = {0, yv * inverse, -xv * inverse, 0, 0, 0, kWeightPad};
  f.weights[2] = {0, -yu * inverse, xu * inverse, 0, 0, 0, kWeightPad};
  f.weights[0] = {1, -f.weights[1].Px - f.weights[2].Px, -f.weights[1].Py - f.weights[2].Py, 0, 0, 0, kWeightPad};
  f.x0 = min(0.0, min(xu, xv));
  f.x1 = max(0.0, max(xu, xv));
  f.y0 = min(0.0, min(yu, yv));
  f.y1 = max(0.0, max(yu, yv));
  f.origin_x = tri.x[0];
  f.origin_y = tri.y[0];
  f.d_zero = c.mesh.scale * (c.mesh.field->h_offset - c.mesh.midlevel);
  f.d_step = c.mesh.scale * c.mesh.field->h_step;
  f.affine = bounds == SpaceBounds::kAffine;
  return f;
}

/// Ranges of s of four nodes, see offset_range; |N| as in normal_range.
struct OffsetLanes {
  D4 low, high;
};

RELIEF_KERNEL OffsetLanes
offset_lanes(const MetricSearch& c, const LatticeFrame& f, D4 x, D4 y, D4 rx, D4 ry, D4 d_low, D4 d_high)
{
  const D4 along_x = f.n0x + f.nxx * x + f.nxy * y, along_y = f.n0y + f.nxy * x + f.nyy * y;
  const D4 squared = f.n00 + (f.n0x + along_x) * x + (f.n0y + along_y) * y;
  const D4 nu = sqrt(squared), inverse = 1.0 / nu;
  const D4 slope = (rx * abs(along_x) + ry * abs(along_y) + f.nu_squared_pad) * inverse;
  const D4 reach = rx * f.length_Nx + ry * f.length_Ny;
  const auto regular = squared > splat4(4.0 * f.nu_squared_pad);
  const D4 longest = splat4(f.longest), huge = splat4(__builtin_huge_val());
  const D4 nu_low = regular ? nu - slope : splat4(0.0);
  const D4 most = 1.0 / (regular ? min(nu + slope + 0.5 * reach * reach * inverse, longest) : longest);
  const D4 least = nu_low > 0.0 ? 1.0 / nu_low : huge;
  // As there, NaN does not replace the prism's bound.
  return {max(d_low * (d_low < 0.0 ? least : most), splat4(c.tri.s_min)),
          min(d_high * (d_high > 0.0 ? least : most), splat4(c.tri.s_max))};
}

struct RangeLanes {
  D4 low, high;
};

/// Exact range of a coordinate over four nodes.
RELIEF_KERNEL RangeLanes coordinate_lanes(const Coordinate& k, D4 x, D4 y, D4 rx, D4 ry, const OffsetLanes& s)
{
  const D4 P = k.P0 + k.Px * x + k.Py * y, N = k.N0 + k.Nx * x + k.Ny * y;
  const D4 a = P + s.low * N, b = P + s.high * N;
  const D4 radius_a = rx * abs(k.Px + s.low * k.Nx) + ry * abs(k.Py + s.low * k.Ny);
  const D4 radius_b = rx * abs(k.Px + s.high * k.Nx) + ry * abs(k.Py + s.high * k.Ny);
  return {min(a - radius_a, b - radius_b) - k.pad, max(a + radius_a, b + radius_b) + k.pad};
}

/// Ranges of t in the boxes of four nodes, by affine arithmetic; empty for a miss.
/// @param d_low, d_high  displacements
/// @param regular        gets false for nodes over which |N| may vanish
RELIEF_KERNEL RangeLanes affine_lanes(const LatticeFrame& f, D4 x, D4 y, D4 rx, D4 ry, D4 d_low, D4 d_high, I4* regular)
{
  const AffineForm inverse = inverse_length_affine(f, x, y, rx, ry, regular);
  RangeLanes t{splat4(-__builtin_huge_val()), splat4(__builtin_huge_val())};
  for (int axis = 0; axis < 3; ++axis) {
    const CoordinateOver<double> over{f.P0[axis] + f.Px[axis] * x + f.Py[axis] * y,
                                      f.N0[axis] + f.Nx[axis] * x + f.Ny[axis] * y,
                                      f.Px[axis],
                                      f.Py[axis],
                                      f.Nx[axis],
                                      f.Ny[axis]};
    D4 low, high;
    displaced_range_affine(over, rx, ry, inverse, 0.5 * (d_low + d_high), 0.5 * (d_high - d_low), &low, &high);
    const D4 a = (low - f.pad[axis]) * f.inverse_D[axis], b = (high + f.pad[axis]) * f.inverse_D[axis];
    t = {max(t.low, min(a, b)), min(t.high, max(a, b))};
  }
  return t;
}

/// Leaf test of a cell, on the stretch of each segment that reaches into it.
/// @param s  of the surface in the cell
/// @return   true if there was a hit; the search goes on: another cell may be nearer
RELIEF_KERNEL bool cell_on_curve_intersect(MetricSearch& c,
                                           const RayProjection* projections,
                                           std::int64_t i,
                                           std::int64_t j,
                                           ScalarRange s)
{
  const LatticeAxis &axis_x = c.mesh.field->x, &axis_y = c.mesh.field->y;
  const auto side = [](const LatticeAxis& axis, std::int64_t cell, bool far_side) {
    const bool unbounded = axis.wrap == Wrap::kClamp && (far_side ? cell >= axis.num_texels - 1 : cell < 0);
    return unbounded ? (far_side ? 1.0 : -1.0) * __builtin_huge_val() : static_cast<double>(cell + (far_side ? 1 : 0));
  };
  bool any = false;
  for (int k = 0; k < c.curve.num_segments; ++k) {
    const CurveSegment& g = c.curve.segments[k];
    if (c.unfolded && (g.t0 > c.t_max || g.t1 < c.t_min)) continue;
    const RayProjection& r = projections[k];
    const double x0 = side(axis_x, i, false) - r.origin_x, x1 = side(axis_x, i, true) - r.origin_x;
    const double y0 = side(axis_y, j, false) - r.origin_y, y1 = side(axis_y, j, true) - r.origin_y;
    double cuts[9];
    int count = 0;
    const auto cross_line = [&](const Quadratic& P, double at) {
      if (__builtin_fabs(at) == __builtin_huge_val()) return;
      count = quadratic_roots_inside(P + r.W * -at, 0.0, 1.0, cuts, count);
    };
    cross_line(r.X, x0);
    cross_line(r.X, x1);
    cross_line(r.Y, y0);
    cross_line(r.Y, y1);
    cuts[count++] = 1.0;
    curve_detail::sort_ascending(cuts, count);
    double start = 2.0, end = -1.0, from = 0.0;
    for (int m = 0; m < count; ++m) {
      const double middle = 0.5 * (from + cuts[m]), inverse = 1.0 / quadratic_at(r.W, middle);
      const double x = quadratic_at(r.X, middle) * inverse, y = quadratic_at(r.Y, middle) * inverse;
      if (x >= x0 - r.pad_x && x <= x1 + r.pad_x && y >= y0 - r.pad_y && y <= y1 + r.pad_y) {
        start = min(start, from);
        end = cuts[m];
      }
      from = cuts[m];
    }
    if (start > end) continue;
    // A little more than the cell, as in texel_march.
    const double slack = 0x1p-20 * (end - start) + 0x1p-44;
    const double s_start = g.s0 + (start - slack) * g.ds, s_end = g.s0 + (end + slack) * g.ds;
    if (!(min(s_start, s_end) <= s.high && max(s_start, s_end) >= s.low)) continue;
    any |= cell_intersect(c, g, i, j, start - slack, end + slack);
  }
  return any;
}

/// A node of the quadtree: the parent of a quad of the mipmap, of a period of the lattice. Where a triangle spans many
/// periods the tree goes on above the mipmap: at level num_levels + m the children are 2^m × 2^m periods.
struct Node {
  int level;                      ///< of its children
  int column, row;                ///< among the parents of that level in a period; 0 above the mipmap
  std::int64_t first_x, first_y;  ///< lattice coordinates of the first cell of its period, or of its first one's
  double t;                       ///< least t of its bounds
};

/// 2^45 periods a side: kMostTexels to either side, of a map of one texel.
inline constexpr int kMaxTileLevels = 45;

/// One of the four children of a node as a node.
RELIEF_KERNEL Node child_node(const MinmaxMipmapView& mipmap, const Node& node, int child, double t)
{
  const int column = 2 * node.column + (child & 1), row = 2 * node.row + (child >> 1);
  if (node.level < mipmap.num_levels) return {node.level - 1, column, row, node.first_x, node.first_y, t};
  const std::int64_t periods = std::int64_t{1} << (node.level - mipmap.num_levels);
  return {node.level - 1,
          0,
          0,
          node.first_x + column * periods * mipmap.x.num_cells,
          node.first_y + row * periods * mipmap.y.num_cells,
          t};
}

/// Sides of the four children along an axis, lattice units from vertex 0; infinite beside a clamped map.
/// @param step  0 or 1: which of two children
RELIEF_KERNEL void child_sides(const LatticeAxis& axis,
                               const D4& step,
                               int num_levels,
                               int level,
                               int parent,
                               double start,
                               D4* from,
                               D4* to)
{
  if (level >= num_levels) {
    if (axis.wrap == Wrap::kClamp) {
      // There is one period, and it has no end.
      *from = step > 0.0 ? splat4(__builtin_huge_val()) : splat4(-__builtin_huge_val());
      *to = splat4(__builtin_huge_val());
      return;
    }
    const double size =
        static_cast<double>(axis.num_cells) * static_cast<double>(std::int64_t{1} << (level - num_levels));
    *from = start + step * size;
    *to = *from + size;
    return;
  }
  const double size = static_cast<double>(std::int64_t{1} << level), end = start + axis.num_cells;
  const D4 cell = (2.0 * parent + step) * size;
  *from = start + cell;
  *to = min(*from + size, splat4(end));
  if (axis.wrap != Wrap::kClamp) return;
  *from = cell <= 0.0 ? splat4(-__builtin_huge_val()) : *from;
  *to = *to >= end ? splat4(__builtin_huge_val()) : *to;
}

/// Children that the ray may meet, nearest first.
struct ChildHits {
  int order[4];
  int count = 0;
  D4 t, s_low, s_high;
};

RELIEF_KERNEL ChildHits children_intersect(MetricSearch& c,
                                           const NodeFrame& f,
                                           const LatticeFrame& lattice,
                                           const MinmaxMipmapView& mipmap,
                                           const Node& node)
{
  D4 low = splat4(c.mesh.field->range.low), high = splat4(c.mesh.field->range.high);
  if (node.level < mipmap.num_levels) {
    const MinmaxQuad& quad = mipmap.quad(node.level, node.column, node.row);
    low = load4(quad.low);
    high = load4(quad.high);
  }
  D4 x0, x1, y0, y1;
  child_sides(mipmap.x, D4{0, 1, 0, 1}, mipmap.num_levels, node.level, node.column,
              static_cast<double>(node.first_x) - f.origin_x, &x0, &x1);
  child_sides(mipmap.y, D4{0, 0, 1, 1}, mipmap.num_levels, node.level, node.row,
              static_cast<double>(node.first_y) - f.origin_y, &y0, &y1);
  // Clipped to the triangle's rectangle.
  const double pad_x = 0x1p-40 * (f.x1 - f.x0) + 0x1p-50 * __builtin_fabs(f.origin_x);
  const double pad_y = 0x1p-40 * (f.y1 - f.y0) + 0x1p-50 * __builtin_fabs(f.origin_y);
  x0 = max(x0, splat4(f.x0)) - pad_x;
  x1 = min(x1, splat4(f.x1)) + pad_x;
  y0 = max(y0, splat4(f.y0)) - pad_y;
  y1 = min(y1, splat4(f.y1)) + pad_y;
  const D4 x = 0.5 * (x0 + x1), y = 0.5 * (y0 + y1), rx = 0.5 * (x1 - x0), ry = 0.5 * (y1 - y0);

  I4 overlaps = (low <= high) & (rx >= 0.0) & (ry >= 0.0);
  for (const Coordinate& b : f.weights) {
    overlaps &= b.P0 + b.Px * x + b.Py * y + rx * __builtin_fabs(b.Px) + ry * __builtin_fabs(b.Py) >= -b.pad;
  }
  const D4 da = f.d_zero + f.d_step * low, db = f.d_zero + f.d_step * high;
  const D4 d_low = min(da, db) - c.d_pad, d_high = max(da, db) + c.d_pad;
  OffsetLanes s{};
  RangeLanes t{};
  I4 regular{};
  if (f.affine) {
    t = affine_lanes(lattice, x, y, rx, ry, d_low, d_high, &regular);
    overlaps &= ~regular | (t.low <= t.high);
  }
  const bool exact = mask_of(overlaps & ~regular) != 0;
  // Cells are searched by them.
  if (exact || node.level == 0) s = offset_lanes(c, lattice, x, y, rx, ry, d_low, d_high);
  if (exact) {
    const RangeLanes upright = coordinate_lanes(f.upright, x, y, rx, ry, s);
    const RangeLanes level = coordinate_lanes(f.level, x, y, rx, ry, s);
    const RangeLanes along = coordinate_lanes(f.t, x, y, rx, ry, s);
    overlaps &= regular | ((upright.low <= 0.0) & (upright.high >= 0.0) & (level.low <= 0.0) & (level.high >= 0.0));
    t.low = regular ? t.low : along.low;
    t.high = regular ? t.high : along.high;
  }
  overlaps &= (t.low <= c.t_max) & (t.high >= c.t_min);
  c.counters.bounds += 4;

  ChildHits hits;
  hits.t = t.low;
  hits.s_low = s.low;
  hits.s_high = s.high;
  for (unsigned mask = mask_of(overlaps); mask != 0; mask &= mask - 1) {
    const int child = __builtin_ctz(mask);
    int k = hits.count++;
    for (; k > 0 && t.low[hits.order[k - 1]] > t.low[child]; --k) hits.order[k] = hits.order[k - 1];
    hits.order[k] = child;
  }
  return hits;
}

/// Descends from one node, near children first.
/// @return  true when the search is over
RELIEF_KERNEL bool root_intersect(MetricSearch& c,
                                  const NodeFrame& f,
                                  const LatticeFrame& lattice,
                                  const MinmaxMipmapView& mipmap,
                                  const RayProjection* projections,
                                  const Node& root)
{
  // Each level leaves at most three siblings.
  Node stack[3 * (kMaxMipmapLevels + kMaxTileLevels) + 1];
  int depth = 0;
  stack[depth++] = root;
  while (depth > 0) {
    const Node node = stack[--depth];
    if (node.t > c.t_max) continue;
    const ChildHits hits = children_intersect(c, f, lattice, mipmap, node);
    if (traversal_poll(c.counters, c.next_poll)) return true;
    if (node.level > 0) {
      for (int k = hits.count; k-- > 0;) {
        stack[depth++] = child_node(mipmap, node, hits.order[k], hits.t[hits.order[k]]);
      }
      continue;
    }
    for (int k = 0; k < hits.count; ++k) {
      const int child = hits.order[k];
      const std::int64_t i = node.first_x + 2 * node.column + (child & 1);
      const std::int64_t j = node.first_y + 2 * node.row + (child >> 1);
      if (cell_on_curve_intersect(c, projections, i, j, {hits.s_low[child], hits.s_high[child]}) && c.any_hit)
        return true;
    }
  }
  return false;
}

/// Parents of one level along an axis, one after the other, over the periods.
struct ParentWalk {
  std::int64_t next, last;  ///< cells, counted from the first cell of period 0
};

RELIEF_KERNEL ParentWalk parent_walk_make(const LatticeAxis& axis, double low, double high)
{
  // Far more than the rounding of a lattice coordinate.
  constexpr double kPad = 1e-6;
  auto first = static_cast<std::int64_t>(__builtin_floor(low - kPad)) - axis.first_cell;
  auto last = static_cast<std::int64_t>(__builtin_floor(high + kPad)) - axis.first_cell;
  if (axis.wrap == Wrap::kClamp) {
    const std::int64_t end = axis.num_cells - 1;
    first = first < 0 ? 0 : (first > end ? end : first);
    last = last < 0 ? 0 : (last > end ? end : last);
  }
  return {first, last};
}

RELIEF_KERNEL bool parent_walk_step(ParentWalk& walk,
                                    const LatticeAxis& axis,
                                    int log2_size,
                                    int* parent,
                                    std::int64_t* first)
{
  if (walk.next > walk.last) return false;
  const int cell = lattice_modulo(walk.next, axis.num_cells);
  const std::int64_t period = walk.next - cell;
  *parent = cell >> log2_size;
  *first = period + axis.first_cell;
  const std::int64_t end = (static_cast<std::int64_t>(*parent) + 1) << log2_size;
  walk.next = period + (end < axis.num_cells ? end : axis.num_cells);
  return true;
}

/// The node over all periods that a walk meets: its place, and the level it takes.
RELIEF_KERNEL int tile_levels(const ParentWalk& walk, const LatticeAxis& axis, std::int64_t* first)
{
  const std::int64_t period = walk.next - lattice_modulo(walk.next, axis.num_cells);
  *first = period + axis.first_cell;
  const std::int64_t num_periods = (walk.last - period) / axis.num_cells + 1;
  int levels = 0;
  while (levels < kMaxTileLevels && (std::int64_t{2} << levels) < num_periods) ++levels;
  return levels;
}

bool traverse(const PrismQuery& q, const void* table, DisplacedHit* hit)
{
  const auto& mipmap = *static_cast<const MinmaxMipmapView*>(table);
  const RayCurve& curve = q.curve;
  MetricSearch c = metric_search_make(q, hit);
  const LatticeFrame lattice = lattice_frame_make(c.tri, curve.frame);
  // A triangle without area in the map has no quadtree: only the curve says where a ray is.
  if (!lattice.exists) {
    return traverse_rmip(q, mipmap, RmipOptions{.bounds = q.rmip_options.bounds}, hit);
  }
  const NodeFrame f = frame_make(c, lattice, curve.frame, q.rmip_options.bounds);
  RayProjection projections[kMaxCurveSegments];
  for (int k = 0; k < curve.num_segments; ++k) projections[k] = ray_projection_make(c.tri, curve.segments[k]);

  ParentWalk rows = parent_walk_make(mipmap.y, f.origin_y + f.y0, f.origin_y + f.y1);
  const ParentWalk all_columns = parent_walk_make(mipmap.x, f.origin_x + f.x0, f.origin_x + f.x1);
  Node root{0, 0, 0, 0, 0, -__builtin_huge_val()};
  const double extent = max(f.x1 - f.x0, f.y1 - f.y0);
  if (f.x1 - f.x0 > 2.0 * mipmap.x.num_cells || f.y1 - f.y0 > 2.0 * mipmap.y.num_cells) {
    const int levels_x = tile_levels(all_columns, mipmap.x, &root.first_x);
    const int levels_y = tile_levels(rows, mipmap.y, &root.first_y);
    root.level = mipmap.num_levels + (levels_x > levels_y ? levels_x : levels_y);
    root_intersect(c, f, lattice, mipmap, projections, root);
    return c.found;
  }
  // The smallest nodes of which four cover the triangle, unless it spans periods.
  while (root.level + 1 < mipmap.num_levels && static_cast<double>(2 << root.level) < extent) ++root.level;
  while (parent_walk_step(rows, mipmap.y, root.level + 1, &root.row, &root.first_y)) {
    ParentWalk columns = all_columns;
    while (parent_walk_step(columns, mipmap.x, root.level + 1, &root.column, &root.first_x)) {
      if (root_intersect(c, f, lattice, mipmap, projections, root)) return c.found;
    }
  }
  return c.found;
}

}  // namespace

const DisplacementMethodEntry RELIEF_ISA::tfdm_method{
    .title = "TFDM",
    .description = "A min-max mipmap whose nodes are bounded in space on the fly (Thonat and others 2021)",
    .traverse = traverse,
    .table_make = minmax_table_make,
    .rmip_options = RmipOptionsUse::kBounds,
};

}  // namespace relief
