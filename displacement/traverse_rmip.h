// RMIP, the published traversal: ping-pong between rectangles of the height map and bounds of the surface in space.
//
// T. Thonat, I. Georgiev, F. Beaune, T. Boubekeur, "RMIP: Displacement ray-tracing via inversion and oblong bounding",
// SIGGRAPH Asia 2023, Alg. 1. The range query is a template parameter, so that the RMIP can be exchanged for a min-max
// mipmap (their Fig. 10). Reading order: traverse_rmip, segment_intersect, then rmip_bound.h, ray_projection.h and
// texel_march.h.
#pragma once

#include "displacement/rmip_bound.h"
#include "kernel/assert.h"

namespace relief {

namespace rmip_detail {

/// The march of a stretch through the surface that the bounds are of.
template <class Bounds>
RELIEF_KERNEL bool surface_march(MetricSearch& c,
                                 const Bounds&,
                                 const CurveSegment& g,
                                 const RayProjection& r,
                                 const ProjectedStretch& stretch,
                                 ScalarRange nu,
                                 const RmipOptions& options)
{
  return texel_march(c, g, r, stretch, nu, options.leaf);
}

/// The while loop of Alg. 1 for one segment.
/// @return  true when the search is over
template <class Bounds>
RELIEF_KERNEL bool segment_intersect(MetricSearch& c,
                                     const Segment& segment,
                                     const LatticeFrame& frame,
                                     const Bounds& bounds,
                                     const RmipOptions& options,
                                     const CurveRange& range)
{
  // The march needs |N| a little around its stretch.
  constexpr double kMargin = 0.01;
  const RayProjection& r = segment.projection;
  const VaryingPart varying_x = varying_part(c.mesh.field->x, r.origin_x),
                    varying_y = varying_part(c.mesh.field->y, r.origin_y);
  RayBound stack[kStackSize];
  int depth = bounds_make(segment, range, stack);
  while (depth > 0) {
    RayBound bound = stack[--depth];
    ++c.counters.bounds;
    if (traversal_poll(c.counters, c.next_poll)) return true;
    const CentredRect rect = rectangle_of(r, bound.stretch);
    const ScalarRange nu = normal_range(frame, {rect.x, rect.y, rect.rx + kMargin, rect.ry + kMargin});
    // The paper marches through small bounds at once. To test them as a whole first takes a quarter fewer steps, in no
    // more time, and allows a larger marching scale.
    if (!bound_intersect(c, segment, frame, bounds, options, rect, nu, bound)) continue;
    const ProjectedStretch& stretch = bound.stretch;
    const VaryingSides sides = varying_sides(stretch, varying_x, varying_y);
    const double longest = max(__builtin_fabs(sides.x1 - sides.x0), __builtin_fabs(sides.y1 - sides.y0));
    ProjectedStretch front, back;
    const bool march = longest <= options.marching_scale || depth + 2 > kStackSize;
    if (march || !bound_split(c, segment, bound, sides, options.split, &front, &back)) {
      if (surface_march(c, bounds, segment.g, r, stretch, nu, options)) return true;
      continue;
    }
    const double t = t_at(segment, back.tau0);
    stack[depth++] = {back, t, bound.t1};
    stack[depth++] = {front, bound.t0, t};
  }
  return false;
}

}  // namespace rmip_detail

/// Nearest (or any) hit of a ray's curve in one displaced triangle.
/// @param bounds  RmipView or MinmaxMipmapView of the mesh's height field, or BlendedBounds of its blend (blended_bounds.h)
/// @param hit     written if the result is true
/// @pre           the marching scale >= rmip_detail::kLeastMarchingScale
template <class Bounds>
RELIEF_KERNEL bool traverse_rmip(const PrismQuery& q,
                                 const Bounds& bounds,
                                 const RmipOptions& options,
                                 DisplacedHit* hit)
{
  RELIEF_ASSERT(options.marching_scale >= rmip_detail::kLeastMarchingScale);
  const RayCurve& curve = q.curve;
  MetricSearch c = metric_search_make(q, hit);
  const LatticeFrame frame = lattice_frame_make(c.tri, curve.frame);
  for (int k = 0; k < curve.num_segments; ++k) {
    const CurveSegment& g = curve.segments[k];
    const CurveRange range = curve_clip(curve, g, c.unfolded, c.t_min, c.t_max);
    if (range.tau0 > range.tau1) continue;
    if (rmip_detail::segment_intersect(c, rmip_detail::segment_make(c.tri, curve, g), frame, bounds, options, range))
      break;
  }
  return c.found;
}

}  // namespace relief
