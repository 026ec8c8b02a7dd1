// Bounds of the displaced surface over a rectangle of the height map, for one ray.
//
// P and N are affine in lattice coordinates, so for a fixed s a coordinate of P + s·N over a rectangle is its value at the
// centre plus or minus a radius, exactly; and it is affine in s. The hull of the two ends of s is thus the exact range
// over rectangle × [s0, s1], at the cost of the affine arithmetic of the papers and tighter. Four lanes hold the x, y and
// z axes and the base triangle's normal, across which the surface is thin when the box of the axes is not.
//
// T. Thonat et al., "RMIP: Displacement ray-tracing via inversion and oblong bounding", SIGGRAPH Asia 2023, §4.
// T. Thonat et al., "Tessellation-Free Displacement Mapping for Ray Tracing", ACM TOG 40(6), 2021.
#pragma once

#include "displacement/lanes.h"
#include "displacement/lattice_rect.h"
#include "displacement/ray_curve.h"

namespace relief {

/// Range of |N| or of s, closed.
struct ScalarRange {
  double low = 0, high = 0;
};

/// A triangle's P and N in lattice coordinates from vertex 0.
struct LatticeFrame {
  D4 P0, Px, Py;  ///< relative to the ray's origin; lanes x, y, z, base normal
  D4 N0, Nx, Ny;
  D4 pad;                               ///< bound on rounding of a coordinate
  D4 inverse_D;                         ///< of the ray's direction
  double n00, n0x, n0y, nxx, nxy, nyy;  ///< |N|² as a quadratic form
  double nxy_abs;                       ///< nxy of the components' sizes
  double length_Nx, length_Ny;
  double nu_squared_pad;
  double longest;       ///< of the vertex normals
  bool exists = false;  ///< false: lattice coordinates do not tell where a point of the triangle is
};

/// A rectangle by its centre and half its size; lattice units from vertex 0.
struct CentredRect {
  double x = 0, y = 0, rx = 0, ry = 0;
};

RELIEF_KERNEL LatticeFrame lattice_frame_make(const DisplacedTriangle& tri, const RayFrame& ray)
{
  LatticeFrame f;
  const Vec3d N[3] = {to_double(tri.N[0]), to_double(tri.N[1]), to_double(tri.N[2])};
  f.longest = max(length(N[0]), max(length(N[1]), length(N[2])));
  const double xu = tri.x[1] - tri.x[0], xv = tri.x[2] - tri.x[0];
  const double yu = tri.y[1] - tri.y[0], yv = tri.y[2] - tri.y[0];
  const double det = xu * yv - xv * yu;
  const double size_x = __builtin_fabs(xu) + __builtin_fabs(xv), size_y = __builtin_fabs(yu) + __builtin_fabs(yv);
  // Corners of a rectangle lie up to this many triangles outside of a triangle that is a needle in the map; boxes say
  // little there, and their rounding grows.
  constexpr double kSharpestNeedle = 0x1p-10;
  f.exists = __builtin_fabs(det) > kSharpestNeedle * size_x * size_y;
  if (!f.exists) return f;

  const Vec3d O{ray.O[0], ray.O[1], ray.O[2]};
  const Vec3d P0 = to_double(tri.P[0]) - O;
  const Vec3d Pu = to_double(tri.P[1]) - to_double(tri.P[0]), Pv = to_double(tri.P[2]) - to_double(tri.P[0]);
  const Vec3d Nu = N[1] - N[0], Nv = N[2] - N[0];
  const Vec3d n = cross(Pu, Pv);
  const auto lanes = [&](Vec3d v) { return D4{v.x, v.y, v.z, dot(n, v)}; };
  const double inverse = 1.0 / det;
  const auto along_x = [&](Vec3d u, Vec3d v) { return (u * yv - v * yu) * inverse; };
  const auto along_y = [&](Vec3d u, Vec3d v) { return (v * xu - u * xv) * inverse; };
  const Vec3d Nx = along_x(Nu, Nv), Ny = along_y(Nu, Nv);
  f.P0 = lanes(P0);
  f.Px = lanes(along_x(Pu, Pv));
  f.Py = lanes(along_y(Pu, Pv));
  f.N0 = lanes(N[0]);
  f.Nx = lanes(Nx);
  f.Ny = lanes(Ny);
  f.n00 = dot(N[0], N[0]);
  f.n0x = dot(N[0], Nx);
  f.n0y = dot(N[0], Ny);
  f.nxx = dot(Nx, Nx);
  f.nxy = dot(Nx, Ny);
  f.nxy_abs = dot(abs(Nx), abs(Ny));
  f.nyy = dot(Ny, Ny);
  f.length_Nx = __builtin_sqrt(f.nxx);
  f.length_Ny = __builtin_sqrt(f.nyy);
  const double N_size = f.longest + f.length_Nx * size_x + f.length_Ny * size_y;
  f.nu_squared_pad = 0x1p-46 * N_size * N_size;

  double D[3];
  D[ray.kz] = 1.0 / ray.Sz;
  D[ray.kx] = ray.Sx * D[ray.kz];
  D[ray.ky] = ray.Sy * D[ray.kz];
  // What is 0 becomes tiny: far beyond any t, and of either sign.
  const auto inverse_of = [](double d) { return 1.0 / (__builtin_fabs(d) > 1e-280 ? d : 1e-280); };
  f.inverse_D = D4{inverse_of(D[0]), inverse_of(D[1]), inverse_of(D[2]), inverse_of(dot(n, Vec3d{D[0], D[1], D[2]}))};
  const double reach = max(__builtin_fabs(tri.s_min), __builtin_fabs(tri.s_max));
  const double size = length(P0) + length(Pu) + length(Pv) + reach * N_size + length(along_x(Pu, Pv)) * size_x +
                      length(along_y(Pu, Pv)) * size_y;
  const double pad = 0x1p-46 * size;
  // Without a normal its lane must bound nothing, not hold the ray to t = 0 ("corners on a line").
  const double n_length = length(n);
  f.pad = D4{pad, pad, pad, n_length > 0.0 ? pad * n_length : 1.0};
  return f;
}

/// Range of |N| over a rectangle.
///
/// |N| is convex: it is above its tangent plane at the centre; and √(1 + z) ≤ 1 + z/2 bounds it from above.
/// @return  low is 0 if |N| may vanish
RELIEF_KERNEL ScalarRange normal_range(const LatticeFrame& f, const CentredRect& c)
{
  if (!f.exists) return {0.0, f.longest};
  const double along_x = f.n0x + f.nxx * c.x + f.nxy * c.y, along_y = f.n0y + f.nxy * c.x + f.nyy * c.y;
  const double squared = f.n00 + (f.n0x + along_x) * c.x + (f.n0y + along_y) * c.y;
  if (!(squared > 4.0 * f.nu_squared_pad)) return {0.0, f.longest};
  const double nu = __builtin_sqrt(squared), inverse = 1.0 / nu;
  const double slope = (c.rx * __builtin_fabs(along_x) + c.ry * __builtin_fabs(along_y) + f.nu_squared_pad) * inverse;
  const double reach = c.rx * f.length_Nx + c.ry * f.length_Ny;
  // Points of the triangle have no longer normals than its vertices.
  return {max(nu - slope, 0.0), min(nu + slope + 0.5 * reach * reach * inverse, f.longest)};
}

/// Range of s = d/|N|, within the prism's.
RELIEF_KERNEL ScalarRange offset_range(const DisplacedTriangle& tri, ScalarRange d, ScalarRange nu)
{
  ScalarRange s{tri.s_min, tri.s_max};
  const double least = nu.low > 0.0 ? 1.0 / nu.low : __builtin_huge_val(), most = 1.0 / nu.high;
  // An infinite product is cut by the prism; 0·∞ is NaN and does not replace its bound.
  const double low = d.low * (d.low < 0.0 ? least : most), high = d.high * (d.high > 0.0 ? least : most);
  if (low > s.low) s.low = low;
  if (high < s.high) s.high = high;
  return s;
}

/// Where the ray is inside the bounds of the surface over a rectangle.
/// @param s  of the surface there
/// @return   empty (low > high) for a miss
/// @pre      f.exists
RELIEF_KERNEL ScalarRange surface_bounds_intersect(const LatticeFrame& f, const CentredRect& c, ScalarRange s)
{
  const D4 P = f.P0 + c.x * f.Px + c.y * f.Py, N = f.N0 + c.x * f.Nx + c.y * f.Ny;
  const D4 P_low = P + s.low * N, P_high = P + s.high * N;
  const D4 radius_low = c.rx * abs(f.Px + s.low * f.Nx) + c.ry * abs(f.Py + s.low * f.Ny);
  const D4 radius_high = c.rx * abs(f.Px + s.high * f.Nx) + c.ry * abs(f.Py + s.high * f.Ny);
  const D4 low = min(P_low - radius_low, P_high - radius_high) - f.pad;
  const D4 high = max(P_low + radius_low, P_high + radius_high) + f.pad;
  const D4 a = low * f.inverse_D, b = high * f.inverse_D;
  const D4 near_t = min(a, b), far_t = max(a, b);
  return {max(max(near_t[0], near_t[1]), max(near_t[2], near_t[3])),
          min(min(far_t[0], far_t[1]), min(far_t[2], far_t[3]))};
}

/// A quantity over a rectangle and a range of displacements, by affine arithmetic: centre + x·ε₁ + y·ε₂ + d·ε₃ ± rest, each ε
/// anywhere in [−1, 1].
struct AffineForm {
  D4 centre, x, y, d, rest;
};

RELIEF_KERNEL AffineForm operator*(const AffineForm& a, const AffineForm& b)
{
  const auto radius = [](const AffineForm& f) { return abs(f.x) + abs(f.y) + abs(f.d) + f.rest; };
  return {a.centre * b.centre, a.centre * b.x + b.centre * a.x, a.centre * b.y + b.centre * a.y,
          a.centre * b.d + b.centre * a.d, abs(a.centre) * b.rest + abs(b.centre) * a.rest + radius(a) * radius(b)};
}

/// 1/|N| over rectangles, one a lane.
/// @param x, y, rx, ry  as in CentredRect
/// @param exists  gets false in lanes where |N| may vanish; these have no form
/// @source        de Figueiredo and Stolfi 2004, "Affine Arithmetic: Concepts and Applications", §4: products, and the
///                min-range approximation of a convex function
RELIEF_KERNEL AffineForm inverse_length_affine(const LatticeFrame& f, D4 x, D4 y, D4 rx, D4 ry, I4* exists)
{
  const D4 along_x = f.n0x + f.nxx * x + f.nxy * y, along_y = f.n0y + f.nxy * x + f.nyy * y;
  const D4 squared = f.n00 + (f.n0x + along_x) * x + (f.n0y + along_y) * y;
  const D4 by_x = 2.0 * rx * along_x, by_y = 2.0 * ry * along_y;
  const D4 rest = rx * rx * f.nxx + ry * ry * f.nyy + 2.0 * rx * ry * f.nxy_abs + f.nu_squared_pad;
  const D4 radius = abs(by_x) + abs(by_y) + rest;
  *exists = squared - radius > 4.0 * f.nu_squared_pad;
  const D4 low = *exists ? squared - radius : D4{1, 1, 1, 1}, high = *exists ? squared + radius : D4{1, 1, 1, 1};
  const D4 at_low = 1.0 / sqrt(low), at_high = 1.0 / sqrt(high);
  const D4 slope = -0.5 * at_high / high;  // the least in size: what is left over falls all the way
  const D4 left_low = at_low - slope * low, left_high = at_high - slope * high;
  const D4 zero{};
  return {slope * squared + 0.5 * (left_low + left_high), slope * by_x, slope * by_y, zero,
          0.5 * (left_low - left_high) - slope * rest};
}

/// One coordinate of P and N over rectangles: at their centres, and along the lattice.
template <class Along>
struct CoordinateOver {
  D4 P, N;
  Along Px, Py, Nx, Ny;
};

/// Ranges of coordinates of the displaced surface over rectangles, by affine arithmetic; lanes are rectangles or axes.
/// @param inverse      see inverse_length_affine
/// @param d, d_radius  displacements, metres: their middle, and how far they reach from it
/// @param low, high    get the ranges, without what rounding may add: LatticeFrame::pad
template <class Along>
RELIEF_KERNEL void displaced_range_affine(const CoordinateOver<Along>& over,
                                          D4 rx,
                                          D4 ry,
                                          const AffineForm& inverse,
                                          D4 d,
                                          D4 d_radius,
                                          D4* low,
                                          D4* high)
{
  const D4 zero{};
  const AffineForm n = AffineForm{over.N, rx * over.Nx, ry * over.Ny, zero, zero} * inverse;
  const AffineForm moved = n * AffineForm{d, zero, zero, d_radius, zero};
  const D4 radius = abs(rx * over.Px + moved.x) + abs(ry * over.Py + moved.y) + abs(moved.d) + moved.rest;
  const D4 centre = over.P + moved.centre;
  *low = centre - radius;
  *high = centre + radius;
}

/// As surface_bounds_intersect, by the box of object space that affine arithmetic finds.
/// @param d  displacements over the rectangle
/// @param s  of the surface there: for where |N| may vanish
RELIEF_KERNEL ScalarRange affine_bounds_intersect(const LatticeFrame& f,
                                                  const CentredRect& c,
                                                  ScalarRange d,
                                                  ScalarRange s)
{
  const auto all = [](double x) { return D4{x, x, x, x}; };
  const D4 rx = all(c.rx), ry = all(c.ry);
  I4 exists;
  const AffineForm inverse = inverse_length_affine(f, all(c.x), all(c.y), rx, ry, &exists);
  if (exists[0] == 0) return surface_bounds_intersect(f, c, s);
  D4 low, high;
  const CoordinateOver<D4> over{f.P0 + c.x * f.Px + c.y * f.Py, f.N0 + c.x * f.Nx + c.y * f.Ny, f.Px, f.Py, f.Nx, f.Ny};
  displaced_range_affine(over, rx, ry, inverse, all(0.5 * (d.low + d.high)), all(0.5 * (d.high - d.low)), &low, &high);
  const D4 a = (low - f.pad) * f.inverse_D, b = (high + f.pad) * f.inverse_D;
  const D4 near_t = min(a, b), far_t = max(a, b);
  return {max(max(near_t[0], near_t[1]), near_t[2]), min(min(far_t[0], far_t[1]), far_t[2])};
}

}  // namespace relief
