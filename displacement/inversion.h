// Point-wise displacement inversion: which displacement line goes through a point of the ray.
//
// The paper solves (P(u, v) − X) × N(u, v) = 0 for two unknowns by Newton's method, for any point X. All points asked for
// are on the ray, whose curve is known (ray_curve.h), so one unknown is left: the curve's parameter, a root of the cubic
// T(τ) − t·W(τ).
#pragma once

#include "displacement/ray_curve.h"

namespace relief {

/// The numerator of t along a segment, t = T(τ)/W(τ).
struct Cubic {
  double a = 0, b = 0, c = 0, d = 0;  ///< a·τ³ + b·τ² + c·τ + d
};

RELIEF_KERNEL double cubic_at(const Cubic& p, double tau) { return ((p.a * tau + p.b) * tau + p.c) * tau + p.d; }

RELIEF_KERNEL Cubic ray_distance_make(const RayCurve& curve, const CurveSegment& g)
{
  Cubic T;
  for (int i = 0; i < 3; ++i) {
    const double z = curve.z[i] + g.s0 * curve.nz[i], slope = g.ds * curve.nz[i];
    T.a += slope * g.e[i].a;
    T.b += z * g.e[i].a + slope * g.e[i].b;
    T.c += z * g.e[i].b + slope * g.e[i].c;
    T.d += z * g.e[i].c;
  }
  return T;
}

/// A stretch of a ray's curve on which t grows with τ.
struct GrowingStretch {
  double tau0, tau1;
  double t0, t1;  ///< t at its ends
};

/// Where the ray is at t.
/// @param t           within the stretch's
/// @param iterations  incremented
/// @return  within `tolerance` of the stretch's length of the answer, or NaN if Newton's method has not converged
/// @source  Thonat et al. 2023, §4.1 and supplement B; the start is the chord's answer, of which their centre of the current
///          bound is the coarser version; the tolerance is relative to the stretch, theirs is 1e-5 in uv
RELIEF_KERNEL double ray_invert(const Cubic& T,
                                const Quadratic& W,
                                const GrowingStretch& on,
                                double t,
                                double tolerance,
                                std::uint64_t* iterations)
{
  constexpr int kMaxIterations = 10;
  const double length = on.tau1 - on.tau0;
  double tau = on.tau0 + length * ((t - on.t0) / (on.t1 - on.t0));
  for (int k = 0; k < kMaxIterations; ++k) {
    ++*iterations;
    const double value = cubic_at(T, tau) - t * quadratic_at(W, tau);
    const double slope = (3.0 * T.a * tau + 2.0 * T.b) * tau + T.c - t * (2.0 * W.a * tau + W.b);
    const double step = value / slope;
    tau -= step;
    if (!(tau >= on.tau0 && tau <= on.tau1)) break;
    if (__builtin_fabs(step) <= tolerance * length) return tau;
  }
  return __builtin_nan("");
}

}  // namespace relief
