// The leaf of the RMIP paper: a cell as two triangles between its displaced corners. It is not the surface of the other
// methods (displaced_triangle.h) but one near it. Triangles reach over the walls of their cell, and of their base
// triangle, whose neighbour continues them differently, so it is met with gaps: for comparisons.
//
// T. Thonat et al., "RMIP: Displacement ray-tracing via inversion and oblong bounding", SIGGRAPH Asia 2023, §4.4.
#pragma once

#include "displacement/prism_query.h"

namespace relief {

/// A displaced texel as a ray sees it.
struct MicroVertex {
  RaySeen seen;
  double b1 = 0, b2 = 0;
};

/// Nearer hit of one triangle; edges count.
/// @return  true if it is nearer than what the search has
RELIEF_KERNEL bool micro_triangle_intersect(PrismSearch& c,
                                            const MicroVertex& a,
                                            const MicroVertex& b,
                                            const MicroVertex& p,
                                            std::int64_t i,
                                            std::int64_t j,
                                            double tau)
{
  const auto edge = [](const RaySeen& from, const RaySeen& to) { return from.x * to.y - from.y * to.x; };
  const double ea = edge(b.seen, p.seen), eb = edge(p.seen, a.seen), ep = edge(a.seen, b.seen);
  const bool inside = (ea >= 0.0 && eb >= 0.0 && ep >= 0.0) || (ea <= 0.0 && eb <= 0.0 && ep <= 0.0);
  if (!inside) return false;
  const double inverse = 1.0 / (ea + eb + ep);
  const double t = (ea * a.seen.z + eb * b.seen.z + ep * p.seen.z) * inverse;
  const double b1 = (ea * a.b1 + eb * b.b1 + ep * p.b1) * inverse, b2 = (ea * a.b2 + eb * b.b2 + ep * p.b2) * inverse;
  // What is beside the base triangle is its neighbour's. NaN, of a triangle seen edge-on, is no hit.
  if (!(b1 >= 0.0 && b2 >= 0.0 && b1 + b2 <= 1.0 && t > c.t_min && t < c.t_max)) return false;
  c.hit = {t, b1, b2, i, j, tau};
  c.t_max = t;
  c.found = true;
  return true;
}

/// In place of cell_intersect. Cells that have no corners, beside a clamped map or without area in it, are left to that.
/// @param tau0, tau1  as there; the triangles are met anywhere
RELIEF_KERNEL bool micro_triangles_intersect(PrismSearch& c,
                                             const CurveSegment& g,
                                             std::int64_t i,
                                             std::int64_t j,
                                             double tau0,
                                             double tau1)
{
  const DisplacedTriangle& tri = c.tri;
  const auto is_beside = [](const LatticeAxis& axis, std::int64_t at) {
    return axis.wrap == Wrap::kClamp && (at < 0 || at >= axis.num_texels - 1);
  };
  const double xu = tri.x[1] - tri.x[0], xv = tri.x[2] - tri.x[0];
  const double yu = tri.y[1] - tri.y[0], yv = tri.y[2] - tri.y[0];
  const double det = xu * yv - xv * yu;
  if (det == 0.0 || is_beside(c.mesh.field->x, i) || is_beside(c.mesh.field->y, j)) {
    return cell_intersect(c, g, i, j, tau0, tau1);
  }
  ++c.counters.texels;
  const double inverse = 1.0 / det;
  const Vec3d O{c.curve.frame.O[0], c.curve.frame.O[1], c.curve.frame.O[2]};
  MicroVertex corners[4];
  for (int k = 0; k < 4; ++k) {
    const std::int64_t column = i + (k & 1), row = j + (k >> 1);
    const double x = static_cast<double>(column) - tri.x[0], y = static_cast<double>(row) - tri.y[0];
    MicroVertex& v = corners[k];
    v.b1 = (yv * x - xv * y) * inverse;
    v.b2 = (xu * y - yu * x) * inverse;
    const BasePoint base = base_point(tri, v.b1, v.b2);
    const double d = c.mesh.scale * (lattice_height(*c.mesh.field, column, row) - c.mesh.midlevel);
    // The ray's origin is subtracted first: far from the world's origin the point itself has lost digits.
    const Vec3d P = (to_double(tri.P[0]) - O) + v.b1 * base.Pu + v.b2 * base.Pv;
    v.seen = ray_seen(c.curve.frame, P + base.N * (d / length(base.N)));
  }
  const double tau = 0.5 * (tau0 + tau1);
  const bool lower = micro_triangle_intersect(c, corners[0], corners[1], corners[2], i, j, tau);
  return micro_triangle_intersect(c, corners[3], corners[2], corners[1], i, j, tau) || lower;
}

}  // namespace relief
