// The closed forms of a ray's projection into the height map, its inversion, and the bounds of the surface in space,
// against many points of the curve and the surface.
#include "displacement/ray_projection.h"

#include <cmath>

#include <gtest/gtest.h>

#include "displacement/bounds3d.h"
#include "displacement/inversion.h"
#include "displacement/leaf.h"
#include "displacement/traverse_rmip.h"
#include "tests/displacement/judge.h"
#include "tests/displacement/random_cases.h"

namespace relief {
namespace {

/// Calls do_segment(triangle view, curve, segment, ray frame, unfolded) for the segments of random rays.
template <class Function>
void for_random_segments(std::uint64_t seed, int num_cases, const Function& do_segment)
{
  for (int k = 0; k < num_cases; ++k) {
    std::mt19937_64 random(seed + static_cast<std::uint64_t>(k));
    const RandomCase drawn = random_case(random, 16);
    const TracedCase traced({drawn.triangle}, drawn.map);
    const DisplacedMeshView mesh = traced.mesh();
    for (const oracle::Ray& ray : drawn.rays) {
      const RayFrame frame =
          ray_frame_make(to_double(TracedCase::vector3(ray.O)), to_double(TracedCase::vector3(ray.D)));
      RayCurve curve;
      if (!ray_curve_make(frame, mesh.triangles[0], &curve)) continue;
      for (int s = 0; s < curve.num_segments; ++s) {
        do_segment(mesh.triangles[0], curve, curve.segments[s], frame, mesh.unfolded[0] != 0);
        if (testing::Test::HasFailure()) FAIL() << "case " << k << " of seed " << seed;
      }
    }
  }
}

/// The range of a segment cut at its turning points.
int stretches_of(const RayProjection& r, double* cuts)
{
  int count = turning_points(r.X, r.W, 0, 1, cuts, 0);
  count = turning_points(r.Y, r.W, 0, 1, cuts, count);
  cuts[count++] = 0;
  cuts[count++] = 1;
  curve_detail::sort_ascending(cuts, count);
  return count - 1;
}

TEST(RayProjection, IsTheCurveWithinItsPad)
{
  for_random_segments(1, 500,
                      [](const DisplacedTriangle& tri, const RayCurve&, const CurveSegment& g, const RayFrame&, bool) {
                        const RayProjection r = ray_projection_make(tri, g);
                        for (int k = 0; k <= 16; ++k) {
                          const double tau = k / 16.0, W = quadratic_at(r.W, tau);
                          const CurvePoint p = curve_point(tri, g, tau);
                          EXPECT_NEAR(r.origin_x + quadratic_at(r.X, tau) / W, p.x, r.pad_x);
                          EXPECT_NEAR(r.origin_y + quadratic_at(r.Y, tau) / W, p.y, r.pad_y);
                        }
                      });
}

TEST(RayProjection, IsMonotoneBetweenTurningPoints)
{
  int num_turns = 0;
  for_random_segments(2, 3000,
                      [&](const DisplacedTriangle& tri, const RayCurve&, const CurveSegment& g, const RayFrame&, bool) {
                        const RayProjection r = ray_projection_make(tri, g);
                        double cuts[6];
                        const int num_stretches = stretches_of(r, cuts);
                        num_turns += num_stretches - 1;
                        for (int k = 0; k < num_stretches; ++k) {
                          ProjectedStretch b;
                          stretch_start(r, cuts[k], &b);
                          stretch_end(r, cuts[k + 1], &b);
                          for (int m = 1; m < 32; ++m) {
                            const double tau = b.tau0 + (b.tau1 - b.tau0) * m / 32, W = quadratic_at(r.W, tau);
                            const double x = quadratic_at(r.X, tau) / W, y = quadratic_at(r.Y, tau) / W;
                            EXPECT_GE(x, min(b.x0, b.x1) - r.pad_x);
                            EXPECT_LE(x, max(b.x0, b.x1) + r.pad_x);
                            EXPECT_GE(y, min(b.y0, b.y1) - r.pad_y);
                            EXPECT_LE(y, max(b.y0, b.y1) + r.pad_y);
                          }
                        }
                      });
  // Something was tested.
  EXPECT_GT(num_turns, 100);
}

TEST(RayProjection, IsSplitInTheMiddleOfTheLongerSide)
{
  for_random_segments(
      3, 500, [](const DisplacedTriangle& tri, const RayCurve&, const CurveSegment& g, const RayFrame&, bool) {
        const RayProjection r = ray_projection_make(tri, g);
        double cuts[6];
        const int num_stretches = stretches_of(r, cuts);
        for (int k = 0; k < num_stretches; ++k) {
          ProjectedStretch b, front, back;
          stretch_start(r, cuts[k], &b);
          stretch_end(r, cuts[k + 1], &b);
          const double width = std::abs(b.x1 - b.x0), height = std::abs(b.y1 - b.y0);
          if (max(width, height) < 1e-6 || !stretch_split(r, b, {b.x0, b.x1, b.y0, b.y1}, &front, &back)) continue;
          EXPECT_EQ(front.tau1, back.tau0);
          if (width >= height) {
            EXPECT_NEAR(front.x1, 0.5 * (b.x0 + b.x1), r.pad_x + 1e-12 * width);
          } else {
            EXPECT_NEAR(front.y1, 0.5 * (b.y0 + b.y1), r.pad_y + 1e-12 * height);
          }
        }
      });
}

TEST(RayProjection, IsSplitInTheMiddleOfWhatIsOverAClampedMap)
{
  const LatticeAxis clamped{64, Wrap::kClamp, 65, -1}, repeated{64, Wrap::kRepeat, 64, 0};
  // A ray from (−1000, 0) to (5000, 20), counted from a vertex at (10, 0).
  const RayProjection r{{0, 6000, -1010}, {0, 20, 0}, {0, 0, 1}, 10, 0, 0, 0};
  ProjectedStretch whole, front, back;
  stretch_start(r, 0, &whole);
  stretch_end(r, 1, &whole);
  const VaryingPart y = varying_part(repeated, r.origin_y);
  const VaryingSides over_map = varying_sides(whole, varying_part(clamped, r.origin_x), y);
  ASSERT_TRUE(stretch_split(r, whole, over_map, &front, &back));
  EXPECT_NEAR(front.x1 + r.origin_x, 31.5, 1e-9);
  EXPECT_EQ(over_map.y1, 20);
  ASSERT_TRUE(stretch_split(r, whole, varying_sides(whole, varying_part(repeated, r.origin_x), y), &front, &back));
  EXPECT_NEAR(front.x1 + r.origin_x, 2000, 1e-9);
}

TEST(RmipTraversal, RectanglesHoldTheirStretchInSpiteOfRounding)
{
  // The same quotients in a longer format; without the pads one position in four would be outside.
  for_random_segments(
      12, 500, [](const DisplacedTriangle& tri, const RayCurve&, const CurveSegment& g, const RayFrame&, bool) {
        const RayProjection r = ray_projection_make(tri, g);
        const auto at = [](const Quadratic& p, long double tau) {
          return (static_cast<long double>(p.a) * tau + static_cast<long double>(p.b)) * tau +
                 static_cast<long double>(p.c);
        };
        double cuts[6];
        const int num_stretches = stretches_of(r, cuts);
        for (int k = 0; k < num_stretches; ++k) {
          ProjectedStretch b;
          stretch_start(r, cuts[k], &b);
          stretch_end(r, cuts[k + 1], &b);
          const CentredRect rect = rmip_detail::rectangle_of(r, b);
          for (const double tau : {cuts[k], cuts[k + 1]}) {
            const long double W = at(r.W, static_cast<long double>(tau));
            const long double x = at(r.X, static_cast<long double>(tau)) / W;
            const long double y = at(r.Y, static_cast<long double>(tau)) / W;
            EXPECT_LE(std::abs(x - static_cast<long double>(rect.x)), static_cast<long double>(rect.rx));
            EXPECT_LE(std::abs(y - static_cast<long double>(rect.y)), static_cast<long double>(rect.ry));
          }
        }
      });
}

TEST(BernsteinCrossing, NeedsNoDiscriminantNorOrder)
{
  std::mt19937_64 random(4);
  for (int k = 0; k < 100000; ++k) {
    // Any middle coefficient, as long as the ends differ in sign.
    const auto magnitude = [&] { return std::pow(10.0, random_between(random, -12, 3)); };
    const double sign = random_index(random, 2) == 0 ? 1 : -1;
    const BernsteinQuadratic p{-sign * magnitude(), random_between(random, -1, 1) * magnitude(), sign * magnitude()};
    const double u = bernstein_crossing(p, {1, 1, 1}, 0), v = 1 - u;
    const double value = p.start * v * v + 2 * p.middle * u * v + p.end * u * u;
    const double terms = std::abs(p.start) * v * v + 2 * std::abs(p.middle) * u * v + std::abs(p.end) * u * u;
    ASSERT_GE(u, 0);
    ASSERT_LE(u, 1);
    // Near u = 1 rounding of 1 − u is an error of its own.
    ASSERT_LE(std::abs(value), 1e-14 * (terms + std::abs(p.middle) + std::abs(p.start))) << p.start << " " << p.middle;
  }
  EXPECT_EQ(bernstein_crossing({0, 0, 0}, {1, 1, 1}, 0), 0);
}

TEST(RayInversion, FindsTheParameterOfAPointOfTheRay)
{
  int num_asked = 0, num_failed = 0;
  std::uint64_t iterations = 0;
  std::mt19937_64 random(5);
  for_random_segments(
      5, 500,
      [&](const DisplacedTriangle&, const RayCurve& curve, const CurveSegment& g, const RayFrame&, bool unfolded) {
        if (!unfolded || !(g.t1 - g.t0 > 1e-6 * std::abs(g.t1))) return;
        const Cubic T = ray_distance_make(curve, g);
        const double tau = random_unit(random), t = curve_t(curve, g, tau);
        EXPECT_NEAR(cubic_at(T, tau) / quadratic_at(g.W, tau), t, 1e-9 * (std::abs(t) + g.t1 - g.t0));
        if (!(t > g.t0 && t < g.t1)) return;
        const double found = ray_invert(T, g.W, {0, 1, g.t0, g.t1}, t, 1e-6, &iterations);
        ++num_asked;
        if (!(found == found)) {
          ++num_failed;
          return;
        }
        EXPECT_NEAR(curve_t(curve, g, found), t, 1e-6 * (g.t1 - g.t0));
      });
  EXPECT_GT(num_asked, 2000);
  // A failure costs time only.
  EXPECT_LE(num_failed, num_asked / 20);
  EXPECT_LE(iterations, static_cast<std::uint64_t>(5 * num_asked));
}

/// Rectangles within a triangle's own, heights within its prism.
template <class Function>
void for_random_bounds(std::uint64_t seed, const Function& do_bounds)
{
  for_random_segments(
      seed, 500, [&](const DisplacedTriangle& tri, const RayCurve&, const CurveSegment&, const RayFrame& frame, bool) {
        const LatticeFrame f = lattice_frame_make(tri, frame);
        if (!f.exists) return;
        std::mt19937_64 random(seed);
        const double b1 = random_unit(random), b2 = random_unit(random) * (1 - b1), size = random_unit(random);
        const CentredRect rect{b1 * (tri.x[1] - tri.x[0]) + b2 * (tri.x[2] - tri.x[0]),
                               b1 * (tri.y[1] - tri.y[0]) + b2 * (tri.y[2] - tri.y[0]),
                               size * std::abs(tri.x[1] - tri.x[0]),
                               size * random_unit(random) * std::abs(tri.y[2] - tri.y[0])};
        do_bounds(tri, f, rect, random);
      });
}

/// Barycentric weights of a lattice position from vertex 0.
oracle::Vector2 weights_at(const DisplacedTriangle& tri, double x, double y)
{
  const double xu = tri.x[1] - tri.x[0], xv = tri.x[2] - tri.x[0], yu = tri.y[1] - tri.y[0], yv = tri.y[2] - tri.y[0];
  const double det = xu * yv - xv * yu;
  return {(x * yv - y * xv) / det, (y * xu - x * yu) / det};
}

TEST(NormalRange, HoldsTheLengthsOfNormalsInTheTriangle)
{
  int num_inside = 0;
  for_random_bounds(6, [&](const DisplacedTriangle& tri, const LatticeFrame& f, const CentredRect& rect, auto& random) {
    const ScalarRange nu = normal_range(f, rect);
    for (int k = 0; k < 8; ++k) {
      const oracle::Vector2 b = weights_at(tri, rect.x + rect.rx * random_between(random, -1, 1),
                                           rect.y + rect.ry * random_between(random, -1, 1));
      if (b[0] < 0 || b[1] < 0 || b[0] + b[1] > 1) continue;
      ++num_inside;
      const double length_N =
          length((1 - b[0] - b[1]) * to_double(tri.N[0]) + b[0] * to_double(tri.N[1]) + b[1] * to_double(tri.N[2]));
      EXPECT_GE(length_N, nu.low - 1e-12);
      EXPECT_LE(length_N, nu.high + 1e-12);
    }
  });
  EXPECT_GT(num_inside, 10000);
}

TEST(SurfaceBounds, AreMetByRaysThroughPointsInside)
{
  int num_rays = 0;
  for_random_bounds(7, [&](const DisplacedTriangle& tri, const LatticeFrame&, const CentredRect& rect, auto& random) {
    const ScalarRange s{tri.s_min + 0.3 * (tri.s_max - tri.s_min), tri.s_min + 0.6 * (tri.s_max - tri.s_min)};
    // Off the bounds' border by far more than the rounding of the ray's direction to floats.
    constexpr double kInside = 0.99;
    const oracle::Vector2 b = weights_at(tri, rect.x + kInside * rect.rx * random_between(random, -1, 1),
                                         rect.y + kInside * rect.ry * random_between(random, -1, 1));
    const double offset = 0.5 * (s.low + s.high) + kInside * 0.5 * (s.high - s.low) * random_between(random, -1, 1);
    const auto at = [&](const Vec3f* v) {
      return (1 - b[0] - b[1]) * to_double(v[0]) + b[0] * to_double(v[1]) + b[1] * to_double(v[2]);
    };
    if (!(rect.rx > 0 && rect.ry > 0 && s.high > s.low)) return;
    const Vec3d X = at(tri.P) + offset * at(tri.N);
    const oracle::Vector3 away = random_direction(random);
    const double distance = length(X - to_double(tri.P[0])) + length(to_double(tri.P[1]) - to_double(tri.P[0]));
    const Vec3f O = to_float(X + Vec3d{away[0], away[1], away[2]} * distance), D = to_float(X - to_double(O));
    const LatticeFrame f = lattice_frame_make(tri, ray_frame_make(to_double(O), to_double(D)));
    const ScalarRange t = surface_bounds_intersect(f, rect, s);
    // The float ray passes the point within 1e-6 of the distance; bounds thinner than that prove nothing.
    const double thickness = (s.high - s.low) * length(at(tri.N));
    if (thickness < 1e-3 * distance ||
        min(rect.rx, rect.ry) < 1e-3 * (std::abs(tri.x[1] - tri.x[0]) + std::abs(tri.y[2] - tri.y[0])))
      return;
    ++num_rays;
    EXPECT_LE(t.low, 1 + 1e-5);
    EXPECT_GE(t.high, 1 - 1e-5);
    EXPECT_LE(t.low, t.high);
  });
  EXPECT_GT(num_rays, 500);
}

TEST(AffineBounds, HoldTheSurface)
{
  int num_points = 0;
  for_random_bounds(8, [&](const DisplacedTriangle& tri, const LatticeFrame&, const CentredRect& rect, auto& random) {
    const LatticeFrame f = lattice_frame_make(tri, ray_frame_make({0, 0, 0}, {0.3, 0.5, 0.8}));
    if (!f.exists) return;
    const double length_N = length(to_double(tri.N[0]));
    const double d0 = tri.s_min * length_N, d1 = tri.s_max * length_N;
    const auto all = [](double x) { return D4{x, x, x, x}; };
    I4 exists;
    const AffineForm inverse = inverse_length_affine(f, all(rect.x), all(rect.y), all(rect.rx), all(rect.ry), &exists);
    if (exists[0] == 0) return;
    D4 low, high;
    displaced_range_affine(CoordinateOver<D4>{f.P0 + rect.x * f.Px + rect.y * f.Py,
                                              f.N0 + rect.x * f.Nx + rect.y * f.Ny, f.Px, f.Py, f.Nx, f.Ny},
                           all(rect.rx), all(rect.ry), inverse, all(0.5 * (d0 + d1)), all(0.5 * (d1 - d0)), &low,
                           &high);
    for (int k = 0; k < 20; ++k) {
      // Corners as well: there the ranges are as wide as they get.
      const auto place = [&] { return k < 8 ? (random() % 2 == 0 ? -1.0 : 1.0) : random_between(random, -1, 1); };
      const oracle::Vector2 b = weights_at(tri, rect.x + rect.rx * place(), rect.y + rect.ry * place());
      const double d = 0.5 * (d0 + d1) + 0.5 * (d1 - d0) * place();
      const auto at = [&](const Vec3f* v) {
        return (1 - b[0] - b[1]) * to_double(v[0]) + b[0] * to_double(v[1]) + b[1] * to_double(v[2]);
      };
      const Vec3d N = at(tri.N), S = at(tri.P) + d / length(N) * N;
      const double S_lanes[3] = {S.x, S.y, S.z};
      for (int axis = 0; axis < 3; ++axis) {
        ++num_points;
        EXPECT_GE(S_lanes[axis], low[axis] - f.pad[axis]);
        EXPECT_LE(S_lanes[axis], high[axis] + f.pad[axis]);
      }
    }
  });
  EXPECT_GT(num_points, 10000);
}

}  // namespace
}  // namespace relief
