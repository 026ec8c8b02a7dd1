// How far rays' origins are moved onto smooth surfaces: closed forms, and the planes of the vertices in doubles.
#include "kernel/shape/triangle_lift.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "displacement/vec3d.h"
#include "tests/support/chi2.h"

namespace relief {
namespace {

struct Corner {
  Vec3d V, N;
};

/// How far on the side of `sign` a point may be moved along a normal until it is at the lowest of the vertices' planes, each of them
/// raised to the neighbours that stand above it; or half of the height of the paraboloid, if that is farther.
double reference(const Corner (&corners)[3], const double (&weight)[3], double sign)
{
  Vec3d P{};
  for (int i = 0; i < 3; ++i) P = P + weight[i] * corners[i].V;
  double least = HUGE_VAL, bulge = 0;
  for (int i = 0; i < 3; ++i) {
    double highest = 0;
    for (const Corner& other : corners) highest = std::max(highest, sign * dot(other.V - corners[i].V, corners[i].N));
    least = std::min(least, std::max(0.0, highest - sign * dot(P - corners[i].V, corners[i].N)));
    const Corner &from = corners[i], &to = corners[(i + 1) % 3];
    bulge += weight[i] * weight[(i + 1) % 3] * dot(to.N - from.N, to.V - from.V);
  }
  return sign * std::max(least, sign * bulge / 2);
}

LiftHeights<float> lift_of(const Corner (&c)[3], const double (&weight)[3])
{
  const auto f = [](double x) { return static_cast<float>(x); };
  return triangle_lift(f(weight[0]), f(weight[1]), f(weight[2]), to_float(c[1].V - c[0].V), to_float(c[2].V - c[0].V),
                       to_float(c[0].N), to_float(c[1].N), to_float(c[2].N));
}

TEST(TriangleLift, IsWhatThePlanesOfTheVerticesSay)
{
  TestRandom random{3};
  const auto vector = [&] {
    const auto x = [&] { return 2.0 * static_cast<double>(random.next()) - 1; };
    return Vec3d{x(), x(), x()};
  };
  int num_front = 0, num_back = 0;
  for (int i = 0; i < 20000; ++i) {
    Corner corners[3];
    const Vec3d up = vector();
    for (Corner& c : corners) {
      c.V = vector();
      const Vec3d n = i % 2 == 0 ? vector() : up + 0.3 * vector();
      c.N = n * (1 / length(n));
    }
    const double a = static_cast<double>(random.next()), b = (1 - a) * static_cast<double>(random.next());
    const double weight[3] = {1 - a - b, a, b};
    const LiftHeights<float> found = lift_of(corners, weight);
    ASSERT_NEAR(found.front, reference(corners, weight, 1), 2e-6);
    ASSERT_NEAR(found.back, reference(corners, weight, -1), 2e-6);
    num_front += found.front > 0.01f ? 1 : 0;
    num_back += found.back < -0.01f ? 1 : 0;
  }
  EXPECT_GT(num_front, 5000);
  EXPECT_GT(num_back, 5000);
}

/// A facet of a cylinder around the y axis, of half angle .1, normals out: at the middle of its upper side.
TEST(TriangleLift, OfAFacetOfACylinderIsAsHighAsItsSides)
{
  const double c = std::cos(0.1), s = std::sin(0.1);
  const Corner outside[3] = {{{-s, 0, c}, {-s, 0, c}}, {{s, 1, c}, {s, 0, c}}, {{-s, 1, c}, {-s, 0, c}}};
  const double middle_of_top[3] = {0, 0.5, 0.5};
  // The planes of both upper vertices stand s² above the middle, the third's as well; nothing is on the inner side but the sag.
  const LiftHeights<float> out = lift_of(outside, middle_of_top);
  EXPECT_NEAR(out.front, s * s, 1e-6);
  EXPECT_NEAR(out.back, -s * s, 1e-6);
  EXPECT_EQ(lift_of(outside, {1, 0, 0}).front, 0);
}

TEST(TriangleLift, OfAFlatOneIsNothing)
{
  const Corner flat[3] = {{{0, 0, 0}, {0, 0, 1}}, {{1, 0, 0}, {0, 0, 1}}, {{0, 1, 0}, {0, 0, 1}}};
  const LiftHeights<float> lift = lift_of(flat, {0.3, 0.3, 0.4});
  EXPECT_EQ(lift.front, 0);
  EXPECT_EQ(lift.back, 0);
}

TEST(TerminatorLift, IsAllBelowTheFacetAndNothingWellAboveIt)
{
  const TriangleLift lift{{0, 0, 2}, 0.5f, -0.25f};
  const Vec3f Ng{0, 0, 1}, Ns = normalize(Vec3f{1, 0, 1});
  const auto moved = [&](Vec3f wi, Vec3f ng, Vec3f ns) { return terminator_lift(lift, normalize(wi), ng, ns).z; };
  EXPECT_EQ(moved({1, 0, -0.3f}, Ng, Ns), 1.0f);
  EXPECT_EQ(moved({1, 0, 0.2f}, Ng, Ns), 0.0f);
  EXPECT_NEAR(moved({1, 0, 0.05f}, Ng, Ns), 1.0f - 0.49938f, 1e-4f);
  // On the other side it is what stands there.
  EXPECT_EQ(moved({-1, 0, 0.3f}, -Ng, -Ns), -0.5f);
}

}  // namespace
}  // namespace relief
