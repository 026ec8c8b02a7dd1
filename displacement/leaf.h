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

/// A search for where a ray meets one displaced triangle, under way. Methods add what is theirs.
struct PrismSearch {
  const DisplacedMeshView& mesh;
  const DisplacedTriangle& tri;
  const RayCurve& curve;
  TraversalCounters& counters;
  DisplacedHit& hit;       ///< the nearest so far
  double t_min, t_max;     ///< t_max shrinks with every hit
  bool unfolded, any_hit;  ///< unfolded: t grows along the curve
  bool found = false;
  std::uint64_t next_poll;
};

/// A point of the curve. Without initial values: the leaf has room for many, and uses few.
struct CurvePoint {
  double tau;
  double b1, b2, W;
  double x, y;  ///< lattice coordinates
  double Nx, Ny, Nz;
  double s, nu;  ///< nu = |N|
};

RELIEF_KERNEL Vec3d curve_normal(const CurvePoint& p) { return {p.Nx, p.Ny, p.Nz}; }

/// Σ b_k·v_k
RELIEF_KERNEL double weighted_sum(double b0, double b1, double b2, double v0, double v1, double v2)
{
  return fused(b2, v2, fused(b1, v1, b0 * v0));
}

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
  const Vec3f* N = tri.N;
  p.x = weighted_sum(b0, p.b1, p.b2, tri.x[0], tri.x[1], tri.x[2]);
  p.y = weighted_sum(b0, p.b1, p.b2, tri.y[0], tri.y[1], tri.y[2]);
  p.Nx = weighted_sum(b0, p.b1, p.b2, static_cast<double>(N[0].x), static_cast<double>(N[1].x),
                      static_cast<double>(N[2].x));
  p.Ny = weighted_sum(b0, p.b1, p.b2, static_cast<double>(N[0].y), static_cast<double>(N[1].y),
                      static_cast<double>(N[2].y));
  p.Nz = weighted_sum(b0, p.b1, p.b2, static_cast<double>(N[0].z), static_cast<double>(N[1].z),
                      static_cast<double>(N[2].z));
  p.s = fused(tau, g.ds, g.s0);
  p.nu = __builtin_sqrt(fused(p.Nz, p.Nz, fused(p.Ny, p.Ny, p.Nx * p.Nx)));
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

/// A bracket of a root: τ at its ends, where g has different signs.
struct RootBracket {
  double a, b, ga, gb;
};

/// The root of g in a bracket: a step of Newton from a guess, then secant steps. An end that stays would keep the other from
/// closing in, so its value is scaled down as Anderson and Björck 1973, "A new high order method of regula falsi type", do:
/// half as many steps as by halving it (the Illinois method).
/// @param guess  τ; anything outside of the bracket stands for the secant
/// @param slope  of g there, about
/// @param noise  values no larger are zeros
/// @param g_at   of a point of the curve
template <class Height>
RELIEF_KERNEL CurvePoint root_between(const DisplacedTriangle& tri,
                                      const CurveSegment& segment,
                                      RootBracket n,
                                      double guess,
                                      double slope,
                                      double noise,
                                      const Height& g_at)
{
  const bool starts_below = n.ga < 0.0;
  int stayed = 0;
  double tau = guess;
  for (int k = 0; k < 80 && n.b - n.a > 0x1p-51 && n.ga != 0.0; ++k) {
    if (!(tau > n.a && tau < n.b)) tau = n.a + (n.b - n.a) * (n.ga / (n.ga - n.gb));
    if (!(tau > n.a && tau < n.b)) tau = 0.5 * (n.a + n.b);
    if (!(tau > n.a && tau < n.b)) break;
    const CurvePoint p = curve_point(tri, segment, tau);
    const double gp = g_at(p);
    if (__builtin_fabs(gp) <= noise) return p;
    const bool replaces_a = (gp < 0.0) == starts_below;
    const double left = 1.0 - gp / (replaces_a ? n.ga : n.gb), factor = left > 0.0 ? left : 0.5;
    if (replaces_a) {
      n.a = tau;
      n.ga = gp;
      if (stayed == 1) n.gb *= factor;
      stayed = 1;
    } else {
      n.b = tau;
      n.gb = gp;
      if (stayed == 2) n.ga *= factor;
      stayed = 2;
    }
    tau = k == 0 ? tau - gp / slope : n.a;
  }
  return curve_point(tri, segment, n.a);
}

/// Values of g at τ0, τ0 + w/3, τ0 + 2w/3 and τ0 + w; τ0 + k·w/3 at sample k.
struct CurveSamples {
  double tau0, width;
  D4 g;
};

/// The root of the cubic through four samples between the two of them that differ in sign.
/// @param slope  of the cubic there
/// @return       τ, about
RELIEF_KERNEL double cubic_root(const CurveSamples& n, double* slope)
{
  const double f0 = n.g[0], f1 = n.g[1], f2 = n.g[2], f3 = n.g[3];
  const bool below = f0 < 0.0;
  const int k = (f1 < 0.0) != below ? 0 : ((f2 < 0.0) != below ? 1 : 2);
  const double from = n.g[k], to = n.g[k + 1];
  double v = static_cast<double>(k) + from / (from - to);
  // Newton's form of the polynomial, in powers of v.
  const double d1 = f1 - f0, d2 = 0.5 * (f2 - 2.0 * f1 + f0), d3 = (f3 - f0 - 3.0 * (f2 - f1)) * (1.0 / 6.0);
  const double c2 = d2 - 3.0 * d3, c1 = d1 - d2 + 2.0 * d3;
  double derivative = 0;
  for (int step = 0; step < 2; ++step) {
    derivative = fused(fused(3.0 * d3, v, 2.0 * c2), v, c1);
    v -= fused(fused(fused(d3, v, c2), v, c1), v, f0) / derivative;
  }
  *slope = derivative * 3.0 / n.width;
  return fused(v, n.width * (1.0 / 3.0), n.tau0);
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

/// A patch under a segment of the curve.
struct PatchBelow {
  const DisplacedMeshView& mesh;
  const DisplacedTriangle& tri;
  const CurveSegment& g;
  LeafPatch patch;
  double corner_x, corner_y;  ///< of its cell, lattice coordinates
};

/// g at a point of the curve, metres.
RELIEF_KERNEL double height_over(const PatchBelow& below, const CurvePoint& p)
{
  const CellHeights& cell = below.patch.heights;
  const double fx = p.x - below.corner_x, fy = p.y - below.corner_y;
  const double h = fused(fused(cell.hxy, fx, cell.hy), fy, fused(cell.hx, fx, cell.h00));
  return fused(p.s, p.nu, -below.mesh.scale * (h - below.mesh.midlevel));
}

/// Bound on how far g can be from the straight line between its values at two points, see curve_deviation; metres.
RELIEF_KERNEL double height_over_deviation(const PatchBelow& below, const CurvePoint& a, const CurvePoint& b)
{
  const CellHeights& cell = below.patch.heights;
  const CurveDeviation d = curve_deviation(below.tri, below.g, a, b);
  const double fx = max(__builtin_fabs(a.x - below.corner_x), __builtin_fabs(b.x - below.corner_x));
  const double fy = max(__builtin_fabs(a.y - below.corner_y), __builtin_fabs(b.y - below.corner_y));
  const double twist = __builtin_fabs(cell.hxy);
  return d.height +
         __builtin_fabs(below.mesh.scale) *
             (0.25 * twist * __builtin_fabs((b.x - a.x) * (b.y - a.y)) + (__builtin_fabs(cell.hx) + twist * fy) * d.x +
              (__builtin_fabs(cell.hy) + twist * fx) * d.y + twist * d.x * d.y);
}

/// The terms of g at a point of the curve, and the weights through the slopes, added: what its rounding is in proportion to. That the
/// curve itself may be off does not count: it reaches over the walls by more than that.
RELIEF_KERNEL double height_over_magnitude(const PatchBelow& below)
{
  const CellHeights& cell = below.patch.heights;
  const DisplacedTriangle& tri = below.tri;
  const double scale = __builtin_fabs(below.mesh.scale);
  const double slope = scale * ((__builtin_fabs(cell.hx) + __builtin_fabs(cell.hxy)) *
                                    (__builtin_fabs(tri.x[1] - tri.x[0]) + __builtin_fabs(tri.x[2] - tri.x[0])) +
                                (__builtin_fabs(cell.hy) + __builtin_fabs(cell.hxy)) *
                                    (__builtin_fabs(tri.y[1] - tri.y[0]) + __builtin_fabs(tri.y[2] - tri.y[0])));
  return scale * below.patch.magnitude + slope;
}

/// g at four points of a part of the curve side by side; a and b become the first and the last.
RELIEF_KERNEL CurveSamples curve_samples(const PatchBelow& below, const CurveRange& range, CurvePoint* a, CurvePoint* b)
{
  const DisplacedTriangle& tri = below.tri;
  const CurveSegment& g = below.g;
  const CellHeights& cell = below.patch.heights;
  const auto splat = [](double x) { return D4{x, x, x, x}; };
  const double tau0 = range.tau0, width = range.tau1 - tau0;
  const D4 tau{tau0, fused(width, 1.0 / 3.0, tau0), fused(width, 2.0 / 3.0, tau0), range.tau1};
  const auto at = [&](const Quadratic& p) { return fused(fused(splat(p.a), tau, splat(p.b)), tau, splat(p.c)); };
  const D4 e0 = at(g.e[0]), e1 = at(g.e[1]), e2 = at(g.e[2]);
  const D4 W = e0 + e1 + e2, inverse = 1.0 / W;
  const D4 b0 = e0 * inverse, b1 = e1 * inverse, b2 = e2 * inverse;
  const auto sum = [&](double v0, double v1, double v2) { return fused(b2, splat(v2), fused(b1, splat(v1), b0 * v0)); };
  const auto of = [&](float v0, float v1, float v2) {
    return sum(static_cast<double>(v0), static_cast<double>(v1), static_cast<double>(v2));
  };
  const Vec3f* N = tri.N;
  const D4 x = sum(tri.x[0], tri.x[1], tri.x[2]), y = sum(tri.y[0], tri.y[1], tri.y[2]);
  const D4 Nx = of(N[0].x, N[1].x, N[2].x), Ny = of(N[0].y, N[1].y, N[2].y), Nz = of(N[0].z, N[1].z, N[2].z);
  const D4 s = fused(tau, splat(g.ds), splat(g.s0));
  const D4 nu = sqrt(fused(Nz, Nz, fused(Ny, Ny, Nx * Nx)));
  const D4 fx = x - below.corner_x, fy = y - below.corner_y;
  const D4 h = fused(fused(splat(cell.hxy), fx, splat(cell.hy)), fy, fused(splat(cell.hx), fx, splat(cell.h00)));
  const auto point = [&](int k) {
    return CurvePoint{tau[k], b1[k], b2[k], W[k], x[k], y[k], Nx[k], Ny[k], Nz[k], s[k], nu[k]};
  };
  *a = point(0);
  *b = point(3);
  return {tau0, width, fused(s, nu, -below.mesh.scale * (h - below.mesh.midlevel))};
}

/// First root of g in a cell; keeps the nearest hit. Not inlined: its stack is as large as that of a descent.
/// @param place  the cell, or what of it has one patch: LatticeCell, or BlendedCell (level_blend.h)
/// @param range  contains every τ at which the curve is in the cell; within [0, 1]
/// @return       whether there is a root whose t is within (t_min, t_max); in folded prisms all are looked at
template <class Cell>
[[gnu::noinline]] RELIEF_KERNEL bool leaf_intersect(PrismSearch& c,
                                                    const CurveSegment& g,
                                                    const Cell place,
                                                    const CurveRange range)
{
  bool found = false;
  const PatchBelow below{
      c.mesh, c.tri, g, leaf_patch(c.mesh, place), static_cast<double>(place.i), static_cast<double>(place.j)};
  const LeafPatch& patch = below.patch;
  // What rounding can do to g at a point of the curve.
  const double magnitude = height_over_magnitude(below), rounding = 0x1p-49 * magnitude;

  // Takes a root; true when no other can be nearer.
  const auto accept = [&](const CurvePoint& p) {
    const double beside = max(max(patch.x_low - p.x, p.x - patch.x_high), max(patch.y_low - p.y, p.y - patch.y_high));
    if (!(beside <= kCellTolerance)) return false;
    // There the surface is the neighbour's, which has a root of its own unless rounding took it.
    if (beside > 0.0 && !(__builtin_fabs(p.s * p.nu - leaf_displacement(c.mesh, place, p.x, p.y)) <= rounding))
      return false;
    DisplacedHit candidate{curve_t(c.curve, g, p.tau), p.b1, p.b2, place.i, place.j, p.tau};
    if (g.relative_error > kExactWeights) {
      weights_correct(c.mesh, c.tri, c.curve.frame, patch.heights, g.relative_error, &candidate);
    }
    if (!(candidate.t > c.t_min && candidate.t < c.t_max)) return false;
    c.hit = candidate;
    c.t_max = candidate.t;
    found = true;
    return c.unfolded;
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
  const CurveSamples samples = curve_samples(below, range, &stack[0].a, &stack[0].b);
  stack[0].ga = samples.g[0];
  stack[0].gb = samples.g[3];
  // A root at a wall may be lost between two triangles that round it differently: both take it.
  if (range.tau0 <= 0.0 && __builtin_fabs(stack[0].ga) <= rounding && accept(stack[0].a)) return true;
  const CurvePoint last = stack[0].b;
  const double g_last = stack[0].gb;
  depth = 1;
  while (depth > 0) {
    const Interval n = stack[--depth];
    const bool is_whole = n.a.tau == range.tau0 && n.b.tau == range.tau1;
    const bool crosses = (n.ga < 0.0) != (n.gb < 0.0);
    const double bound = height_over_deviation(below, n.a, n.b);
    const double width = n.b.tau - n.a.tau;
    if (!crosses && min(__builtin_fabs(n.ga), __builtin_fabs(n.gb)) > bound) continue;
    const bool small = !(bound > rounding) || width <= 0x1p-50;
    // Once the bend is a small part of the difference of the ends, g is monotone and has one root.
    if (crosses && (small || 16.0 * bound < __builtin_fabs(n.gb - n.ga))) {
      const double noise = 0x1p-51 * magnitude;
      const RootBracket bracket{n.a.tau, n.b.tau, n.ga, n.gb};
      double slope_at_guess = (n.gb - n.ga) / width;
      const double guess = is_whole ? cubic_root(samples, &slope_at_guess) : n.a.tau;
      const auto g_at = [&](const CurvePoint& p) { return height_over(below, p); };
      if (accept(root_between(c.tri, g, bracket, guess, slope_at_guess, noise, g_at))) return true;
      continue;
    }
    if (small || depth + 2 > kMaxDepth) {
      // Tangent within rounding: the surface is touched.
      if (__builtin_fabs(n.ga) <= rounding && accept(n.a)) return true;
      continue;
    }
    Interval front = n, back = n;
    const CurvePoint middle = curve_point(c.tri, g, 0.5 * (n.a.tau + n.b.tau));
    const double gm = height_over(below, middle);
    front.b = middle;
    front.gb = gm;
    back.a = middle;
    back.ga = gm;
    stack[depth++] = back;
    stack[depth++] = front;
  }
  if (range.tau1 >= 1.0 && __builtin_fabs(g_last) <= rounding) accept(last);
  return found;
}

}  // namespace relief
