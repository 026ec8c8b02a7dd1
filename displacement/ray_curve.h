// A ray seen from inside a displaced triangle: a curve in closed form.
//
// In a frame in which the ray is the z axis, a point P(b) + s·N(b) is on the ray when its x and y vanish. For a fixed s
// the three offset vertices v_i(s) = P_i + s·N_i are a plain triangle, and the ray meets its plane at the barycentric
// weights b_i = e_i(s)/W(s) with the edge functions e_i = v_j × v_k (2D cross products, quadratic in s) and W = Σ e_i.
// So the whole curve of the ray in (b, s), and with it in the height map, is a rational quadratic in s: no inversion has
// to be iterated, the walls of the bounding prism are the roots of the e_i, and two triangles that share an edge compute
// the same wall from the same numbers (Ogaki 2023 parametrizes shells the same way).
//
// Where a facet is seen edge-on, W vanishes and s says nothing; the ray then stays at one s and the curve is a straight
// line in b. Both kinds are kept as one form, homogeneous quadratics of a parameter τ in [0, 1] along the ray.
#pragma once

#include "displacement/displaced_triangle.h"
#include "displacement/lanes.h"

namespace relief {

/// The shear that makes a ray the z axis, as in Woop, Benthin and Wald 2013, "Watertight Ray/Triangle Intersection".
struct RayFrame {
  double O[3];
  int kx = 0, ky = 1, kz = 2;  ///< kz: the axis along which the direction is longest
  double Sx = 0, Sy = 0, Sz = 1;
};

RELIEF_KERNEL RayFrame ray_frame_make(Vec3d O, Vec3d D)
{
  RayFrame f;
  const double d[3] = {D.x, D.y, D.z};
  f.O[0] = O.x;
  f.O[1] = O.y;
  f.O[2] = O.z;
  const double ax = __builtin_fabs(d[0]), ay = __builtin_fabs(d[1]), az = __builtin_fabs(d[2]);
  f.kz = ax > ay ? (ax > az ? 0 : 2) : (ay > az ? 1 : 2);
  f.kx = f.kz == 2 ? 0 : f.kz + 1;
  f.ky = f.kx == 2 ? 0 : f.kx + 1;
  f.Sz = 1.0 / d[f.kz];
  f.Sx = d[f.kx] * f.Sz;
  f.Sy = d[f.ky] * f.Sz;
  return f;
}

/// A vector in the frame: the ray is where x = y = 0, and z is its parameter.
struct RaySeen {
  double x, y, z;
};

/// @param a  a direction, or a point with the ray's origin taken off
RELIEF_KERNEL RaySeen ray_seen(const RayFrame& frame, const Vec3d& a)
{
  const double axes[3] = {a.x, a.y, a.z};
  const double z = axes[frame.kz];
  return {axes[frame.kx] - frame.Sx * z, axes[frame.ky] - frame.Sy * z, z * frame.Sz};
}

/// a·τ² + b·τ + c
struct Quadratic {
  double a, b, c;
};

RELIEF_KERNEL double quadratic_at(Quadratic p, double tau) { return fused(fused(p.a, tau, p.b), tau, p.c); }

RELIEF_KERNEL Quadratic operator+(Quadratic p, Quadratic q) { return {p.a + q.a, p.b + q.b, p.c + q.c}; }
RELIEF_KERNEL Quadratic operator*(Quadratic p, double k) { return {p.a * k, p.b * k, p.c * k}; }
/// The polynomial in u with τ = origin + u·step.
RELIEF_KERNEL Quadratic quadratic_shift(Quadratic p, double origin, double step)
{
  return {p.a * step * step, (p.b + 2.0 * p.a * origin) * step, quadratic_at(p, origin)};
}
/// The middle Bernstein coefficient over a stretch: between its ends p is within what they and this span.
RELIEF_KERNEL double quadratic_blossom(Quadratic p, double from, double to)
{
  return p.a * from * to + 0.5 * p.b * (from + to) + p.c;
}
/// Least value over [0, 1].
RELIEF_KERNEL double quadratic_minimum(Quadratic p)
{
  double low = min(p.c, p.a + p.b + p.c);
  if (p.a > 0.0 && p.b < 0.0 && p.b > -2.0 * p.a) low = min(low, p.c - p.b * p.b / (4.0 * p.a));
  return low;
}

/// Appends the roots that lie strictly inside (low, high), in no order.
RELIEF_KERNEL int quadratic_roots_inside(Quadratic p, double low, double high, double* roots, int count)
{
  const double discriminant = p.b * p.b - 4.0 * p.a * p.c;
  if (!(discriminant >= 0.0)) return count;
  const double q = -0.5 * (p.b + __builtin_copysign(__builtin_sqrt(discriminant), p.b));
  // Either may be infinite or NaN (a = 0, q = 0); comparisons turn those away.
  const double r1 = q / p.a, r2 = p.c / q;
  if (r1 > low && r1 < high) roots[count++] = r1;
  if (r2 > low && r2 < high) roots[count++] = r2;
  return count;
}

/// A stretch of a ray inside a triangle's prism. Without initial values: a curve has room for many, and most have one.
struct CurveSegment {
  Quadratic e[3];         ///< homogeneous barycentric weights of τ in [0, 1]
  Quadratic W;            ///< their sum, positive on [0, 1]
  double s0, ds;          ///< s = s0 + τ·ds
  double W_min;           ///< least W on [0, 1], positive
  double relative_error;  ///< bound on the rounding error of the weights e_i/W
  double t0, t1;          ///< ray parameter at τ = 0 and 1, t0 <= t1
};

/// At most 4 intervals a sign, and at most two cuts each where the facet turns edge-on.
inline constexpr int kMaxCurveSegments = 12;

/// A ray in one triangle's prism.
struct RayCurve {
  RayFrame frame;
  double z[3], nz[3];  ///< ray parameter of P_i + s·N_i: z + s·nz
  int num_segments;
  CurveSegment segments[kMaxCurveSegments];
};

RELIEF_KERNEL double curve_t(const RayCurve& curve, const CurveSegment& g, double tau)
{
  const double e0 = quadratic_at(g.e[0], tau), e1 = quadratic_at(g.e[1], tau), e2 = quadratic_at(g.e[2], tau),
               s = g.s0 + tau * g.ds;
  return (e0 * (curve.z[0] + s * curve.nz[0]) + e1 * (curve.z[1] + s * curve.nz[1]) +
          e2 * (curve.z[2] + s * curve.nz[2])) /
         (e0 + e1 + e2);
}

/// Where a segment has a ray parameter, t growing with τ.
/// @param t  within [t0, t1]
RELIEF_KERNEL double curve_tau(const RayCurve& curve, const CurveSegment& g, double t)
{
  // Illinois: t is nearly linear in τ, so that a few secant steps do.
  double low = 0, high = 1, below = g.t0 - t, above = g.t1 - t, tau = 0;
  int stayed = 0;
  for (int k = 0; k < 60 && below < 0.0 && above > 0.0; ++k) {
    tau = low + (high - low) * (below / (below - above));
    const double off = curve_t(curve, g, tau) - t;
    if (__builtin_fabs(off) <= 0x1p-50 * __builtin_fabs(t)) return tau;
    if (off < 0.0) {
      low = tau;
      below = off;
      if (stayed == 1) above *= 0.5;
      stayed = 1;
    } else {
      high = tau;
      above = off;
      if (stayed == 2) below *= 0.5;
      stayed = 2;
    }
  }
  return below >= 0.0 ? low : (above <= 0.0 ? high : tau);
}

/// Part of a segment, by its parameter; empty when tau0 > tau1.
struct CurveRange {
  double tau0 = 0, tau1 = 1;
};

/// The part of a segment that can hold points with t in [t_min, t_max]; a little more than that.
/// @param monotone  t grows with τ (it does where the prism is not folded); otherwise nothing is cut off
RELIEF_KERNEL CurveRange
curve_clip(const RayCurve& curve, const CurveSegment& g, bool monotone, double t_min, double t_max)
{
  CurveRange range;
  if (!monotone) return range;
  if (g.t1 < t_min || g.t0 > t_max) return {1, 0};
  // Secant steps, each moved away from the kept side by a part of the bracket so that it closes in on both ends.
  constexpr int kSteps = 4;
  if (g.t0 < t_min) {
    double high = 1, t_low = g.t0, t_high = g.t1;
    for (int k = 0; k < kSteps; ++k) {
      const double tau = range.tau0 + (high - range.tau0) * 0.97 * ((t_min - t_low) / (t_high - t_low));
      const double t = curve_t(curve, g, tau);
      (t <= t_min ? range.tau0 : high) = tau;
      (t <= t_min ? t_low : t_high) = t;
    }
  }
  if (g.t1 > t_max) {
    double low = range.tau0, t_low = curve_t(curve, g, low), t_high = g.t1;
    for (int k = 0; k < kSteps && t_low < t_max; ++k) {
      const double tau = range.tau1 - (range.tau1 - low) * 0.97 * ((t_high - t_max) / (t_high - t_low));
      const double t = curve_t(curve, g, tau);
      (t >= t_max ? range.tau1 : low) = tau;
      (t >= t_max ? t_high : t_low) = t;
    }
  }
  return range;
}

namespace curve_detail {

/// What is needed of the triangle in the ray's frame while its curve is made.
struct Projected {
  double x[3], y[3], nx[3], ny[3];
};

/// a × b to about one ulp, also under cancellation (Kahan).
RELIEF_KERNEL double cross2_exact(double ax, double ay, double bx, double by)
{
  const double product = ay * bx;
  const double error = __builtin_fma(-ay, bx, product);
  return __builtin_fma(ax, by, -product) + error;
}

RELIEF_KERNEL void sort_ascending(double* values, int count)
{
  for (int i = 1; i < count; ++i) {
    const double value = values[i];
    int k = i;
    for (; k > 0 && values[k - 1] > value; --k) values[k] = values[k - 1];
    values[k] = value;
  }
}

/// @param tolerance  absolute error of the edge functions
RELIEF_KERNEL void add_segment(RayCurve& curve, CurveSegment g, double tolerance)
{
  g.t0 = curve_t(curve, g, 0.0);
  g.t1 = curve_t(curve, g, 1.0);
  if (g.t1 < g.t0) {
    for (Quadratic& e : g.e) e = quadratic_shift(e, 1.0, -1.0);
    g.s0 += g.ds;
    g.ds = -g.ds;
    const double t = g.t0;
    g.t0 = g.t1;
    g.t1 = t;
  }
  g.W = g.e[0] + g.e[1] + g.e[2];
  g.W_min = quadratic_minimum(g.W);
  if (!(g.W_min > 0.0) || curve.num_segments == kMaxCurveSegments) return;
  g.relative_error = tolerance / g.W_min;
  curve.segments[curve.num_segments++] = g;
}

/// Edge functions over s0 + τ·ds for a facet seen almost edge-on: their terms cancel, so they are made anew from the
/// vertices at s0. Those are rounded alike for all edges, which moves the facet by an ulp and no more.
RELIEF_KERNEL void nearly_edge_on_functions(const Projected& v, double s0, double ds, Quadratic* e)
{
  double x[3], y[3];
  for (int i = 0; i < 3; ++i) {
    x[i] = v.x[i] + s0 * v.nx[i];
    y[i] = v.y[i] + s0 * v.ny[i];
  }
  for (int i = 0; i < 3; ++i) {
    const int j = i == 2 ? 0 : i + 1, k = j == 2 ? 0 : j + 1;
    e[i].c = cross2_exact(x[j], y[j], x[k], y[k]);
    e[i].b = (cross2_exact(x[j], y[j], v.nx[k], v.ny[k]) + cross2_exact(v.nx[j], v.ny[j], x[k], y[k])) * ds;
    e[i].a = cross2_exact(v.nx[j], v.ny[j], v.nx[k], v.ny[k]) * ds * ds;
  }
}

/// The facet at s is edge-on: the ray runs within its plane, from edge to edge.
RELIEF_KERNEL void add_edge_on_segment(RayCurve& curve, const Projected& v, double s)
{
  double x[3], y[3], z[3];
  double extent_x = 0, extent_y = 0;
  for (int i = 0; i < 3; ++i) {
    x[i] = v.x[i] + s * v.nx[i];
    y[i] = v.y[i] + s * v.ny[i];
    z[i] = curve.z[i] + s * curve.nz[i];
    extent_x = max(extent_x, __builtin_fabs(x[i]));
    extent_y = max(extent_y, __builtin_fabs(y[i]));
  }
  const double* w = extent_x > extent_y ? x : y;
  double near_b[3] = {0, 0, 0}, far_b[3] = {0, 0, 0}, near_t = 0, far_t = 0;
  bool any = false;
  for (int i = 0; i < 3; ++i) {
    const int j = i == 2 ? 0 : i + 1;
    if ((w[i] > 0.0 && w[j] > 0.0) || (w[i] < 0.0 && w[j] < 0.0)) continue;
    const double span = w[j] - w[i];
    // Both ends: an edge along the ray crosses it everywhere.
    const double at[2] = {span != 0.0 ? w[j] / span : 1.0, span != 0.0 ? w[j] / span : 0.0};
    for (const double weight : at) {
      const double t = weight * z[i] + (1.0 - weight) * z[j];
      double b[3] = {0, 0, 0};
      b[i] = weight;
      b[j] = 1.0 - weight;
      if (!any || t < near_t) {
        near_t = t;
        for (int k = 0; k < 3; ++k) near_b[k] = b[k];
      }
      if (!any || t > far_t) {
        far_t = t;
        for (int k = 0; k < 3; ++k) far_b[k] = b[k];
      }
      any = true;
    }
  }
  if (!any) return;
  CurveSegment g;
  for (int i = 0; i < 3; ++i) g.e[i] = {0.0, far_b[i] - near_b[i], near_b[i]};
  // The ray is not exactly parallel to the facet; N is nearly across it, so s is well defined at both ends.
  const auto s_at = [&](const double* b) {
    double px = 0, py = 0, nx = 0, ny = 0;
    for (int k = 0; k < 3; ++k) {
      px += b[k] * v.x[k];
      py += b[k] * v.y[k];
      nx += b[k] * v.nx[k];
      ny += b[k] * v.ny[k];
    }
    const double squared = nx * nx + ny * ny;
    return squared > 0.0 ? -(px * nx + py * ny) / squared : s;
  };
  g.s0 = s_at(near_b);
  g.ds = s_at(far_b) - g.s0;
  // The facet is seen at up to 1e-10, and as far is the straight line from the curve.
  add_segment(curve, g, 0x1p-30);
}

/// Adds [begin, end] of s, all of which is inside; where it is edge-on the other form stands for it.
/// @param e     edge functions, turned so that they are positive inside
/// @param sign  how they were turned
RELIEF_KERNEL void add_interval(RayCurve& curve,
                                const Projected& v,
                                const Quadratic* e,
                                double sign,
                                double begin,
                                double end,
                                double edge_on,
                                double tolerance)
{
  Quadratic W = e[0] + e[1] + e[2];
  W.c -= edge_on;
  double pieces[4];
  // Mostly all three Bernstein coefficients are positive, and so is W in between.
  const bool faces = min(min(quadratic_at(W, begin), quadratic_at(W, end)), quadratic_blossom(W, begin, end)) > 0.0;
  int num_pieces = faces ? 0 : quadratic_roots_inside(W, begin, end, pieces, 0);
  pieces[num_pieces++] = end;
  sort_ascending(pieces, num_pieces);
  for (int k = 0; k < num_pieces; ++k) {
    const double stop = pieces[k];
    if (quadratic_at(W, 0.5 * (begin + stop)) < 0.0) {
      add_edge_on_segment(curve, v, 0.5 * (begin + stop));
    } else {
      CurveSegment g;
      // Seen at less than a hundredth: the other form's points are off the ray by the rounding of the edge functions
      // over W.
      if (min(quadratic_at(W, begin), quadratic_at(W, stop)) < 1e8 * edge_on) {
        nearly_edge_on_functions(v, begin, stop - begin, g.e);
        for (Quadratic& q : g.e) q = q * sign;
      } else {
        for (int i = 0; i < 3; ++i) g.e[i] = quadratic_shift(e[i], begin, stop - begin);
      }
      g.s0 = begin;
      g.ds = stop - begin;
      add_segment(curve, g, tolerance);
    }
    begin = stop;
  }
}

}  // namespace curve_detail

/// The ray's curve through the prism {P(b) + s·N(b) : b in the triangle, s in [s_min, s_max]}.
///
/// Segments are closed and reach a little over the prism's walls: by the rounding error of the edge functions, so that
/// a point on a wall is in the segments of both neighbours. They are ordered by t0.
/// @return  false if there is none
RELIEF_KERNEL bool ray_curve_make(const RayFrame& frame, const DisplacedTriangle& tri, RayCurve* out)
{
  RayCurve& curve = *out;
  curve.frame = frame;
  curve.num_segments = 0;
  const double low = tri.s_min, high = tri.s_max;
  if (low > high) return false;  // no surface: its normals are zero
  const double reach = max(__builtin_fabs(low), __builtin_fabs(high));

  // Lane i is vertex i (lane 3 repeats vertex 2), then edge i, which is opposite to it.
  const auto lanes_of = [](const Vec3f* v, int axis) {
    // Of each array eight floats are read from the axis on: after the last of them there are more of the triangle.
    static_assert(sizeof(Vec3f) == 3 * sizeof(float));
    const F8 f = load8(reinterpret_cast<const float*>(v) + axis);
    return __builtin_convertvector(__builtin_shufflevector(f, f, 0, 3, 6, 6), D4);
  };
  const D4 pz = lanes_of(tri.P, frame.kz) - frame.O[frame.kz], nz = lanes_of(tri.N, frame.kz);
  const D4 x = lanes_of(tri.P, frame.kx) - frame.O[frame.kx] - frame.Sx * pz;
  const D4 y = lanes_of(tri.P, frame.ky) - frame.O[frame.ky] - frame.Sy * pz;
  const D4 nx = lanes_of(tri.N, frame.kx) - frame.Sx * nz, ny = lanes_of(tri.N, frame.ky) - frame.Sy * nz;
  const double extent = max_of_vertices(abs(x) + abs(y) + reach * (abs(nx) + abs(ny)));
  const D4 xj = next_vertex(x), yj = next_vertex(y), nxj = next_vertex(nx), nyj = next_vertex(ny);
  const D4 xk = next_vertex(xj), yk = next_vertex(yj), nxk = next_vertex(nxj), nyk = next_vertex(nyj);
  // Contraction to fused multiply-adds is switched off for this folder (see its CMakeLists.txt): a·b − c·d must be
  // exactly the negative of c·d − a·b, or a ray along a wall could be outside of both neighbours.
  const D4 ec = xj * yk - yj * xk;
  const D4 eb = (xj * nyk - yj * nxk) + (nxj * yk - nyj * xk);
  const D4 ea = nxj * nyk - nyj * nxk;
  // Each coefficient is a sum of at most four products below extent², in units of its power of s; evaluation and the
  // roots' own rounding add a few more.
  const double tolerance = 0x1p-48 * extent * extent;
  const double edge_on = 1e-10 * extent * extent;
  const D4 at_low = (ea * low + eb) * low + ec, at_high = (ea * high + eb) * high + ec;
  // Between its ends a quadratic is at most a·Δ²/4 beyond them.
  const D4 bulge = ea * (0.25 * (high - low) * (high - low));
  const D4 zero{};
  const D4 most = max(at_low, at_high) - min(bulge, zero), least = min(at_low, at_high) - max(bulge, zero);
  bool possible[2] = {most[0] >= -tolerance && most[1] >= -tolerance && most[2] >= -tolerance,
                      least[0] <= tolerance && least[1] <= tolerance && least[2] <= tolerance};
  if (!possible[0] && !possible[1]) return false;
  const D4 z_lanes = pz * frame.Sz, nz_lanes = nz * frame.Sz;
  for (int i = 0; i < 3; ++i) {
    curve.z[i] = z_lanes[i];
    curve.nz[i] = nz_lanes[i];
  }

  for (int side = 0; side < 2; ++side) {
    if (!possible[side]) continue;
    const double sign = side == 0 ? 1.0 : -1.0;
    const D4 a = ea * sign, b = eb * sign, c = ec * sign + tolerance;
    // Roots of all three, as in quadratic_roots_inside.
    const D4 discriminant = b * b - 4.0 * a * c;
    const D4 root = sqrt(max(discriminant, zero));
    const D4 q = -0.5 * (b < 0.0 ? b - root : b + root);
    const D4 r1 = q / a, r2 = c / q;
    double cuts[8];
    int num_cuts = 0;
    for (int i = 0; i < 3; ++i) {
      if (!(discriminant[i] >= 0.0)) continue;
      if (r1[i] > low && r1[i] < high) cuts[num_cuts++] = r1[i];
      if (r2[i] > low && r2[i] < high) cuts[num_cuts++] = r2[i];
    }
    cuts[num_cuts++] = high;
    curve_detail::sort_ascending(cuts, num_cuts);

    const double W_sign = sign;
    double from = low, start = low;
    bool open = false;
    for (int n = 0; n < num_cuts; ++n) {
      const double to = cuts[n], middle = 0.5 * (from + to);
      const D4 at = (a * middle + b) * middle + c;
      const bool accepted = at[0] >= 0.0 && at[1] >= 0.0 && at[2] >= 0.0;
      if (accepted && !open) start = from;
      if ((open && !accepted) || (accepted && n + 1 == num_cuts)) {
        const Quadratic e[3] = {
            {a[0], b[0], W_sign * ec[0]}, {a[1], b[1], W_sign * ec[1]}, {a[2], b[2], W_sign * ec[2]}};
        const curve_detail::Projected v{
            {x[0], x[1], x[2]}, {y[0], y[1], y[2]}, {nx[0], nx[1], nx[2]}, {ny[0], ny[1], ny[2]}};
        curve_detail::add_interval(curve, v, e, sign, start, accepted ? to : from, edge_on, tolerance);
      }
      open = accepted;
      from = to;
    }
  }
  for (int i = 1; i < curve.num_segments; ++i) {
    const CurveSegment g = curve.segments[i];
    int k = i;
    for (; k > 0 && curve.segments[k - 1].t0 > g.t0; --k) curve.segments[k] = curve.segments[k - 1];
    curve.segments[k] = g;
  }
  return curve.num_segments > 0;
}

}  // namespace relief
