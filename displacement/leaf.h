// The leaf test that all methods end in: the first point where a ray's curve meets the bilinear patch of one cell.
//
// Along the curve the question is one-dimensional: g(τ) = s·|N| − d, the height of the ray over the surface, measured
// along the displacement direction. Its roots are isolated by what g can deviate from a straight line over an interval
// (`curve_deviation`, proven), so that none is lost, then closed in on by bracketing.
#pragma once

#include <atomic>

#include "displacement/ray_curve.h"

namespace relief {

/// Where a ray meets a displaced triangle.
struct DisplacedHit {
  double t = 0;
  double b1 = 0, b2 = 0;      ///< barycentric weights of vertices 1 and 2, in [0, 1] up to rounding
  std::int64_t i = 0, j = 0;  ///< cell; its patch has the hit's normal
  double tau = 0;             ///< on its segment
  int level = 0;              ///< of the height map, see level_of_detail.h
  int edge = -1;              ///< of the triangle, whose seam's wall is hit (seam_walls.h); −1: the surface
  double d = 0;               ///< of a wall's point: displacement, metres
};

/// What one ray counts; the same for all methods, so that they can be compared. Counters go wherever a ray goes, and so
/// take the word to stop along.
struct TraversalCounters {
  std::uint64_t bounds = 0;                 ///< 2D or 3D bounds tested, children of pyramid nodes one by one
  std::uint64_t texels = 0;                 ///< cells tested by the leaf
  std::uint64_t inversions = 0;             ///< iterations of point-wise inversion
  std::uint64_t prisms = 0;                 ///< triangles whose prism the ray enters
  const std::atomic<bool>* stop = nullptr;  ///< true: nobody waits for an answer any more; null: somebody always does
  bool stopped = false;                     ///< a search was given up, and its answer is none
};

/// Whether searches are to be given up; notes that they are.
RELIEF_KERNEL bool traversal_stop(TraversalCounters& counters)
{
  if (counters.stop == nullptr || !counters.stop->load(std::memory_order_relaxed)) return false;
  counters.stopped = true;
  return true;
}

/// Bounds after which one search asks again; they take a few tenths of a millisecond.
inline constexpr std::uint64_t kBoundsAPoll = 4096;

/// traversal_stop, if it is due.
/// @param next  counters.bounds at which it is; at the start of a search kBoundsAPoll from there
RELIEF_KERNEL bool traversal_poll(TraversalCounters& counters, std::uint64_t& next)
{
  if (counters.bounds < next) [[likely]]
    return false;
  next = counters.bounds + kBoundsAPoll;
  return traversal_stop(counters);
}

/// A point of the curve. Without initial values: the leaf has room for many, and uses few.
struct CurvePoint {
  double tau;
  double b1, b2, W;
  double x, y;  ///< lattice coordinates
  double Nx, Ny, Nz;
  double s, nu;  ///< nu = |N|
};

RELIEF_KERNEL Vec3d curve_normal(const CurvePoint& p) { return {p.Nx, p.Ny, p.Nz}; }

RELIEF_KERNEL CurvePoint curve_point(const DisplacedTriangle& tri, const CurveSegment& g, double tau)
{
  CurvePoint p;
  p.tau = tau;
  const double e0 = quadratic_at(g.e[0], tau), e1 = quadratic_at(g.e[1], tau), e2 = quadratic_at(g.e[2], tau);
  p.W = e0 + e1 + e2;
  const double inverse = 1.0 / p.W;
  const double b0 = e0 * inverse;
  p.b1 = e1 * inverse;
  p.b2 = e2 * inverse;
  p.x = b0 * tri.x[0] + p.b1 * tri.x[1] + p.b2 * tri.x[2];
  p.y = b0 * tri.y[0] + p.b1 * tri.y[1] + p.b2 * tri.y[2];
  const Vec3d N = b0 * to_double(tri.N[0]) + p.b1 * to_double(tri.N[1]) + p.b2 * to_double(tri.N[2]);
  p.Nx = N.x;
  p.Ny = N.y;
  p.Nz = N.z;
  p.s = g.s0 + tau * g.ds;
  p.nu = length(N);
  return p;
}

/// How far a curve can be from the straight line between two of its points, at equal τ.
struct CurveDeviation {
  double x = 0, y = 0;  ///< lattice units
  double height = 0;    ///< of s·|N|, metres
};

/// A rational quadratic minus its linear interpolant over [0, 1] is u(1 − u)(α + βu)/W(u), so a quarter of the larger of
/// |α|, |α + β| over the least W bounds it: exact in b, hence in x, y and N. The length of N along the line is convex and
/// its second derivative below |ΔN|²/|N|; the product with s adds a quarter of |Δs·Δ|N||.
/// @param a, b  the ends, a.tau < b.tau
/// @return      infinite height where the bound breaks down (|N| may vanish in between)
RELIEF_KERNEL CurveDeviation curve_deviation(const DisplacedTriangle& tri,
                                             const CurveSegment& g,
                                             const CurvePoint& a,
                                             const CurvePoint& b)
{
  const double step = b.tau - a.tau;
  const Quadratic W = quadratic_shift(g.W, a.tau, step);
  const double quarter_over_W = 0.25 / quadratic_minimum(W);
  const auto deviation = [&](const Quadratic& e, double from, double to) {
    const Quadratic p = quadratic_shift(e, a.tau, step);
    const double slope = to - from;
    const double alpha = p.b - from * W.b - slope * W.c, beta = slope * W.a;
    return quarter_over_W * max(__builtin_fabs(alpha), __builtin_fabs(alpha + beta));
  };
  const double b1 = deviation(g.e[1], a.b1, b.b1), b2 = deviation(g.e[2], a.b2, b.b2);
  CurveDeviation d;
  d.x = b1 * __builtin_fabs(tri.x[1] - tri.x[0]) + b2 * __builtin_fabs(tri.x[2] - tri.x[0]);
  d.y = b1 * __builtin_fabs(tri.y[1] - tri.y[0]) + b2 * __builtin_fabs(tri.y[2] - tri.y[0]);
  const Vec3d N0 = to_double(tri.N[0]);
  const double N = b1 * length(to_double(tri.N[1]) - N0) + b2 * length(to_double(tri.N[2]) - N0);
  const double turn = length(curve_normal(b) - curve_normal(a));
  const double least = 0.5 * (a.nu + b.nu - turn) - N;
  if (!(least > 0.0)) {
    d.height = __builtin_huge_val();
    return d;
  }
  const double s = max(__builtin_fabs(a.s), __builtin_fabs(b.s));
  d.height = s * (turn * turn / (8.0 * least) + N) + 0.25 * __builtin_fabs((b.s - a.s) * (b.nu - a.nu));
  return d;
}

/// Weights whose error may be larger than this are corrected, see weights_correct.
inline constexpr double kExactWeights = 0x1p-40;

/// Moves a hit by one step of Newton towards S = O + tD. Weights are quotients, which lose digits where their facet is
/// seen almost edge-on or the prism reaches far beyond the triangle; the surface itself does not.
/// @param cell  of corner (i, j), in which the hit is
/// @param hit   its weights and t; left as they are where the step is larger than their error can be (the ray touches the
///              surface there)
RELIEF_KERNEL void weights_correct(const DisplacedMeshView& mesh,
                                   const DisplacedTriangle& tri,
                                   const RayFrame& frame,
                                   const CellHeights& cell,
                                   double largest_step,
                                   DisplacedHit* hit)
{
  const BasePoint base = base_point(tri, hit->b1, hit->b2);
  const double fx = tri.x[0] + hit->b1 * base.xu + hit->b2 * base.xv - static_cast<double>(hit->i);
  const double fy = tri.y[0] + hit->b1 * base.yu + hit->b2 * base.yv - static_cast<double>(hit->j);
  const double d = mesh.scale * (cell.h00 + cell.hx * fx + (cell.hy + cell.hxy * fx) * fy - mesh.midlevel);
  const double dx = mesh.scale * (cell.hx + cell.hxy * fy), dy = mesh.scale * (cell.hy + cell.hxy * fx);
  const double inverse_length = 1.0 / length(base.N);
  const Vec3d n = base.N * inverse_length;
  // The ray's origin is subtracted first: far from the world's origin the point itself has lost digits.
  const Vec3d O{frame.O[0], frame.O[1], frame.O[2]};
  const Vec3d S = (to_double(tri.P[0]) - O) + hit->b1 * base.Pu + hit->b2 * base.Pv + d * n;
  const Vec3d Su = base.Pu + (dx * base.xu + dy * base.yu) * n + (d * inverse_length) * (base.Nu - dot(n, base.Nu) * n);
  const Vec3d Sv = base.Pv + (dx * base.xv + dy * base.yv) * n + (d * inverse_length) * (base.Nv - dot(n, base.Nv) * n);
  const RaySeen s = ray_seen(frame, S), u = ray_seen(frame, Su), v = ray_seen(frame, Sv);
  const double inverse = 1.0 / (u.x * v.y - u.y * v.x);
  const double db1 = (s.y * v.x - s.x * v.y) * inverse, db2 = (s.x * u.y - s.y * u.x) * inverse;
  if (!(__builtin_fabs(db1) + __builtin_fabs(db2) <= largest_step)) return;
  hit->b1 += db1;
  hit->b2 += db2;
  hit->t = s.z + db1 * u.z + db2 * v.z;
}

/// A root must lie this close to its cell (lattice units): more than rounding moves roots of all but grazing rays, far
/// less than a texel.
inline constexpr double kCellTolerance = 1e-9;

/// The root of g between two ends of different sign, by secant steps. An end that stays would keep the other from closing in,
/// so its value is scaled down as Anderson and Björck 1973, "A new high order method of regula falsi type", do: half as many
/// steps as by halving it (the Illinois method).
/// @param noise  values no larger are zeros
/// @param g_at   of a point of the curve
template <class Height>
RELIEF_KERNEL CurvePoint root_between(const DisplacedTriangle& tri,
                                      const CurveSegment& segment,
                                      CurvePoint a,
                                      CurvePoint b,
                                      double ga,
                                      double gb,
                                      double noise,
                                      const Height& g_at)
{
  const bool starts_below = ga < 0.0;
  int stayed = 0;
  for (int k = 0; k < 80 && b.tau - a.tau > 0x1p-51 && ga != 0.0; ++k) {
    double tau = a.tau + (b.tau - a.tau) * (ga / (ga - gb));
    if (!(tau > a.tau && tau < b.tau)) tau = 0.5 * (a.tau + b.tau);
    if (!(tau > a.tau && tau < b.tau)) break;
    const CurvePoint p = curve_point(tri, segment, tau);
    const double gp = g_at(p);
    if (__builtin_fabs(gp) <= noise) return p;
    const bool replaces_a = (gp < 0.0) == starts_below;
    const double left = 1.0 - gp / (replaces_a ? ga : gb), factor = left > 0.0 ? left : 0.5;
    if (replaces_a) {
      a = p;
      ga = gp;
      if (stayed == 1) gb *= factor;
      stayed = 1;
    } else {
      b = p;
      gb = gp;
      if (stayed == 2) ga *= factor;
      stayed = 2;
    }
  }
  return a;
}

/// The bilinear patch that the leaf test is for.
struct LeafPatch {
  CellHeights heights;                  ///< from the corner of its cell
  double magnitude;                     ///< of the terms of a height, beside the midlevel
  double x_low, x_high, y_low, y_high;  ///< where it is the surface, lattice coordinates
};

/// Sum of the terms of a height in a cell, beside the midlevel.
RELIEF_KERNEL double height_magnitude(const CellHeights& cell, double midlevel)
{
  return __builtin_fabs(cell.h00 - midlevel) + __builtin_fabs(cell.hx) + __builtin_fabs(cell.hy) +
         __builtin_fabs(cell.hxy);
}

/// A cell of a lattice, by its lower corner.
struct LatticeCell {
  std::int64_t i, j;
};

/// Where the patch of a cell is the surface: unbounded cells beside a clamped map have one height along the unbounded axis,
/// so their corner may be anywhere.
RELIEF_KERNEL void set_patch_bounds(const HeightFieldView& f, std::int64_t i, std::int64_t j, LeafPatch* patch)
{
  const double corner_x = static_cast<double>(i), corner_y = static_cast<double>(j);
  const bool clamp_x = f.x.wrap == Wrap::kClamp, clamp_y = f.y.wrap == Wrap::kClamp;
  patch->x_low = clamp_x && i < 0 ? -__builtin_huge_val() : corner_x;
  patch->x_high = clamp_x && i >= f.x.num_texels - 1 ? __builtin_huge_val() : corner_x + 1.0;
  patch->y_low = clamp_y && j < 0 ? -__builtin_huge_val() : corner_y;
  patch->y_high = clamp_y && j >= f.y.num_texels - 1 ? __builtin_huge_val() : corner_y + 1.0;
}

RELIEF_KERNEL LeafPatch leaf_patch(const DisplacedMeshView& mesh, LatticeCell cell)
{
  LeafPatch patch;
  patch.heights = cell_heights(*mesh.field, cell.i, cell.j);
  patch.magnitude = height_magnitude(patch.heights, mesh.midlevel);
  set_patch_bounds(*mesh.field, cell.i, cell.j, &patch);
  return patch;
}

/// Displacement at any lattice position of the surface that a cell is of, metres.
RELIEF_KERNEL double leaf_displacement(const DisplacedMeshView& mesh, LatticeCell, double x, double y)
{
  return displacement_at(mesh, x, y);
}

/// First root of g in a cell. Not inlined: its stack is as large as that of a descent.
/// @param place       the cell, or what of it has one patch: LatticeCell, or BlendedCell (level_blend.h)
/// @param tau0, tau1  contains every τ at which the curve is in the cell; 0 <= tau0 <= tau1 <= 1
/// @param monotone    t grows with τ; if not, all roots are looked at
/// @param hit         t, b, cell of the nearest root whose t is within (t_min, t_max)
/// @return            false if there is none
template <class Cell>
[[gnu::noinline]] RELIEF_KERNEL bool leaf_intersect(const DisplacedMeshView& mesh,
                                                    const DisplacedTriangle& tri,
                                                    const RayCurve& curve,
                                                    const CurveSegment& g,
                                                    const Cell place,
                                                    double tau0,
                                                    double tau1,
                                                    double t_min,
                                                    double t_max,
                                                    bool monotone,
                                                    DisplacedHit* hit)
{
  bool found = false;
  const LeafPatch patch = leaf_patch(mesh, place);
  const CellHeights& cell = patch.heights;
  const double corner_x = static_cast<double>(place.i), corner_y = static_cast<double>(place.j);

  const auto height_over = [&](const CurvePoint& p) {
    const double fx = p.x - corner_x, fy = p.y - corner_y;
    const double h = cell.h00 + cell.hx * fx + (cell.hy + cell.hxy * fx) * fy;
    return p.s * p.nu - mesh.scale * (h - mesh.midlevel);
  };
  const auto deviation = [&](const CurvePoint& a, const CurvePoint& b) {
    const CurveDeviation d = curve_deviation(tri, g, a, b);
    const double fx = max(__builtin_fabs(a.x - corner_x), __builtin_fabs(b.x - corner_x));
    const double fy = max(__builtin_fabs(a.y - corner_y), __builtin_fabs(b.y - corner_y));
    const double twist = __builtin_fabs(cell.hxy);
    return d.height + __builtin_fabs(mesh.scale) * (0.25 * twist * __builtin_fabs((b.x - a.x) * (b.y - a.y)) +
                                                    (__builtin_fabs(cell.hx) + twist * fy) * d.x +
                                                    (__builtin_fabs(cell.hy) + twist * fx) * d.y + twist * d.x * d.y);
  };
  // What rounding can do to g at a point of the curve: its terms, and the weights through the slopes. That the curve
  // itself may be off does not count: it reaches over the walls by more than that.
  const double slope =
      __builtin_fabs(mesh.scale) * ((__builtin_fabs(cell.hx) + __builtin_fabs(cell.hxy)) *
                                        (__builtin_fabs(tri.x[1] - tri.x[0]) + __builtin_fabs(tri.x[2] - tri.x[0])) +
                                    (__builtin_fabs(cell.hy) + __builtin_fabs(cell.hxy)) *
                                        (__builtin_fabs(tri.y[1] - tri.y[0]) + __builtin_fabs(tri.y[2] - tri.y[0])));
  const double magnitude = __builtin_fabs(mesh.scale) * patch.magnitude;
  const double rounding = 0x1p-49 * (magnitude + slope);

  // Takes a root; true when no other can be nearer.
  const auto accept = [&](const CurvePoint& p) {
    const double beside = max(max(patch.x_low - p.x, p.x - patch.x_high), max(patch.y_low - p.y, p.y - patch.y_high));
    if (!(beside <= kCellTolerance)) return false;
    // There the surface is the neighbour's, which has a root of its own unless rounding took it.
    if (beside > 0.0 && !(__builtin_fabs(p.s * p.nu - leaf_displacement(mesh, place, p.x, p.y)) <= rounding))
      return false;
    DisplacedHit candidate{curve_t(curve, g, p.tau), p.b1, p.b2, place.i, place.j, p.tau};
    if (g.relative_error > kExactWeights) weights_correct(mesh, tri, curve.frame, cell, g.relative_error, &candidate);
    if (!(candidate.t > t_min && candidate.t < t_max)) return false;
    *hit = candidate;
    t_max = hit->t;
    found = true;
    return monotone;
  };

  struct Interval {
    CurvePoint a, b;
    double ga, gb;
  };
  // Depth-first from the front: a split pushes its far half, so the stack is as deep as the splits, and those end when
  // the deviation, which falls by four with each, drowns in rounding: below 60.
  constexpr int kMaxDepth = 64;
  Interval stack[kMaxDepth];
  int depth = 0;
  stack[0].a = curve_point(tri, g, tau0);
  stack[0].b = curve_point(tri, g, tau1);
  stack[0].ga = height_over(stack[0].a);
  stack[0].gb = height_over(stack[0].b);
  // A root at a wall may be lost between two triangles that round it differently: both take it.
  if (tau0 <= 0.0 && __builtin_fabs(stack[0].ga) <= rounding && accept(stack[0].a)) return true;
  const CurvePoint last = stack[0].b;
  const double g_last = stack[0].gb;
  depth = 1;
  while (depth > 0) {
    const Interval n = stack[--depth];
    const bool crosses = (n.ga < 0.0) != (n.gb < 0.0);
    const double bound = deviation(n.a, n.b);
    const double width = n.b.tau - n.a.tau;
    if (!crosses && min(__builtin_fabs(n.ga), __builtin_fabs(n.gb)) > bound) continue;
    const bool small = !(bound > rounding) || width <= 0x1p-50;
    // Once the bend is a small part of the difference of the ends, g is monotone and has one root.
    if (crosses && (small || 16.0 * bound < __builtin_fabs(n.gb - n.ga))) {
      const double noise = 0x1p-51 * (magnitude + slope);
      if (accept(root_between(tri, g, n.a, n.b, n.ga, n.gb, noise, height_over))) return true;
      continue;
    }
    if (small || depth + 2 > kMaxDepth) {
      // Tangent within rounding: the surface is touched.
      if (__builtin_fabs(n.ga) <= rounding && accept(n.a)) return true;
      continue;
    }
    Interval front = n, back = n;
    const CurvePoint middle = curve_point(tri, g, 0.5 * (n.a.tau + n.b.tau));
    const double gm = height_over(middle);
    front.b = middle;
    front.gb = gm;
    back.a = middle;
    back.ga = gm;
    stack[depth++] = back;
    stack[depth++] = front;
  }
  if (tau1 >= 1.0 && __builtin_fabs(g_last) <= rounding) accept(last);
  return found;
}

}  // namespace relief
