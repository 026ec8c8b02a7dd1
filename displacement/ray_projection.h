// The ray's curve seen in the height map: the conic ψ = 0 of the RMIP paper, but with a parameter.
//
// The paper has the projection in implicit form only, ψ(u, v) = det(P − O, N, D) = 0, splits it at the points where ψ_u or
// ψ_v vanishes, and finds where it crosses a line by solving a quadratic. The curve of ray_curve.h is the same conic with
// lattice coordinates X(τ)/W(τ), Y(τ)/W(τ), so all of that is closed forms in τ, and none has to choose between the
// two branches of a conic: on a stretch without turning points a line between the ends is crossed exactly once.
#pragma once

#include "displacement/ray_curve.h"

namespace relief {

/// A quadratic over a stretch of its parameter by its Bernstein coefficients: its value at the start, the blossom of start
/// and end, its value at the end.
struct BernsteinQuadratic {
  double start = 0, middle = 0, end = 0;
};

RELIEF_KERNEL BernsteinQuadratic bernstein_make(const Quadratic& p, double tau0, double tau1)
{
  return {quadratic_at(p, tau0), quadratic_blossom(p, tau0, tau1), quadratic_at(p, tau1)};
}

/// The u in [0, 1] where p − c·W vanishes, u = 0 at the start of the stretch and 1 at its end.
/// @pre     p/W − c has opposite signs at the two ends, or one of them is zero: then there is just one such u, no
///          discriminant can be negative, and nothing is cancelled. Broken by rounding only, it ends at either end.
RELIEF_KERNEL double bernstein_crossing(const BernsteinQuadratic& p, const BernsteinQuadratic& W, double c)
{
  double f0 = p.start - c * W.start, fm = p.middle - c * W.middle, f1 = p.end - c * W.end;
  const double sign = f1 < f0 ? -1.0 : 1.0;
  f0 *= sign;
  fm *= sign;
  f1 *= sign;
  // f1·r² + 2·fm·r + f0 = 0 with r = u/(1 − u): of the roots, whose product is negative, the positive one.
  const double root = __builtin_sqrt(max(fm * fm - f0 * f1, 0.0));
  const double numerator = fm >= 0.0 ? -f0 : root - fm;
  const double denominator = fm >= 0.0 ? fm + root - f0 : root - fm + f1;
  const double u = numerator / denominator;
  // NaN (all of it on the line) becomes 0.
  return u > 0.0 ? (u < 1.0 ? u : 1.0) : 0.0;
}

/// A segment of the curve in the height map. Coordinates are lattice units from vertex 0 of the triangle.
struct RayProjection {
  Quadratic X, Y, W;
  double origin_x = 0, origin_y = 0;  ///< lattice coordinates of vertex 0
  double pad_x = 0, pad_y = 0;        ///< bounds what rounding does to a position, or to a turning point not seen
};

RELIEF_KERNEL RayProjection ray_projection_make(const DisplacedTriangle& tri, const CurveSegment& g)
{
  RayProjection r;
  const double xu = tri.x[1] - tri.x[0], xv = tri.x[2] - tri.x[0];
  const double yu = tri.y[1] - tri.y[0], yv = tri.y[2] - tri.y[0];
  r.X = g.e[1] * xu + g.e[2] * xv;
  r.Y = g.e[1] * yu + g.e[2] * yv;
  r.W = g.W;
  r.origin_x = tri.x[0];
  r.origin_y = tri.y[0];
  double size = 0;
  for (const Quadratic& e : g.e) size += __builtin_fabs(e.a) + __builtin_fabs(e.b) + __builtin_fabs(e.c);
  // A position is off by a few roundings, amplified by size/W. A pair of turning points is missed if rounding takes the
  // derivative (X'W − XW')/W² from crossing zero; what the curve then moves in between is amplified by the square.
  const double amplification = size / g.W_min;
  const double relative = 0x1p-48 * amplification * amplification + g.relative_error;
  r.pad_x = relative * (__builtin_fabs(xu) + __builtin_fabs(xv)) + 0x1p-50 * __builtin_fabs(tri.x[0]);
  r.pad_y = relative * (__builtin_fabs(yu) + __builtin_fabs(yv)) + 0x1p-50 * __builtin_fabs(tri.y[0]);
  return r;
}

/// Appends the τ inside (tau0, tau1) at which one coordinate turns back.
/// @param P  X or Y
/// @source   Thonat et al. 2023, §4.2: the intersections with ψ_u = 0 and ψ_v = 0; here the zeros of (P/W)'
RELIEF_KERNEL int turning_points(const Quadratic& P,
                                 const Quadratic& W,
                                 double tau0,
                                 double tau1,
                                 double* points,
                                 int count)
{
  const Quadratic derivative{P.a * W.b - P.b * W.a, 2.0 * (P.a * W.c - P.c * W.a), P.b * W.c - P.c * W.b};
  return quadratic_roots_inside(derivative, tau0, tau1, points, count);
}

/// A stretch of the curve on which both coordinates are monotone, so that its ends span its bounding rectangle: the 2D
/// ray bound of the paper.
///
/// Its members have no default values: a stack of them need not be cleared for each ray.
struct ProjectedStretch {
  double tau0, tau1;
  double x0, y0, x1, y1;  ///< at tau0 and tau1, from vertex 0
};

RELIEF_KERNEL void stretch_start(const RayProjection& r, double tau, ProjectedStretch* stretch)
{
  const double inverse = 1.0 / quadratic_at(r.W, tau);
  stretch->tau0 = tau;
  stretch->x0 = quadratic_at(r.X, tau) * inverse;
  stretch->y0 = quadratic_at(r.Y, tau) * inverse;
}

RELIEF_KERNEL void stretch_end(const RayProjection& r, double tau, ProjectedStretch* stretch)
{
  const double inverse = 1.0 / quadratic_at(r.W, tau);
  stretch->tau1 = tau;
  stretch->x1 = quadratic_at(r.X, tau) * inverse;
  stretch->y1 = quadratic_at(r.Y, tau) * inverse;
}

/// The part of an axis on which heights change, lattice units from vertex 0: beside a clamped map there is one more unit.
struct VaryingPart {
  double low = -__builtin_huge_val(), high = __builtin_huge_val();
};

/// @param origin  lattice coordinate of vertex 0
RELIEF_KERNEL VaryingPart varying_part(const LatticeAxis& axis, double origin)
{
  if (axis.wrap != Wrap::kClamp) return {};
  return {-1.0 - origin, static_cast<double>(axis.num_texels) - origin};
}

/// The rectangle of a stretch as far as heights change in it.
struct VaryingSides {
  double x0, x1, y0, y1;  ///< at the ends of the stretch
};

RELIEF_KERNEL VaryingSides varying_sides(const ProjectedStretch& s, const VaryingPart& x, const VaryingPart& y)
{
  const auto inside = [](double at, const VaryingPart& part) { return min(max(at, part.low), part.high); };
  return {inside(s.x0, x), inside(s.x1, x), inside(s.y0, y), inside(s.y1, y)};
}

/// Splits a stretch at a point of it.
/// @return  false if it is not inside
RELIEF_KERNEL bool stretch_split_at(const RayProjection& r,
                                    const ProjectedStretch& stretch,
                                    double tau,
                                    ProjectedStretch* front,
                                    ProjectedStretch* back)
{
  // NaN is not inside.
  if (!(tau > stretch.tau0 && tau < stretch.tau1)) return false;
  *front = stretch;
  *back = stretch;
  stretch_end(r, tau, front);
  back->tau0 = tau;
  back->x0 = front->x1;
  back->y0 = front->y1;
  return true;
}

/// Splits a stretch where it crosses the line through the middle of the longer side of its rectangle.
/// @return  false if it is too short to be split
/// @source  Thonat et al. 2023, §4.3, Fig. 5c; where the map is clamped only what is over the map counts: beside it one
///          cell is as long as the triangle
RELIEF_KERNEL bool stretch_split(const RayProjection& r,
                                 const ProjectedStretch& stretch,
                                 const VaryingSides& sides,
                                 ProjectedStretch* front,
                                 ProjectedStretch* back)
{
  const bool along_x = __builtin_fabs(sides.x1 - sides.x0) >= __builtin_fabs(sides.y1 - sides.y0);
  const BernsteinQuadratic P = bernstein_make(along_x ? r.X : r.Y, stretch.tau0, stretch.tau1);
  const BernsteinQuadratic W = bernstein_make(r.W, stretch.tau0, stretch.tau1);
  const double middle = 0.5 * (along_x ? sides.x0 + sides.x1 : sides.y0 + sides.y1);
  const double tau = stretch.tau0 + bernstein_crossing(P, W, middle) * (stretch.tau1 - stretch.tau0);
  return stretch_split_at(r, stretch, tau, front, back);
}

}  // namespace relief
