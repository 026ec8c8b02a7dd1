// A ray's curve over heights that are computed on demand: a descent through the squares of a triangle's lattice, cut where
// the curve passes from one to the next, down to tiles, which are height maps like any other and traced by their method.
//
// The curve's crossings with the lines between squares are roots of quadratics (ray_curve.h), so a piece lies in one square
// up to rounding, and its height s·|N| over the base is known to within what it may bend (curve_deviation). Squares whose
// heights it cannot meet are never computed.
#pragma once

#include "displacement/leaf.h"
#include "displacement/method.h"
#include "displacement/procedural_field.h"

namespace relief {

/// The tile that a point of a triangle is in.
RELIEF_KERNEL LatticeNode lattice_tile_at(const ProceduralField& field, std::uint32_t triangle, double b1, double b2)
{
  const std::int32_t n = field.triangles()[triangle].n, last = (n - 1) / kTileCells;
  const auto tile = [&](double b) {
    const auto i = static_cast<std::int32_t>(__builtin_floor(b * n / kTileCells));
    return i < 0 ? 0 : (i > last ? last : i);
  };
  return {0, tile(b1), tile(b2)};
}

// Compiled for several instruction sets, so of each file alone.
namespace {

/// A tile's heights and the triangle above them, as methods see a mesh.
struct TriangleOnTile {
  DisplacedTriangle tri;
  HeightTileCache::Pin pin;
  DisplacedMeshView mesh;
  std::int64_t i0, j0;  ///< lattice coordinates of texel (0, 0)

  TriangleOnTile(const DisplacedMeshView& on, const ProceduralField& field, std::uint32_t triangle, LatticeNode tile)
      : tri(on.triangles[triangle]),
        pin(field.tile(on.first_triangle + triangle, tile.i, tile.j)),
        mesh{&tri, on.unfolded + triangle, 1, &pin.tile().field, on.scale, on.midlevel},
        i0(std::int64_t{tile.i} * kTileCells - 1),
        j0(std::int64_t{tile.j} * kTileCells - 1)
  {
    for (int k = 0; k < 3; ++k) {
      tri.x[k] -= static_cast<double>(i0);
      tri.y[k] -= static_cast<double>(j0);
    }
  }
  // The mesh points to the triangle.
  TriangleOnTile(const TriangleOnTile&) = delete;
  TriangleOnTile& operator=(const TriangleOnTile&) = delete;
};

}  // namespace

/// Part of a segment as one of its own. t may fall along it where the prism is folded.
RELIEF_KERNEL CurveSegment curve_segment_part(const RayCurve& curve, const CurveSegment& g, double tau0, double tau1)
{
  const double step = tau1 - tau0;
  CurveSegment out;
  for (int k = 0; k < 3; ++k) out.e[k] = quadratic_shift(g.e[k], tau0, step);
  out.W = quadratic_shift(g.W, tau0, step);
  out.s0 = g.s0 + tau0 * g.ds;
  out.ds = step * g.ds;
  out.W_min = quadratic_minimum(out.W);
  out.relative_error = g.relative_error * (g.W_min / out.W_min);
  out.t0 = curve_t(curve, g, tau0);
  out.t1 = curve_t(curve, g, tau1);
  return out;
}

/// A descent under way.
struct LatticeSearch : PrismSearch {
  const ProceduralField& field;
  std::uint32_t triangle;
  bool (*traverse)(const PrismQuery& query, const void* table, DisplacedHit* hit);
  const RmipOptions& options;
  const CurveSegment* segment = nullptr;
  double tau_end = 1;         ///< nothing beyond matters: a hit is known there
  double position_error = 0;  ///< of the segment's points, lattice units
};

/// Whether the curve between two of its points may meet heights.
/// @param low, high  of the heights of the piece's square; crossed: there are none
RELIEF_KERNEL bool piece_meets(const LatticeSearch& c,
                               const CurvePoint& a,
                               const CurvePoint& b,
                               double low,
                               double high)
{
  if (!(low <= high)) return false;
  const double ga = a.s * a.nu, gb = b.s * b.nu;
  const double bend = curve_deviation(c.tri, *c.segment, a, b).height;
  const double d0 = c.mesh.scale * (low - c.mesh.midlevel);
  const double d1 = c.mesh.scale * (high - c.mesh.midlevel);
  // Rounding, and what heights change within the error of the curve's place.
  const double size = __builtin_fabs(c.mesh.scale * c.mesh.midlevel) + max(__builtin_fabs(d0), __builtin_fabs(d1));
  const double pad = bend + 0x1p-46 * size + c.position_error * __builtin_fabs(d1 - d0);
  return min(ga, gb) - pad <= max(d0, d1) && max(ga, gb) + pad >= min(d0, d1);
}

/// @return  true when the search is over
RELIEF_KERNEL bool tile_intersect(LatticeSearch& c, const LatticeNode& tile, const CurvePoint& a, const CurvePoint& b)
{
  const TriangleOnTile on(c.mesh, c.field, c.triangle, tile);
  double low, high;
  stored_to_heights(*on.mesh.field, on.mesh.field->range, &low, &high);
  if (!piece_meets(c, a, b, low, high)) return false;
  const double tau0 = a.tau, tau1 = b.tau;
  RayCurve part;
  part.frame = c.curve.frame;
  for (int k = 0; k < 3; ++k) {
    part.z[k] = c.curve.z[k];
    part.nz[k] = c.curve.nz[k];
  }
  part.num_segments = 1;
  part.segments[0] = curve_segment_part(c.curve, *c.segment, tau0, tau1);
  if (!(part.segments[0].W_min > 0.0)) return false;
  DisplacedHit hit;
  if (!c.traverse({on.mesh, 0, part, c.t_min, c.t_max, c.any_hit, c.options, c.counters}, nullptr, &hit)) return false;
  hit.i += on.i0;
  hit.j += on.j0;
  hit.tau = tau0 + hit.tau * (tau1 - tau0);
  c.hit = hit;
  c.found = true;
  c.t_max = hit.t;
  if (c.unfolded) c.tau_end = hit.tau;
  return c.any_hit;
}

/// The curve between two parameters within a square of the lattice.
/// @param a, b  the curve's points there
/// @return      true when the search is over
RELIEF_KERNEL bool square_intersect(LatticeSearch& c, const LatticeNode& node, const CurvePoint& a, const CurvePoint& b)
{
  if (node.level == 0) return tile_intersect(c, node, a, b);
  LatticeRange children[4];
  c.field.children(c.mesh.first_triangle + c.triangle, node, children);
  ++c.counters.bounds;
  if (traversal_poll(c.counters, c.next_poll)) return true;
  // Where it passes from one child to another.
  const CurveSegment& g = *c.segment;
  const double half = static_cast<double>(std::int64_t{kTileCells} << (node.level - 1));
  const double middle_x = half * (2 * node.i + 1), middle_y = half * (2 * node.j + 1);
  const double n = c.tri.x[1];
  double cuts[5];
  int num_cuts = quadratic_roots_inside(g.e[1] * n + g.W * -middle_x, a.tau, b.tau, cuts, 0);
  num_cuts = quadratic_roots_inside(g.e[2] * n + g.W * -middle_y, a.tau, b.tau, cuts, num_cuts);
  cuts[num_cuts++] = b.tau;
  curve_detail::sort_ascending(cuts, num_cuts);
  CurvePoint from = a;
  for (int k = 0; k < num_cuts; ++k) {
    if (from.tau > c.tau_end) return false;
    const CurvePoint to = k + 1 == num_cuts ? b : curve_point(c.tri, g, cuts[k]);
    const CurvePoint within = curve_point(c.tri, g, 0.5 * (from.tau + to.tau));
    const int right = within.x > middle_x ? 1 : 0, upper = within.y > middle_y ? 1 : 0;
    const LatticeRange& child = children[2 * upper + right];
    if (piece_meets(c, from, to, static_cast<double>(child.low), static_cast<double>(child.high)) &&
        square_intersect(c, {node.level - 1, 2 * node.i + right, 2 * node.j + upper}, from, to)) {
      return true;
    }
    from = to;
  }
  return false;
}

/// Nearest (or any) hit of a ray's curve with a triangle whose heights are computed on demand.
/// @param traverse  of the method, which asks for no table
/// @param hit       written if the result is true; its cell is the lattice's
RELIEF_KERNEL bool trace_procedural(const PrismQuery& q,
                                    const ProceduralField& field,
                                    bool (*traverse)(const PrismQuery&, const void*, DisplacedHit*),
                                    DisplacedHit* hit)
{
  LatticeSearch c{prism_search_make(q, hit), field, q.triangle, traverse, q.rmip_options};
  const LatticeNode root = field.root(q.mesh.first_triangle + q.triangle);
  for (int k = 0; k < q.curve.num_segments; ++k) {
    const CurveSegment& g = q.curve.segments[k];
    if (g.t0 >= c.t_max && c.unfolded) break;
    const CurveRange range = curve_clip(q.curve, g, c.unfolded, c.t_min, c.t_max);
    if (range.tau0 > range.tau1) continue;
    c.segment = &g;
    c.tau_end = c.unfolded ? range.tau1 : 1.0;
    c.position_error = c.tri.x[1] * (g.relative_error + 0x1p-44);
    if (square_intersect(c, root, curve_point(c.tri, g, range.tau0), curve_point(c.tri, g, range.tau1))) break;
  }
  return c.found;
}

}  // namespace relief
