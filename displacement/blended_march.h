// What RMIP does otherwise where the surface is a blend of two levels: bounds are blended likewise, and the march stops at
// the lines of both lattices.
//
// T. Thonat, I. Georgiev, F. Beaune, T. Boubekeur, "RMIP: Displacement ray-tracing via inversion and oblong bounding",
// SIGGRAPH Asia 2023, Alg. 2.
#pragma once

#include "displacement/level_blend.h"
#include "displacement/traverse_rmip.h"

namespace relief {

/// Tables of both levels, of one kind.
template <class Bounds>
struct BlendedBounds {
  const Bounds &fine, &coarse;
  double ratio_x, ratio_y;  ///< texels of the coarser level in one of the finer
};

/// Displacements over a rectangle: of a blend no more than the blended bounds.
/// @param rect  lattice coordinates of the finer level
/// @source      Thonat et al. 2023, Alg. 2, where textureLoD blends the extremes of two levels
template <class Bounds>
RELIEF_KERNEL ScalarRange displacements_over(const MetricSearch& c,
                                             const BlendedBounds<Bounds>& bounds,
                                             const LatticeRect& rect)
{
  const DisplacedMeshView& mesh = c.mesh;
  const HeightFieldView& coarse = *mesh.blend->coarse;
  const auto low = [](double x, double ratio) {
    const double at = (x + 0.5) * ratio - 0.5;
    return at - 0x1p-50 * (1.0 + __builtin_fabs(at));
  };
  const auto high = [](double x, double ratio) {
    const double at = (x + 0.5) * ratio - 0.5;
    return at + 0x1p-50 * (1.0 + __builtin_fabs(at));
  };
  const StoredRange stored = range_query(bounds.coarse, {low(rect.x0, bounds.ratio_x), high(rect.x1, bounds.ratio_x),
                                                         low(rect.y0, bounds.ratio_y), high(rect.y1, bounds.ratio_y)});
  const ScalarRange d = displacement_range(c, range_query(bounds.fine, rect));
  const double zero = mesh.scale * (coarse.h_offset - mesh.midlevel), step = mesh.scale * coarse.h_step;
  const double a = zero + step * stored.low, b = zero + step * stored.high;
  const double w = mesh.blend->weight;
  // The coarser level's heights are within the finer's, and so is their rounding.
  return {(1.0 - w) * d.low + w * (min(a, b) - c.d_pad), (1.0 - w) * d.high + w * (max(a, b) + c.d_pad)};
}

RELIEF_KERNEL LeafPatch leaf_patch(const DisplacedMeshView& mesh, const BlendedCell& cell)
{
  const BlendedPatches patches = blended_patches(mesh, cell);
  LeafPatch patch;
  patch.heights = blended_heights(cell, patches, mesh.blend->weight);
  patch.magnitude = (1.0 - mesh.blend->weight) * height_magnitude(patches.fine, mesh.midlevel) +
                    mesh.blend->weight * height_magnitude(patches.coarse, mesh.midlevel);
  set_patch_bounds(*mesh.field, cell.i, cell.j, &patch);
  const double cut_x = static_cast<double>(cell.i) + cell.x.cut, cut_y = static_cast<double>(cell.j) + cell.y.cut;
  if (cell.x.cut < 1.0) (cell.upper_x ? patch.x_low : patch.x_high) = cut_x;
  if (cell.y.cut < 1.0) (cell.upper_y ? patch.y_low : patch.y_high) = cut_y;
  return patch;
}

RELIEF_KERNEL double leaf_displacement(const DisplacedMeshView& mesh, const BlendedCell&, double x, double y)
{
  return blended_displacement(mesh, x, y);
}

/// Displacements within a part of a cell.
RELIEF_KERNEL ScalarRange blended_cell_range(const MetricSearch& c, const BlendedCell& cell)
{
  const DisplacedMeshView& mesh = c.mesh;
  const CellHeights h = blended_heights(cell, blended_patches(mesh, cell), mesh.blend->weight);
  // A cell that is unbounded along an axis has one height along it.
  const double x0 = cell.upper_x ? cell.x.cut : 0.0, x1 = !cell.upper_x && cell.x.cut < 1.0 ? cell.x.cut : 1.0;
  const double y0 = cell.upper_y ? cell.y.cut : 0.0, y1 = !cell.upper_y && cell.y.cut < 1.0 ? cell.y.cut : 1.0;
  const auto at = [&](double x, double y) {
    return mesh.scale * (h.h00 + h.hx * x + (h.hy + h.hxy * x) * y - mesh.midlevel);
  };
  const double a = at(x0, y0), b = at(x1, y0), p = at(x0, y1), q = at(x1, y1);
  return {min(min(a, b), min(p, q)) - c.d_pad, max(max(a, b), max(p, q)) + c.d_pad};
}

/// One axis of a walk through the parts of cells: along it the lines of both lattices are crossed in turn.
struct BlendedWalkAxis {
  const LatticeAxis &fine, &coarse;
  bool ascends;
  std::int64_t last_i;
  bool last_upper;

  bool is_at_end(std::int64_t i, bool upper) const { return i == last_i && upper == last_upper; }
  /// Where a part ends in the direction of the march.
  double end_of(std::int64_t i, const BlendedCellAxis& axis, bool upper) const
  {
    const double within = ascends ? (upper ? 1.0 : min(axis.cut, 1.0)) : (upper ? axis.cut : 0.0);
    return static_cast<double>(i) + within;
  }
  void step(std::int64_t& i, BlendedCellAxis& axis, bool& upper) const
  {
    if (ascends != upper && axis.cut < 1.0) {
      upper = ascends;
      return;
    }
    i += ascends ? 1 : -1;
    axis = blended_cell_axis(fine, coarse, i);
    upper = !ascends && axis.cut < 1.0;
  }
};

/// A walk through the parts of cells, see march.
struct BlendedWalk {
  LineCrossings crossing;
  BlendedCell cell;
  BlendedWalkAxis x, y;

  double crossing_x() const
  {
    return x.is_at_end(cell.i, cell.upper_x) ? LineCrossings::kNever
                                             : crossing.with_column(x.end_of(cell.i, cell.x, cell.upper_x));
  }
  double crossing_y() const
  {
    return y.is_at_end(cell.j, cell.upper_y) ? LineCrossings::kNever
                                             : crossing.with_row(y.end_of(cell.j, cell.y, cell.upper_y));
  }
  void step_x() { x.step(cell.i, cell.x, cell.upper_x); }
  void step_y() { y.step(cell.j, cell.y, cell.upper_y); }
  bool is_at_end() const { return x.is_at_end(cell.i, cell.upper_x) && y.is_at_end(cell.j, cell.upper_y); }
  ScalarRange range(const MetricSearch& c) const { return blended_cell_range(c, cell); }
  bool intersect(MetricSearch& c, const CurveSegment& g, double tau0, double tau1) const
  {
    return cell_intersect(c, g, cell, tau0, tau1);
  }
};

/// march through a blend.
/// @return  true when the search is over
template <class Bounds>
RELIEF_KERNEL bool surface_march(MetricSearch& c,
                                 const BlendedBounds<Bounds>&,
                                 const CurveSegment& g,
                                 const RayProjection& r,
                                 const ProjectedStretch& stretch,
                                 ScalarRange nu,
                                 const RmipOptions&)
{
  const HeightFieldView &f = *c.mesh.field, &coarse = *c.mesh.blend->coarse;
  const auto cell_of = [&](double x, double y) {
    return blended_cell_at(c.mesh, cell_at(f.x, x), cell_at(f.y, y), x, y);
  };
  const double x_start = r.origin_x + stretch.x0, y_start = r.origin_y + stretch.y0;
  const double x_end = r.origin_x + stretch.x1, y_end = r.origin_y + stretch.y1;
  const BlendedCell last = cell_of(x_end, y_end);
  BlendedWalk walk{{r, stretch},
                   cell_of(x_start, y_start),
                   {f.x, coarse.x, x_start <= x_end, last.i, last.upper_x},
                   {f.y, coarse.y, y_start <= y_end, last.j, last.upper_y}};
  return march(c, g, stretch, nu, walk);
}

}  // namespace relief
