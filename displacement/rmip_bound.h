// What RMIP's search has on its stack: a stretch of the ray's curve with its t; how it is bounded in the height map and in
// space, shrunk by inversion, and split. traverse_rmip.h has the loop.
//
// T. Thonat, I. Georgiev, F. Beaune, T. Boubekeur, "RMIP: Displacement ray-tracing via inversion and oblong bounding",
// SIGGRAPH Asia 2023, Alg. 1.
#pragma once

#include "displacement/inversion.h"
#include "displacement/minmax_mipmap.h"
#include "displacement/rmip_query.h"
#include "displacement/texel_march.h"

namespace relief::rmip_detail {

/// A stretch with its t, which is only used where it grows along the curve.
struct RayBound {
  ProjectedStretch stretch;
  double t0, t1;
};

/// One segment of the curve, prepared.
struct Segment {
  const CurveSegment& g;
  RayProjection projection;
  Cubic T;
  double t_pad;  ///< rounding of a t
};

RELIEF_KERNEL Segment segment_make(const DisplacedTriangle& tri, const RayCurve& curve, const CurveSegment& g)
{
  const double s = max(__builtin_fabs(g.s0), __builtin_fabs(g.s0 + g.ds));
  double t_size = 0, e_size = 0;
  for (int i = 0; i < 3; ++i) {
    t_size = max(t_size, __builtin_fabs(curve.z[i]) + s * __builtin_fabs(curve.nz[i]));
    e_size += __builtin_fabs(g.e[i].a) + __builtin_fabs(g.e[i].b) + __builtin_fabs(g.e[i].c);
  }
  // A dozen roundings, amplified by the weights' size against their sum.
  const double t_pad = (0x1p-46 * e_size / g.W_min + g.relative_error) * t_size;
  return {g, ray_projection_make(tri, g), ray_distance_make(curve, g), t_pad};
}

RELIEF_KERNEL double t_at(const Segment& segment, double tau)
{
  return cubic_at(segment.T, tau) / quadratic_at(segment.g.W, tau);
}

/// At most two turning points a coordinate.
inline constexpr int kMaxPieces = 5;
/// Stretches are split while a side is longer than the marching scale, and each split halves the longer side, so one of
/// 2^45 texels (kMostTexels to either side) is split at most 2·(45 − log2 scale) times on the way down; each split leaves
/// one on the stack. Splits of the ray have no such bound: what does not fit is marched through.
inline constexpr double kLeastMarchingScale = 0x1p-20;
inline constexpr int kStackSize = kMaxPieces + 2 * (45 + 20);

/// Cuts a part of a segment at its turning points.
/// @param bounds  kMaxPieces of them; the last one is the first along the ray
/// @return        how many
/// @source        Thonat et al. 2023, Alg. 1, lines 2 to 5
RELIEF_KERNEL int bounds_make(const Segment& segment, const CurveRange& range, RayBound* bounds)
{
  const RayProjection& r = segment.projection;
  double cuts[kMaxPieces - 1];
  int num_cuts = turning_points(r.X, r.W, range.tau0, range.tau1, cuts, 0);
  num_cuts = turning_points(r.Y, r.W, range.tau0, range.tau1, cuts, num_cuts);
  curve_detail::sort_ascending(cuts, num_cuts);
  double end = range.tau1, end_t = t_at(segment, end);
  for (int k = 0; k <= num_cuts; ++k) {
    const double start = k < num_cuts ? cuts[num_cuts - 1 - k] : range.tau0, start_t = t_at(segment, start);
    stretch_start(r, start, &bounds[k].stretch);
    stretch_end(r, end, &bounds[k].stretch);
    bounds[k].t0 = start_t;
    bounds[k].t1 = end_t;
    end = start;
    end_t = start_t;
  }
  return num_cuts + 1;
}

RELIEF_KERNEL CentredRect rectangle_of(const RayProjection& r, const ProjectedStretch& b)
{
  return {0.5 * (b.x0 + b.x1), 0.5 * (b.y0 + b.y1), 0.5 * __builtin_fabs(b.x1 - b.x0) + r.pad_x,
          0.5 * __builtin_fabs(b.y1 - b.y0) + r.pad_y};
}

/// Shrinks a bound to where the ray is inside the surface's bounds. An inversion that fails shrinks nothing.
/// @param t  range of the ray inside the bounds
/// @source   Thonat et al. 2023, Alg. 1, line 15
RELIEF_KERNEL void reduce(const Segment& segment, ScalarRange t, RayBound& bound, TraversalCounters& counters)
{
  // An eighth of the bound is worth an inversion.
  const double least_gain = 0.125 * (bound.t1 - bound.t0);
  constexpr double kTolerance = 1.0 / 64;
  const ProjectedStretch whole = bound.stretch;
  const double t0 = bound.t0, t1 = bound.t1, margin = kTolerance * (whole.tau1 - whole.tau0);
  const auto inverted = [&](double at) {
    return ray_invert(segment.T, segment.g.W, {whole.tau0, whole.tau1, t0, t1}, at, kTolerance, &counters.inversions);
  };
  // Validated by evaluation: what is cut off lies outside. NaN fails.
  if (t.low > t0 + least_gain) {
    const double tau = inverted(t.low) - margin, start_t = t_at(segment, tau);
    if (tau > whole.tau0 && start_t + segment.t_pad <= t.low) {
      stretch_start(segment.projection, tau, &bound.stretch);
      bound.t0 = start_t;
    }
  }
  if (t.high < t1 - least_gain) {
    const double tau = inverted(t.high) + margin, end_t = t_at(segment, tau);
    if (tau > bound.stretch.tau0 && tau < whole.tau1 && end_t - segment.t_pad >= t.high) {
      stretch_end(segment.projection, tau, &bound.stretch);
      bound.t1 = end_t;
    }
  }
}

/// Displacements over a rectangle, by a table of the mesh's field.
template <class Bounds>
RELIEF_KERNEL ScalarRange displacements_over(const MetricSearch& c, const Bounds& bounds, const LatticeRect& rect)
{
  return displacement_range(c, range_query(bounds, rect));
}

/// Whether the surface may meet the ray on a bound; shrinks the bound.
///
/// Two tests: of s, which is known along the curve, at no cost; and of the box in space, whose ends are inverted. With the
/// published bounds the box alone, if there is one.
/// @param nu  of the bound's rectangle
/// @source    Thonat et al. 2023, Alg. 1, lines 12 to 15
template <class Bounds>
RELIEF_KERNEL bool bound_intersect(const MetricSearch& c,
                                   const Segment& segment,
                                   const LatticeFrame& frame,
                                   const Bounds& bounds,
                                   const RmipOptions& options,
                                   const CentredRect& rect,
                                   ScalarRange nu,
                                   RayBound& bound)
{
  const RayProjection& r = segment.projection;
  const ScalarRange d = displacements_over(c, bounds,
                                           {r.origin_x + (rect.x - rect.rx), r.origin_x + (rect.x + rect.rx),
                                            r.origin_y + (rect.y - rect.ry), r.origin_y + (rect.y + rect.ry)});
  const ScalarRange s = offset_range(c.tri, d, nu);
  const bool affine = options.bounds == SpaceBounds::kAffine;
  const CurveSegment& g = segment.g;
  const double s0 = g.s0 + bound.stretch.tau0 * g.ds, s1 = g.s0 + bound.stretch.tau1 * g.ds;
  const double s_pad = 0x1p-40 * (__builtin_fabs(s0) + __builtin_fabs(s1));
  if (!(affine && frame.exists) && !(s.low <= max(s0, s1) + s_pad && s.high >= min(s0, s1) - s_pad)) return false;
  if (!frame.exists) return true;

  ScalarRange t = affine ? affine_bounds_intersect(frame, rect, d, s) : surface_bounds_intersect(frame, rect, s);
  t.low -= segment.t_pad;
  t.high += segment.t_pad;
  if (!(t.low <= t.high && t.low <= c.t_max && t.high >= c.t_min)) return false;
  // In a folded prism t does not grow along the curve, and its inversion is not unique.
  if (!c.unfolded) return true;
  if (!(t.low <= bound.t1 && t.high >= bound.t0)) return false;
  if (options.reduce_by_inversion) reduce(segment, t, bound, c.counters);
  return true;
}

/// Splits a bound as the options ask for.
/// @return  false if it is too short to be split
/// @source  Thonat et al. 2023, §4.3, Fig. 5b and c. In a folded prism, and where the inversion does not converge, 5b's
///          split is that of 5c
RELIEF_KERNEL bool bound_split(MetricSearch& c,
                               const Segment& segment,
                               const RayBound& bound,
                               const VaryingSides& sides,
                               RmipSplit split,
                               ProjectedStretch* front,
                               ProjectedStretch* back)
{
  const ProjectedStretch& stretch = bound.stretch;
  if (split == RmipSplit::kRay && c.unfolded) {
    constexpr double kTolerance = 1.0 / 64;
    const double tau = ray_invert(segment.T, segment.g.W, {stretch.tau0, stretch.tau1, bound.t0, bound.t1},
                                  0.5 * (bound.t0 + bound.t1), kTolerance, &c.counters.inversions);
    if (stretch_split_at(segment.projection, stretch, tau, front, back)) return true;
  }
  return stretch_split(segment.projection, stretch, sides, front, back);
}

}  // namespace relief::rmip_detail
