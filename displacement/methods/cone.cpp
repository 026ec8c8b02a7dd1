// Cone stepping made exact, over flat bases: a ray over a height field jumps over what its cell's cone says is empty and takes
// the leaf test in every cell that it may meet. Triangles whose normals differ, maps turned upside down by a negative scale,
// and what is beside clamped maps are left to `chord`.
#include "displacement/cell_cones.h"
#include "displacement/leaf.h"
#include "displacement/method.h"

namespace relief {

namespace {

bool same_normal(Vec3f a, Vec3f b) { return a.x == b.x && a.y == b.y && a.z == b.z; }

/// Whether lattice coordinates stay over a clamped map.
bool is_over(const LatticeAxis& axis, const double* x)
{
  if (axis.wrap != Wrap::kClamp) return true;
  return min(x[0], min(x[1], x[2])) >= 0.0 && max(x[0], max(x[1], x[2])) <= axis.num_texels - 1;
}

/// A straight stretch over the map: lattice coordinates and height as linear functions of the curve's parameter.
struct FlatRay {
  double x, dx, y, dy, h, dh;
  double planar;  ///< lattice units that the stretch is long
};

/// Marches one segment.
/// @return true when the search is over
RELIEF_KERNEL bool flat_march(PrismSearch& c,
                              const CurveSegment& g,
                              const CurveRange& range,
                              const CellConesView& cones)
{
  const HeightFieldView& f = *c.mesh.field;
  const CurvePoint first = curve_point(c.tri, g, range.tau0), last = curve_point(c.tri, g, range.tau1);
  const double length = range.tau1 - range.tau0;
  if (!(length > 0.0)) return false;
  const double to_h = 1.0 / c.mesh.scale;
  FlatRay r;
  r.x = first.x;
  r.dx = last.x - first.x;
  r.y = first.y;
  r.dy = last.y - first.y;
  r.h = first.s * first.nu * to_h + c.mesh.midlevel;
  r.dh = (last.s * last.nu - first.s * first.nu) * to_h;
  r.planar = __builtin_sqrt(r.dx * r.dx + r.dy * r.dy);
  // What the line may be off, in cells and in heights: more than rounding, far less than a cell.
  const double slack = 1e-7 + 0x1p-40 * (__builtin_fabs(r.x) + __builtin_fabs(r.y) + r.planar) +
                       8.0 * g.relative_error *
                           (__builtin_fabs(c.tri.x[1] - c.tri.x[0]) + __builtin_fabs(c.tri.x[2] - c.tri.x[0]) +
                            __builtin_fabs(c.tri.y[1] - c.tri.y[0]) + __builtin_fabs(c.tri.y[2] - c.tri.y[0]));
  double h_low, h_high;
  stored_to_heights(f, f.range, &h_low, &h_high);
  const double h_slack =
      slack * (h_high - h_low) + 0x1p-40 * (__builtin_fabs(r.h) + __builtin_fabs(r.dh) + __builtin_fabs(h_high));
  const double u_slack = r.planar > 0.0 ? slack / r.planar : 1.0;
  const auto cell_of = [](double at) { return static_cast<std::int64_t>(__builtin_floor(at)); };
  std::int64_t i = cell_of(r.x), j = cell_of(r.y);
  const int step_i = r.dx < 0.0 ? -1 : 1, step_j = r.dy < 0.0 ? -1 : 1;
  double u = 0.0;
  for (;;) {
    // Where the ray leaves the cell.
    const auto leaves = [](double from, double d, std::int64_t cell, int step) {
      if (d == 0.0) return 2.0;
      return (static_cast<double>(step > 0 ? cell + 1 : cell) - from) / d;
    };
    const double u_x = leaves(r.x, r.dx, i, step_i), u_y = leaves(r.y, r.dy, j, step_j);
    const double u_next = min(max(min(u_x, u_y), u), 1.0);
    ++c.counters.bounds;
    if (traversal_poll(c.counters, c.next_poll)) return true;
    const int column = lattice_modulo(i - f.x.first_cell, f.x.num_cells);
    const int row = lattice_modulo(j - f.y.first_cell, f.y.num_cells);
    const CellCone cone = cones.cells[static_cast<std::int64_t>(row) * f.x.num_cells + column];
    const double h_from = r.h + r.dh * u, h_to = r.h + r.dh * u_next;
    const double free_height = min(h_from, h_to) - h_slack - static_cast<double>(cone.top);
    if (!(free_height > 0.0)) {
      const CellHeights cell = cell_heights(f, i, j);
      const double a = cell.h00, b = a + cell.hx, p = a + cell.hy, q = b + cell.hy + cell.hxy;
      const double low = min(min(a, b), min(p, q)), high = max(max(a, b), max(p, q));
      if (min(h_from, h_to) - h_slack <= high && max(h_from, h_to) + h_slack >= low) {
        const double from = range.tau0 + (u - u_slack) * length, to = range.tau0 + (u_next + u_slack) * length;
        if (cell_intersect(c, g, i, j, from, to) && (c.unfolded || c.any_hit)) return true;
      }
    }
    if (u_next >= 1.0) return false;
    if (free_height > 0.0 && r.planar > 0.0) {
      // Over the cell's border the way to what is high is still as long as from the cell.
      const double falls = -r.dh / r.planar, closing = static_cast<double>(cone.rise) + falls;
      const double way = closing > 0.0 ? free_height / closing : __builtin_huge_val();
      const double u_free = u_next + max(way - 2.0 * slack, 0.0) / r.planar * 0.9999;
      if (u_free >= 1.0) return false;
      const std::int64_t i_free = cell_of(r.x + r.dx * u_free), j_free = cell_of(r.y + r.dy * u_free);
      if (i_free != i || j_free != j) {
        u = u_free;
        i = i_free;
        j = j_free;
        continue;
      }
    }
    u = u_next;
    if (u_x < u_y) {
      i += step_i;
    } else {
      j += step_j;
    }
  }
}

bool traverse(const PrismQuery& q, const void* table, DisplacedHit* hit)
{
  const DisplacedTriangle& tri = q.mesh.triangles[q.triangle];
  const HeightFieldView& f = *q.mesh.field;
  const bool is_flat = same_normal(tri.N[0], tri.N[1]) && same_normal(tri.N[0], tri.N[2]);
  if (!is_flat || !(q.mesh.scale > 1e-25) || !is_over(f.x, tri.x) || !is_over(f.y, tri.y)) {
    return RELIEF_ISA::chord_method.traverse(q, nullptr, hit);
  }
  PrismSearch c = prism_search_make(q, hit);
  for (int k = 0; k < q.curve.num_segments; ++k) {
    const CurveSegment& g = q.curve.segments[k];
    if (g.t0 >= c.t_max && c.unfolded) break;
    const CurveRange range = curve_clip(q.curve, g, c.unfolded, c.t_min, c.t_max);
    if (range.tau0 > range.tau1) continue;
    if (flat_march(c, g, range, *static_cast<const CellConesView*>(table))) break;
  }
  return c.found;
}

}  // namespace

const DisplacementMethodEntry RELIEF_ISA::cone_method{
    .title = "Cones",
    .description = "Cone stepping over flat bases (Dummer 2006), made exact; elsewhere as Chord",
    .traverse = traverse,
    .table_make = cell_cones_table_make,
};

}  // namespace relief
