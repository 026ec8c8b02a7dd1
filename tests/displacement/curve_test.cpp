// A ray's curve through a displaced triangle's prism: its points are on the ray, it passes all hits, and what it can
// deviate from a chord is bounded.
#include "displacement/ray_curve.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iostream>
#include <random>
#include <string>
#include <vector>

#include "displacement/leaf.h"
#include "tests/displacement/hard_cases.h"
#include "tests/displacement/judge.h"
#include "tests/displacement/random_cases.h"

namespace relief {
namespace {

using oracle::Ray;
using oracle::Vector2;
using oracle::Vector3;

struct CurveProblem {
  RandomCase drawn;
  TracedCase traced;
  explicit CurveProblem(std::uint64_t number) : drawn(make(number)), traced({drawn.triangle}, drawn.map) {}

  const DisplacedTriangle& triangle() const { return traced.mesh().triangles[0]; }
  bool curve(const Ray& ray, RayCurve* out) const
  {
    return ray_curve_make(ray_frame_make(to_double(TracedCase::vector3(ray.O)), to_double(TracedCase::vector3(ray.D))),
                          triangle(), out);
  }

 private:
  static RandomCase make(std::uint64_t number)
  {
    std::mt19937_64 random(number);
    RandomCase drawn = random_case(random, 40);
    // Some prisms fold, and have several segments.
    if (number % 4 == 0) drawn.map.scale = float_rounded(64 * drawn.map.scale);
    return drawn;
  }
};

/// P + sN at a point of the curve, relative to the ray's origin.
Vector3 prism_position(const oracle::DisplacedTriangle& t, const CurvePoint& p, const Vector3& O)
{
  Vector3 X{};
  const double weights[3] = {1 - p.b1 - p.b2, p.b1, p.b2};
  for (std::size_t k = 0; k < 3; ++k) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      X[axis] += weights[k] * ((t.P[k][axis] - O[axis]) + p.s * t.N[k][axis]);
    }
  }
  return X;
}

TEST(RayCurve, LiesOnTheRay)
{
  ErrorHistogram errors;
  for (std::uint64_t number = 0; number < 1500; ++number) {
    const CurveProblem problem(number);
    for (const Ray& ray : problem.drawn.rays) {
      RayCurve curve;
      if (!problem.curve(ray, &curve)) continue;
      double reach = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        const double s = std::max(std::abs(problem.triangle().s_min), std::abs(problem.triangle().s_max));
        reach = std::max(reach, vector_length(combination(1, problem.drawn.triangle.P[k], -1, ray.O)) +
                                    s * vector_length(problem.drawn.triangle.N[k]));
      }
      for (int k = 0; k < curve.num_segments; ++k) {
        const CurveSegment& g = curve.segments[k];
        for (int step = 0; step <= 8; ++step) {
          const CurvePoint p = curve_point(problem.triangle(), g, step / 8.);
          const Vector3 X = prism_position(problem.drawn.triangle, p, ray.O);
          const double error = vector_length(combination(1, X, -curve_t(curve, g, p.tau), ray.D)) / reach;
          errors.add(error);
          // The weights' own bound, and some roundings.
          ASSERT_LE(error, g.relative_error + 0x1p-45) << "case " << number << " segment " << k << " tau " << p.tau;
        }
      }
    }
  }
  EXPECT_GE(errors.total(), 300000u);
  EXPECT_LE(errors.quantile(.5), 0x1p-48);
  std::cout << "[ figures  ] distance from the ray over reach: median below " << errors.quantile(.5)
            << ", 99.9 % below " << errors.quantile(.999) << ", largest " << errors.largest() << "\n";
}

TEST(RayCurve, HasSegmentsInOrderThatStayInThePrism)
{
  std::uint64_t num_segments = 0, num_several = 0;
  for (std::uint64_t number = 0; number < 1500; ++number) {
    const CurveProblem problem(number);
    for (const Ray& ray : problem.drawn.rays) {
      RayCurve curve;
      if (!problem.curve(ray, &curve)) continue;
      num_segments += static_cast<std::uint64_t>(curve.num_segments);
      num_several += curve.num_segments > 1 ? 1 : 0;
      for (int k = 0; k < curve.num_segments; ++k) {
        const CurveSegment& g = curve.segments[k];
        EXPECT_LE(g.t0, g.t1);
        EXPECT_GT(g.W_min, 0);
        if (k > 0) {
          EXPECT_LE(curve.segments[k - 1].t0, g.t0);
        }
        for (int step = 0; step <= 8; ++step) {
          const CurvePoint p = curve_point(problem.triangle(), g, step / 8.);
          const double outside = std::max({-p.b1, -p.b2, p.b1 + p.b2 - 1});
          ASSERT_LE(outside, 2 * g.relative_error + 0x1p-40) << "case " << number << " segment " << k;
          ASSERT_GE(p.W, .999 * g.W_min);
        }
      }
    }
  }
  std::cout << "[ figures  ] " << num_segments << " segments, " << num_several << " curves of several\n";
  EXPECT_GE(num_segments, 30000u);
  EXPECT_GE(num_several, 50u);
}

TEST(RayCurve, PassesEveryHitOfTheOracle)
{
  std::uint64_t num_hits = 0;
  for (std::uint64_t number = 0; number < 1500; ++number) {
    const CurveProblem problem(number);
    const oracle::Surface surface(problem.drawn.triangle, problem.drawn.map);
    for (const Ray& ray : problem.drawn.rays) {
      RayCurve curve;
      problem.curve(ray, &curve);
      for (const oracle::Hit& root : surface.intersect_all(ray)) {
        if (!root.certain) continue;
        ++num_hits;
        // The weights that the oracle found are on one of the segments: nearest point by halving around the best of many.
        double nearest = HUGE_VAL;
        for (int k = 0; k < curve.num_segments && nearest > 1e-7; ++k) {
          const CurveSegment& g = curve.segments[k];
          const auto distance = [&](double tau) {
            const CurvePoint p = curve_point(problem.triangle(), g, std::clamp(tau, 0., 1.));
            return std::hypot(p.b1 - root.b[0], p.b2 - root.b[1]);
          };
          constexpr int kSteps = 256;
          double best = 0;
          for (int step = 0; step <= kSteps; ++step) {
            if (distance(1. / kSteps * step) < distance(best)) best = 1. / kSteps * step;
          }
          double size = 1. / kSteps;
          while (size > 1e-15) {
            if (distance(best - size) < distance(best)) best = std::max(0., best - size);
            if (distance(best + size) < distance(best)) best = std::min(1., best + size);
            size *= .75;
          }
          nearest = std::min(nearest, distance(best));
        }
        ASSERT_LE(nearest, 1e-7) << "case " << number << " t " << root.t;
      }
    }
  }
  EXPECT_GE(num_hits, 10000u);
}

TEST(CurveDeviation, IsABoundForDenseSamples)
{
  std::uint64_t num_pieces = 0;
  double tightest = 0, sum = 0;
  for (std::uint64_t number = 0; number < 400; ++number) {
    const CurveProblem problem(number);
    const DisplacedTriangle& tri = problem.triangle();
    std::mt19937_64 random(number);
    const double extent_x = std::abs(tri.x[1] - tri.x[0]) + std::abs(tri.x[2] - tri.x[0]);
    const double extent_y = std::abs(tri.y[1] - tri.y[0]) + std::abs(tri.y[2] - tri.y[0]);
    for (const Ray& ray : problem.drawn.rays) {
      RayCurve curve;
      if (!problem.curve(ray, &curve)) continue;
      for (int k = 0; k < curve.num_segments; ++k) {
        const CurveSegment& g = curve.segments[k];
        double tau0 = random_unit(random), tau1 = random_unit(random);
        if (number % 2 == 0) {
          tau0 = 0;
          tau1 = 1;
        }
        if (tau0 >= tau1) continue;
        const CurvePoint a = curve_point(tri, g, tau0), b = curve_point(tri, g, tau1);
        const CurveDeviation bound = curve_deviation(tri, g, a, b);
        double off_x = 0, off_y = 0, off_height = 0;
        for (int step = 0; step <= 64; ++step) {
          const double u = step / 64.;
          const CurvePoint p = curve_point(tri, g, tau0 + u * (tau1 - tau0));
          off_x = std::max(off_x, std::abs(p.x - ((1 - u) * a.x + u * b.x)));
          off_y = std::max(off_y, std::abs(p.y - ((1 - u) * a.y + u * b.y)));
          off_height = std::max(off_height, std::abs(p.s * p.nu - ((1 - u) * a.s * a.nu + u * b.s * b.nu)));
        }
        const double rounding = 0x1p-46 * (1 + g.relative_error * 0x1p48),
                     largest_s = std::max(std::abs(a.s), std::abs(b.s));
        ASSERT_LE(off_x, bound.x + rounding * (extent_x + 1)) << "case " << number;
        ASSERT_LE(off_y, bound.y + rounding * (extent_y + 1)) << "case " << number;
        ASSERT_LE(off_height, bound.height + rounding * largest_s * (a.nu + b.nu)) << "case " << number;
        ++num_pieces;
        const double part = bound.height > 1e-9 * largest_s && bound.height < HUGE_VAL ? off_height / bound.height : 0;
        tightest = std::max(tightest, part);
        sum += part;
      }
    }
  }
  std::cout << "[ figures  ] " << num_pieces << " pieces; deviation of the height over its bound: mean "
            << sum / static_cast<double>(num_pieces) << ", largest " << tightest << "\n";
  EXPECT_GE(num_pieces, 5000u);
  // A bound that is never nearly met would be too wide to be of use.
  EXPECT_GE(tightest, .3);
}

}  // namespace
}  // namespace relief
