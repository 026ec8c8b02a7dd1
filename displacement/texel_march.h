// What the published traversals share below the level of a bound: the search, and the march along the cells that the
// ray's curve crosses.
#pragma once

#include "displacement/bounds3d.h"
#include "displacement/leaf.h"
#include "displacement/micro_triangles.h"
#include "displacement/prism_query.h"
#include "displacement/ray_projection.h"

namespace relief {

/// A search by displacements, in metres.
struct MetricSearch : PrismSearch {
  double d_zero, d_per_texel;  ///< d = d_zero + d_per_texel · texel as stored
  double d_pad;                ///< rounding of a height, and what the curve may change within rounding of its position
};

RELIEF_KERNEL MetricSearch metric_search_make(const PrismQuery& q, DisplacedHit* hit)
{
  const DisplacedMeshView& mesh = q.mesh;
  const HeightFieldView& f = *mesh.field;
  double d_per_texel = mesh.scale;
  if (f.map.format == HeightFormat::kU8) d_per_texel = mesh.scale / 255.0;
  if (f.map.format == HeightFormat::kU16) d_per_texel = mesh.scale / 65535.0;
  const double span = f.h_step * (f.range.high - f.range.low);
  const double largest = __builtin_fabs(f.h_offset) + 65535.0 * f.h_step + __builtin_fabs(mesh.midlevel);
  const double d_pad = __builtin_fabs(mesh.scale) * (0x1p-20 * span + 0x1p-44 * largest);
  return {prism_search_make(q, hit), -mesh.scale * mesh.midlevel, d_per_texel, d_pad};
}

/// Displacements of stored bounds.
RELIEF_KERNEL ScalarRange displacement_range(const MetricSearch& c, StoredRange stored)
{
  const HeightFieldView& f = *c.mesh.field;
  const double zero = c.mesh.scale * (f.h_offset - c.mesh.midlevel), step = c.mesh.scale * f.h_step;
  const double a = zero + step * stored.low, b = zero + step * stored.high;
  return {min(a, b) - c.d_pad, max(a, b) + c.d_pad};
}

/// Displacements at the corners of a cell, and so within it.
RELIEF_KERNEL ScalarRange cell_displacement_range(const MetricSearch& c, std::int64_t i, std::int64_t j)
{
  const HeightFieldView& f = *c.mesh.field;
  const int left = lattice_texel(f.x, i), right = lattice_texel(f.x, i + 1);
  const std::int64_t upper = static_cast<std::int64_t>(lattice_texel(f.y, j)) * f.map.width;
  const std::int64_t lower = static_cast<std::int64_t>(lattice_texel(f.y, j + 1)) * f.map.width;
  const auto range = [&](auto* texels) {
    const auto a = texels[upper + left], b = texels[upper + right], p = texels[lower + left], q = texels[lower + right];
    const auto low_upper = a < b ? a : b, high_upper = a < b ? b : a, low_lower = p < q ? p : q,
               high_lower = p < q ? q : p;
    const double low = low_upper < low_lower ? low_upper : low_lower;
    const double high = high_upper > high_lower ? high_upper : high_lower;
    const double from = c.d_zero + c.d_per_texel * low, to = c.d_zero + c.d_per_texel * high;
    return ScalarRange{min(from, to) - c.d_pad, max(from, to) + c.d_pad};
  };
  switch (f.map.format) {
    case HeightFormat::kU8:
      return range(static_cast<const std::uint8_t*>(f.map.texels));
    case HeightFormat::kU16:
      return range(static_cast<const std::uint16_t*>(f.map.texels));
    case HeightFormat::kFloat:
      break;
  }
  return range(static_cast<const float*>(f.map.texels));
}

/// Cell of a lattice coordinate; beside a clamped map, the unbounded one.
RELIEF_KERNEL std::int64_t cell_at(const LatticeAxis& axis, double x)
{
  const auto i = static_cast<std::int64_t>(__builtin_floor(x));
  if (axis.wrap != Wrap::kClamp) return i;
  const std::int64_t last = axis.num_texels - 1;
  return i < -1 ? -1 : (i > last ? last : i);
}

/// Where a stretch crosses the lines of a lattice, in parts of it.
struct LineCrossings {
  static constexpr double kNever = 2.0;
  BernsteinQuadratic X, Y, W;
  double origin_x, origin_y;

  LineCrossings(const RayProjection& r, const ProjectedStretch& stretch)
      : X(bernstein_make(r.X, stretch.tau0, stretch.tau1)),
        Y(bernstein_make(r.Y, stretch.tau0, stretch.tau1)),
        W(bernstein_make(r.W, stretch.tau0, stretch.tau1)),
        origin_x(r.origin_x),
        origin_y(r.origin_y)
  {
  }
  double with_column(double x) const { return bernstein_crossing(X, W, x - origin_x); }
  double with_row(double y) const { return bernstein_crossing(Y, W, y - origin_y); }
};

/// The cells that a monotone stretch crosses, front to back, and the leaf test in those whose heights the ray reaches.
///
/// The paper finds the next cell by the signs of ψ at a cell's corners; here the crossings of its lines are solved for.
/// Where a crossing is off by rounding, so is the cell, by as much of a texel: heights are continuous there, and each
/// cell is given a little more of the curve than its own.
/// @param walk  from cell to cell: crossing_x and crossing_y tell where the stretch leaves the one that it is in, or kNever
///              after the last; step_x and step_y go on to the next; is_at_end; range of its displacements; intersect, the test
/// @param nu    range of |N| on the stretch and a hundredth of a texel around it
/// @return    true when the search is over
/// @source    Thonat et al. 2023, §4.4
template <class Walk>
RELIEF_KERNEL bool march(MetricSearch& c,
                         const CurveSegment& g,
                         const ProjectedStretch& stretch,
                         ScalarRange nu,
                         Walk& walk)
{
  const double length = stretch.tau1 - stretch.tau0;
  // Of the stretch, so some 1e-5 of a texel: more than rounding, too little to cost anything.
  constexpr double kSlack = 0x1p-20;
  const double s_start = g.s0 + stretch.tau0 * g.ds, s_length = length * g.ds;
  double u = 0.0, u_x = walk.crossing_x(), u_y = walk.crossing_y();
  for (;;) {
    const double nearer = u_x < u_y ? u_x : u_y, u_next = nearer < 1.0 ? nearer : 1.0;
    const double from = u - kSlack, to = u_next + kSlack;
    const double s_from = s_start + from * s_length, s_to = s_start + to * s_length;
    const double s_low = min(s_from, s_to), s_high = max(s_from, s_to);
    const ScalarRange height{s_low * (s_low < 0.0 ? nu.high : nu.low), s_high * (s_high > 0.0 ? nu.high : nu.low)};
    const ScalarRange cell = walk.range(c);
    ++c.counters.bounds;
    if (traversal_poll(c.counters, c.next_poll)) return true;
    if (height.low <= cell.high && height.high >= cell.low) {
      const bool is_hit = walk.intersect(c, g, stretch.tau0 + from * length, stretch.tau0 + to * length);
      if (is_hit && (c.unfolded || c.any_hit)) return true;
    }
    if (walk.is_at_end()) return false;
    u = max(u, u_next);
    if (u_x < u_y) {
      walk.step_x();
      u_x = walk.crossing_x();
    } else {
      walk.step_y();
      u_y = walk.crossing_y();
    }
  }
}

/// A walk through the cells of a map.
struct TexelWalk {
  LineCrossings crossing;
  std::int64_t i, j, i_end, j_end;
  int step_i, step_j;
  RmipLeaf leaf;

  double crossing_x() const
  {
    return i == i_end ? LineCrossings::kNever : crossing.with_column(static_cast<double>(step_i > 0 ? i + 1 : i));
  }
  double crossing_y() const
  {
    return j == j_end ? LineCrossings::kNever : crossing.with_row(static_cast<double>(step_j > 0 ? j + 1 : j));
  }
  void step_x() { i += step_i; }
  void step_y() { j += step_j; }
  bool is_at_end() const { return i == i_end && j == j_end; }
  ScalarRange range(const MetricSearch& c) const { return cell_displacement_range(c, i, j); }
  bool intersect(MetricSearch& c, const CurveSegment& g, double tau0, double tau1) const
  {
    return leaf == RmipLeaf::kTriangles ? micro_triangles_intersect(c, g, i, j, tau0, tau1)
                                        : cell_intersect(c, g, i, j, tau0, tau1);
  }
};

/// march through the cells of a mesh's field.
/// @param leaf  what is met in a cell
RELIEF_KERNEL bool texel_march(MetricSearch& c,
                               const CurveSegment& g,
                               const RayProjection& r,
                               const ProjectedStretch& stretch,
                               ScalarRange nu,
                               RmipLeaf leaf)
{
  const HeightFieldView& f = *c.mesh.field;
  const std::int64_t i = cell_at(f.x, r.origin_x + stretch.x0), j = cell_at(f.y, r.origin_y + stretch.y0);
  const std::int64_t i_end = cell_at(f.x, r.origin_x + stretch.x1), j_end = cell_at(f.y, r.origin_y + stretch.y1);
  TexelWalk walk{{r, stretch}, i, j, i_end, j_end, i <= i_end ? 1 : -1, j <= j_end ? 1 : -1, leaf};
  return march(c, g, stretch, nu, walk);
}

}  // namespace relief
