// Points of an aperture against the polygon that it is, by areas and moments in double precision.
#include "kernel/camera/aperture.h"

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/chi2.h"

namespace relief {
namespace {

using Point = std::array<double, 2>;

Camera camera_with(int blades, float rotation, float ratio)
{
  Camera camera;
  camera.aperture_blades = blades;
  camera.aperture_rotation = rotation;
  camera.aperture_ratio = ratio;
  return camera;
}

/// Corners of the opening, counter-clockwise.
std::vector<Point> corners_of(const Camera& camera)
{
  std::vector<Point> corners;
  for (int k = 0; k < camera.aperture_blades; ++k) {
    const double angle =
        static_cast<double>(camera.aperture_rotation) + std::numbers::pi * (2 * k + 1) / camera.aperture_blades;
    corners.push_back({std::cos(angle) / static_cast<double>(camera.aperture_ratio), std::sin(angle)});
  }
  return corners;
}

double cross(Point a, Point b) { return a[0] * b[1] - a[1] * b[0]; }

double area_of(const std::vector<Point>& polygon)
{
  double twice = 0;
  for (std::size_t k = 0; k < polygon.size(); ++k) twice += cross(polygon[k], polygon[(k + 1) % polygon.size()]);
  return twice / 2;
}

/// What of a polygon is inside of a convex one (Sutherland and Hodgman).
std::vector<Point> clipped(std::vector<Point> polygon, const std::vector<Point>& by)
{
  for (std::size_t k = 0; k < by.size(); ++k) {
    const Point a = by[k], b = by[(k + 1) % by.size()];
    const auto side = [&](Point p) { return cross({b[0] - a[0], b[1] - a[1]}, {p[0] - a[0], p[1] - a[1]}); };
    std::vector<Point> out;
    for (std::size_t i = 0; i < polygon.size(); ++i) {
      const Point p = polygon[i], q = polygon[(i + 1) % polygon.size()];
      const double dp = side(p), dq = side(q);
      if (dp >= 0) out.push_back(p);
      if ((dp < 0) != (dq < 0)) {
        const double t = dp / (dp - dq);
        out.push_back({p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])});
      }
    }
    polygon = out;
  }
  return polygon;
}

/// χ² of points in the cells of a grid over the opening's box, against the area that each cell has of the opening.
double p_value_of(const Camera& camera, std::uint64_t seed)
{
  constexpr int kCells = 16, kSamples = 400000;
  const double half_width = 1.0 / static_cast<double>(camera.aperture_ratio);
  const std::vector<Point> corners = corners_of(camera);
  std::vector<double> counts(kCells * kCells);
  TestRandom random(seed);
  for (int n = 0; n < kSamples; ++n) {
    const Vec2f u{random.next(), random.next()};
    const Vec2f p = aperture_sample(camera, u);
    const auto cell = [](double at) { return std::clamp(static_cast<int>((at + 1) / 2 * kCells), 0, kCells - 1); };
    ++counts[static_cast<std::size_t>(cell(static_cast<double>(p.y)) * kCells +
                                      cell(static_cast<double>(p.x) / half_width))];
  }
  const double whole = area_of(corners);
  double statistic = 0, rest_expected = 0, rest_count = 0;
  int terms = 0;
  for (int row = 0; row < kCells; ++row) {
    for (int column = 0; column < kCells; ++column) {
      const auto x = [&](int k) { return (2.0 * k / kCells - 1) * half_width; };
      const auto y = [&](int k) { return 2.0 * k / kCells - 1; };
      const std::vector<Point> cell = {
          {x(column), y(row)}, {x(column + 1), y(row)}, {x(column + 1), y(row + 1)}, {x(column), y(row + 1)}};
      const double expected = kSamples * area_of(clipped(cell, corners)) / whole;
      const double count = counts[static_cast<std::size_t>(row * kCells + column)];
      // Cells that expect fewer than five points are taken together.
      if (expected < 5) {
        rest_expected += expected;
        rest_count += count;
        continue;
      }
      statistic += (count - expected) * (count - expected) / expected;
      ++terms;
    }
  }
  if (rest_expected < 1e-3) {
    if (rest_count > 0) return 0;
  } else {
    statistic += (rest_count - rest_expected) * (rest_count - rest_expected) / rest_expected;
    ++terms;
  }
  return incomplete_gamma_q(0.5 * (terms - 1), 0.5 * statistic);
}

/// Twelve tests at once reject a right sampler with a chance of 10⁻³.
TEST(Aperture, IsEvenOverItsPolygon)
{
  const double least = sidak_threshold(1e-3, 12);
  std::uint64_t seed = 1;
  for (const int blades : {3, 4, 5, 8}) {
    for (const auto& [rotation, ratio] : {std::pair{0.0f, 1.0f}, {0.7f, 1.0f}, {-2.5f, 2.5f}}) {
      const double p = p_value_of(camera_with(blades, rotation, ratio), seed++);
      EXPECT_GT(p, least) << blades << " blades, rotation " << rotation << ", ratio " << ratio;
    }
  }
}

TEST(Aperture, AWrongRotationIsNoticed)
{
  // A square opening that is turned by 2°, against the one that is not.
  Camera turned = camera_with(4, 0.035f, 1);
  const std::vector<Point> corners = corners_of(camera_with(4, 0, 1));
  TestRandom random(3);
  int outside = 0;
  for (int n = 0; n < 10000; ++n) {
    const Vec2f u{random.next(), random.next()};
    const Vec2f p = aperture_sample(turned, u);
    for (std::size_t k = 0; k < 4; ++k) {
      const Point a = corners[k], b = corners[(k + 1) % 4];
      outside +=
          cross({b[0] - a[0], b[1] - a[1]}, {static_cast<double>(p.x) - a[0], static_cast<double>(p.y) - a[1]}) < -1e-5;
    }
  }
  EXPECT_GT(outside, 100);
}

TEST(Aperture, HasTheMomentsOfItsShape)
{
  constexpr int kSide = 512;
  for (const int blades : {0, 2, 3, 5, 6, 9, 16}) {
    for (const float ratio : {1.0f, 0.5f, 2.0f}) {
      const Camera camera = camera_with(blades, 1.1f, ratio);
      double x = 0, y = 0, xx = 0, yy = 0, xy = 0;
      for (int i = 0; i < kSide * kSide; ++i) {
        const Vec2f p = aperture_sample(
            camera, {(static_cast<float>(i % kSide) + 0.5f) / kSide, (static_cast<float>(i / kSide) + 0.5f) / kSide});
        const double px = static_cast<double>(p.x), py = static_cast<double>(p.y);
        x += px, y += py, xx += px * px, yy += py * py, xy += px * py;
      }
      constexpr double kCount = kSide * kSide;
      // Of a fan triangle of height a and base 2b: E[h²] = a²/2, E[along²] = b²/6. Of a disk E[r²] = 1/2.
      const double a = std::cos(std::numbers::pi / blades), b = std::sin(std::numbers::pi / blades);
      const double each = blades < 3 ? 0.25 : (a * a / 2 + b * b / 6) / 2;
      const double squeezed = each / (static_cast<double>(ratio) * static_cast<double>(ratio));
      EXPECT_NEAR(x / kCount, 0, 5e-4 / static_cast<double>(ratio)) << blades;
      EXPECT_NEAR(y / kCount, 0, 5e-4) << blades;
      EXPECT_NEAR(xx / kCount / squeezed, 1, 2e-3) << blades << " ratio " << ratio;
      EXPECT_NEAR(yy / kCount / each, 1, 2e-3) << blades << " ratio " << ratio;
      EXPECT_NEAR(xy / kCount, 0, 5e-4 / static_cast<double>(ratio)) << blades;
    }
  }
}

TEST(Aperture, IsAsWideAsItsCorners)
{
  // The corner of a triangle at 60° is reached by the ends of two edges.
  const Camera camera = camera_with(3, 0, 1);
  const Vec2f corner = aperture_sample(camera, {1.0f / 3, 0.99999994f});
  EXPECT_NEAR(corner.x, 0.5, 1e-5);
  EXPECT_NEAR(corner.y, std::sqrt(0.75), 1e-5);
}

}  // namespace
}  // namespace relief
