// The oracle itself, against closed forms, against other ways of evaluating the surface and against micro-triangles.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <random>
#include <string>
#include <vector>

#include "tests/displacement/hard_cases.h"
#include "tests/displacement/random_cases.h"
#include "tests/oracle/displaced_mesh.h"
#include "tests/oracle/displaced_triangle.h"
#include "tests/oracle/interval.h"
#include "tests/oracle/triangle_tree.h"

namespace relief {

namespace {

using oracle::DisplacedTriangle;
using oracle::HeightMap;
using oracle::Hit;
using oracle::Interval;
using oracle::Ray;
using oracle::Vector2;
using oracle::Vector3;
using oracle::Wrap;

double dot(const Vector3& a, const Vector3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Vector3 difference(const Vector3& a, const Vector3& b) { return combination(1, a, -1, b); }
Vector3 ray_point(const Ray& ray, double t) { return combination(1, ray.O, t, ray.D); }

/// The flat triangle (0, 0), (1, 0), (0, 1) with x and y as b1 and b2 and d along z.
DisplacedTriangle flat_triangle() { return hard_case_parts::flat_triangle(); }

struct PlaneHit {
  double t, b1, b2;
  bool is_inside(double margin) const { return b1 > margin && b2 > margin && b1 + b2 < 1 - margin; }
};

/// Intersection with the plane of three points; not finite for parallel rays.
PlaneHit plane_hit(const std::array<Vector3, 3>& P, const Ray& ray)
{
  const Vector3 edge1 = difference(P[1], P[0]), edge2 = difference(P[2], P[0]), from_corner = difference(ray.O, P[0]);
  const Vector3 p = cross_product(ray.D, edge2), q = cross_product(from_corner, edge1);
  const double determinant = dot(edge1, p);
  return {dot(edge2, q) / determinant, dot(from_corner, p) / determinant, dot(ray.D, q) / determinant};
}

/// Rays from around towards points near a flat triangle's prism.
std::vector<Ray> rays_towards(const DisplacedTriangle& triangle, int num_rays, double height, std::uint64_t seed)
{
  std::mt19937_64 random(seed);
  std::vector<Ray> rays;
  for (int i = 0; i < num_rays; ++i) {
    const Vector3 target = random_prism_point(random, triangle, -height, height);
    rays.push_back(ray_through(combination(1, target, 2, random_direction(random)), target));
  }
  return rays;
}

std::size_t num_certain(const std::vector<Hit>& hits)
{
  return static_cast<std::size_t>(std::count_if(hits.begin(), hits.end(), [](const Hit& hit) { return hit.certain; }));
}

/// The ray meets exactly one triangle, which is flat: the hit is there, in its bracket, and nothing else is.
void expect_flat(const std::vector<Hit>& hits, const std::array<Vector3, 3>& corners, const Ray& ray)
{
  const PlaneHit expected = plane_hit(corners, ray);
  const bool is_hit = expected.is_inside(1e-9) && expected.t > 1e-9;
  const bool is_miss = !(expected.is_inside(-1e-9) && expected.t > -1e-9);
  if (is_miss) {
    EXPECT_EQ(hits.size(), 0u);
  }
  if (!is_hit) return;
  ASSERT_EQ(hits.size(), 1u);
  EXPECT_TRUE(hits[0].certain);
  const double rounding = 1e-14 * (1 + expected.t);
  EXPECT_GE(expected.t, hits[0].t_low - rounding);
  EXPECT_LE(expected.t, hits[0].t_high + rounding);
  EXPECT_NEAR(hits[0].b[0], expected.b1, 1e-11);
  EXPECT_NEAR(hits[0].b[1], expected.b2, 1e-11);
  const Vector3 normal =
      unit_vector(cross_product(difference(corners[1], corners[0]), difference(corners[2], corners[0])));
  EXPECT_NEAR(std::abs(dot(normal, hits[0].Ng)), 1, 1e-9);
}

TEST(OracleInterval, HoldsTheExactResult)
{
  std::mt19937_64 random(1);
  for (int i = 0; i < 200000; ++i) {
    const double a_size = std::pow(10, random_between(random, -30, 30)), a = a_size * random_between(random, -1, 1);
    const double b_size = std::pow(10, random_between(random, -30, 30)), b = b_size * random_between(random, -1, 1);
    const Interval x = oracle::thin(a), y = oracle::thin(b);
    // Sums, products and quotients of doubles in long double have errors far below the intervals' widths.
    const auto holds = [](const Interval& interval, long double value) {
      return static_cast<long double>(interval.low) <= value && value <= static_cast<long double>(interval.high);
    };
    const long double a_long = a, b_long = b;
    ASSERT_TRUE(holds(x + y, a_long + b_long)) << a << " " << b;
    ASSERT_TRUE(holds(x - y, a_long - b_long)) << a << " " << b;
    ASSERT_TRUE(holds(x * y, a_long * b_long)) << a << " " << b;
    if (b != 0) {
      ASSERT_TRUE(holds(x / y, a_long / b_long)) << a << " " << b;
    }
    ASSERT_TRUE(holds(square(x), a_long * a_long)) << a;
    ASSERT_TRUE(holds(square_root(oracle::thin(std::abs(a))), std::sqrt(std::abs(a_long)))) << a;
  }
}

TEST(OracleInterval, HoldsProductsOfAllMembers)
{
  std::mt19937_64 random(2);
  for (int i = 0; i < 100000; ++i) {
    const double a0 = random_between(random, -2, 2), a1 = a0 + random_unit(random);
    const double b0 = random_between(random, -2, 2), b1 = b0 + random_unit(random);
    const double a = random_between(random, a0, a1), b = random_between(random, b0, b1);
    ASSERT_TRUE((Interval{a0, a1} * Interval{b0, b1}).contains(a * b));
    ASSERT_TRUE(square(Interval{a0, a1}).contains(a * a));
  }
}

TEST(OracleHeight, IsTheTexelAtItsCentre)
{
  std::mt19937_64 random(3);
  HeightMap map{5, 3, {}, Wrap::kRepeat, Wrap::kRepeat, 1, 0};
  for (int i = 0; i < 15; ++i) map.h.push_back(random_unit(random));
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 5; ++x) {
      EXPECT_NEAR(oracle::height_eval(map, {(x + .5) / 5, (y + .5) / 3}), map.h[static_cast<std::size_t>(5 * y + x)],
                  1e-14);
    }
  }
}

TEST(OracleHeight, WrapsLikeTheSampler)
{
  HeightMap map{3, 1, {0, 10, 20}, Wrap::kRepeat, Wrap::kRepeat, 1, 0};
  // Texels −4 … 6 of each mode.
  const double expected[3][11] = {{20, 0, 10, 20, 0, 10, 20, 0, 10, 20, 0},
                                  {20, 20, 10, 0, 0, 10, 20, 20, 10, 0, 0},
                                  {0, 0, 0, 0, 0, 10, 20, 20, 20, 20, 20}};
  for (int mode = 0; mode < 3; ++mode) {
    map.wrap_u = static_cast<Wrap>(mode);
    for (int i = 0; i < 11; ++i) {
      EXPECT_NEAR(oracle::height_eval(map, {(i - 4 + .5) / 3, .2}), expected[mode][i], 1e-13) << mode << " " << i;
    }
  }
}

TEST(OracleDisplacedTriangle, IsAnOffsetTriangleForAConstantMap)
{
  DisplacedTriangle triangle = hard_case_parts::domed_triangle();
  for (Vector3& N : triangle.N) N = {.25, -.5, 1};
  const HeightMap map{4, 4, std::vector<double>(16, .75), Wrap::kRepeat, Wrap::kMirror, .5, .25};
  std::array<Vector3, 3> corners = triangle.P;
  for (Vector3& P : corners) P = combination(1, P, .25, unit_vector(triangle.N[0]));
  const oracle::Surface surface(triangle, map);
  for (const Ray& ray : rays_towards(triangle, 5000, .6, 4)) expect_flat(surface.intersect_all(ray), corners, ray);
}

TEST(OracleDisplacedTriangle, IsAPlaneForAMapThatIsLinear)
{
  // h = column / 16 between the first and the last texel centre, on a triangle whose u and v are swapped and scaled.
  HeightMap map{17, 9, {}, Wrap::kClamp, Wrap::kClamp, .5, .25};
  for (int i = 0; i < 17 * 9; ++i) map.h.push_back(i % 17 / 16.);
  DisplacedTriangle triangle = flat_triangle();
  triangle.uv = {{{.125, .125}, {.25, .875}, {.875, .25}}};
  std::array<Vector3, 3> corners = triangle.P;
  for (std::size_t k = 0; k < 3; ++k) corners[k][2] = .5 * ((triangle.uv[k][0] * 17 - .5) / 16 - .25);
  const oracle::Surface surface(triangle, map);
  for (const Ray& ray : rays_towards(triangle, 5000, .4, 5)) expect_flat(surface.intersect_all(ray), corners, ray);
}

TEST(OracleDisplacedTriangle, IsABilinearPatchWithinATexel)
{
  // Two by two texels whose centres are the corners of the square [0, 1]²: z = h(x, y) is quadratic along a ray.
  const HeightMap map{2, 2, {.25, .75, 1, -.5}, Wrap::kClamp, Wrap::kClamp, 1, 0};
  DisplacedTriangle triangle = flat_triangle();
  triangle.uv = {{{.25, .25}, {.75, .25}, {.25, .75}}};
  const oracle::Surface surface(triangle, map);
  const double h0 = .25, h_x = .5, h_y = .75, h_xy = -.5 - .75 - 1 + .25;
  std::size_t num_twice = 0;
  for (const Ray& ray : rays_towards(triangle, 20000, 1, 6)) {
    const double a = -h_xy * ray.D[0] * ray.D[1];
    const double b = ray.D[2] - h_x * ray.D[0] - h_y * ray.D[1] - h_xy * (ray.O[0] * ray.D[1] + ray.O[1] * ray.D[0]);
    const double c = ray.O[2] - h0 - h_x * ray.O[0] - h_y * ray.O[1] - h_xy * ray.O[0] * ray.O[1];
    const double discriminant = b * b - 4 * a * c;
    if (std::abs(discriminant) < 1e-9) continue;
    std::vector<double> expected;
    bool is_near_border = false;
    if (discriminant > 0) {
      const double q = -.5 * (b + std::copysign(std::sqrt(discriminant), b));
      for (const double t : {q / a, c / q}) {
        const double x = ray.O[0] + t * ray.D[0], y = ray.O[1] + t * ray.D[1];
        const double margin = std::min({x, y, 1 - x - y, t});
        is_near_border |= std::abs(margin) < 1e-9;
        if (margin > 0) expected.push_back(t);
      }
    }
    if (is_near_border) continue;
    std::sort(expected.begin(), expected.end());
    const std::vector<Hit> hits = surface.intersect_all(ray);
    ASSERT_EQ(hits.size(), expected.size());
    num_twice += expected.size() == 2;
    for (std::size_t i = 0; i < hits.size(); ++i) {
      EXPECT_TRUE(hits[i].certain);
      EXPECT_NEAR(hits[i].t, expected[i], 1e-9);
    }
  }
  EXPECT_GT(num_twice, 100u);
}

TEST(OracleDisplacedTriangle, IsARadialOffsetForNormalsThatArePositions)
{
  // With N = P the surface is the base triangle pushed away from the origin by d: X is on it if X · (1 − d/|X|) is on
  // the triangle.
  DisplacedTriangle triangle = hard_case_parts::domed_triangle();
  triangle.P = {{{1, .25, 0}, {0, 1, .125}, {.25, 0, 1}}};
  triangle.N = triangle.P;
  const double d = .375;
  const HeightMap map{1, 1, {d}};
  const oracle::Surface surface(triangle, map);
  const Vector3 edge1 = difference(triangle.P[1], triangle.P[0]), edge2 = difference(triangle.P[2], triangle.P[0]);
  const Vector3 m = cross_product(edge1, edge2);
  std::size_t num_hits = 0;
  for (const Ray& ray : rays_towards(triangle, 2000, .6, 7)) {
    // Height above the triangle's plane of the point pushed back, along the ray; roots by dense sampling and bisection.
    const auto pushed_back = [&](double t) {
      const Vector3 X = ray_point(ray, t);
      return combination(1 - d / vector_length(X), X, 0, X);
    };
    const auto height = [&](double t) { return dot(difference(pushed_back(t), triangle.P[0]), m); };
    const auto is_inside = [&](double t, double margin) {
      const Vector3 inside = difference(pushed_back(t), triangle.P[0]);
      const double b1 = dot(cross_product(inside, edge2), m) / dot(m, m);
      const double b2 = dot(cross_product(edge1, inside), m) / dot(m, m);
      return b1 > margin && b2 > margin && b1 + b2 < 1 - margin;
    };
    std::vector<double> roots;
    bool is_near_border = false;
    constexpr int kNumSteps = 2000;
    constexpr double kLast = 6. / kNumSteps;
    double lowest = HUGE_VAL;
    for (int i = 0; i < kNumSteps; ++i) {
      double low = i * kLast, high = (i + 1) * kLast;
      // Within the unit sphere of radius d the point goes to the other side of the origin.
      if (vector_length(ray_point(ray, low)) < d + .02) continue;
      lowest = std::min(lowest, std::abs(height(low)) + (is_inside(low, -.05) ? 0 : 1));
      if ((height(low) < 0) == (height(high) < 0)) continue;
      for (int step = 0; step < 60; ++step) {
        const double middle = .5 * (low + high);
        ((height(low) < 0) == (height(middle) < 0) ? low : high) = middle;
      }
      is_near_border |= is_inside(low, -1e-6) != is_inside(low, 1e-6);
      if (is_inside(low, 0)) roots.push_back(low);
    }
    // The sampling may miss two roots closer to each other than its step.
    const std::vector<Hit> hits = surface.intersect_all(ray);
    if (is_near_border || (hits.size() != roots.size() && lowest < 1e-4)) continue;
    ASSERT_EQ(hits.size(), roots.size());
    for (std::size_t i = 0; i < roots.size(); ++i) EXPECT_NEAR(hits[i].t, roots[i], 1e-9);
    num_hits += hits.size();
  }
  EXPECT_GT(num_hits, 800u);
}

TEST(OracleDisplacedTriangle, HitsLieOnTheSurfaceAndOnTheRay)
{
  // surface_eval shares no code with the search: other wrapping, other interpolation, no parameters in texels.
  std::mt19937_64 random(8);
  std::size_t num_hits = 0, num_uncertain = 0;
  for (int i = 0; i < 300; ++i) {
    const RandomCase random_input = random_case(random, 200);
    const oracle::Surface surface(random_input.triangle, random_input.map);
    for (const Ray& ray : random_input.rays) {
      double last_t = -HUGE_VAL;
      for (const Hit& hit : surface.intersect_all(ray)) {
        EXPECT_GE(hit.t, last_t);
        last_t = hit.t;
        if (!hit.certain) {
          ++num_uncertain;
          continue;
        }
        ++num_hits;
        EXPECT_LE(hit.t_low, hit.t);
        EXPECT_LE(hit.t, hit.t_high);
        EXPECT_GE(hit.t, ray.t_min);
        EXPECT_LE(hit.t, ray.t_max);
        EXPECT_GE(std::min({hit.b[0], hit.b[1], 1 - hit.b[0] - hit.b[1]}), 0);
        const oracle::SurfacePoint point = oracle::surface_eval(random_input.triangle, random_input.map, hit.b);
        const double size = vector_length(ray.O) + vector_length(ray.D) + vector_length(random_input.triangle.P[0]);
        const double width = (hit.t_high - hit.t_low) * vector_length(ray.D);
        const Vector3 on_ray = ray_point(ray, hit.t);
        EXPECT_LT(vector_length(difference(point.P, on_ray)), 1e-12 * size + width) << "case " << i;
        EXPECT_LT(vector_length(difference(point.P, hit.P)), 1e-12 * size + width) << "case " << i;
        EXPECT_NEAR(hit.uv[0], point.uv[0], 1e-12);
        EXPECT_NEAR(hit.uv[1], point.uv[1], 1e-12);
        EXPECT_NEAR(vector_length(hit.Ng), 1, 1e-12);
        EXPECT_LT(vector_length(difference(point.Ng, hit.Ng)), 1e-6) << "case " << i;
      }
    }
  }
  EXPECT_GT(num_hits, 40000u);
  EXPECT_LT(num_uncertain, 60u);
}

/// A ray towards a point of the surface has a root there, up to rounding, which moves it by some 1e-15 of its size.
/// @return  false if no hit is near
bool finds_point(const oracle::Surface& surface, const Vector3& target, const Vector3& O)
{
  const Ray ray{O, difference(target, O), 0, HUGE_VAL};
  const double size = vector_length(O) + vector_length(target);
  for (const Hit& hit : surface.intersect_all(ray)) {
    // Where the ray grazes, t moves further than the point does.
    const double cosine = std::abs(dot(hit.Ng, ray.D)) / vector_length(ray.D);
    const double margin = 1e-12 * size / (vector_length(ray.D) * std::max(cosine, 1e-6));
    if (hit.t_low - margin <= 1 && 1 <= hit.t_high + margin) return true;
  }
  return false;
}

TEST(OracleDisplacedTriangle, MissesNoPointThatARayIsAimedAt)
{
  // A ray that grazes within rounding of a fold may rightly miss: at most one in 10⁵.
  std::mt19937_64 random(12);
  std::size_t num_missed = 0, num_rays = 0;
  for (int i = 0; i < 500; ++i) {
    const RandomCase random_input = random_case(random, 0);
    const oracle::Surface surface(random_input.triangle, random_input.map);
    const double size = vector_length(difference(random_input.triangle.P[1], random_input.triangle.P[0]));
    for (int k = 0; k < 200; ++k) {
      const Vector3 target =
          oracle::surface_eval(random_input.triangle, random_input.map, random_barycentric(random)).P;
      const Vector3 O = combination(1, target, size, random_vector(random, .1, 3));
      num_missed += !finds_point(surface, target, O);
      ++num_rays;
    }
  }
  EXPECT_LE(num_missed, num_rays / 100000) << "of " << num_rays;
}

TEST(OracleDisplacedTriangle, MissesNoPointOfHardCases)
{
  for (const HardCase& hard_case : hard_cases()) {
    std::mt19937_64 random(13);
    for (const DisplacedTriangle& triangle : hard_case.triangles) {
      if (vector_length(triangle.N[1]) == 0) continue;
      const oracle::Surface surface(triangle, hard_case.map);
      const double size = vector_length(difference(triangle.P[1], triangle.P[0])) + std::abs(hard_case.map.scale);
      for (std::size_t k = 0; k < 200 / hard_case.triangles.size(); ++k) {
        const Vector3 target = oracle::surface_eval(triangle, hard_case.map, random_barycentric(random)).P;
        const Vector3 O = combination(1, target, size, random_vector(random, .1, 3));
        EXPECT_TRUE(finds_point(surface, target, O)) << hard_case.name;
      }
    }
  }
}

/// Dense triangulation of a displaced triangle in its barycentric coordinates.
class MicroTriangles {
 public:
  MicroTriangles(const DisplacedTriangle& triangle, const HeightMap& map, int num_across) : num_across_(num_across)
  {
    for (int i = 0; i <= num_across; ++i) {
      for (int j = 0; j <= num_across - i; ++j) P_.push_back(oracle::surface_eval(triangle, map, barycentric(i, j)).P);
    }
  }

  struct MicroHit {
    double t, cosine;  ///< of the angle between the ray and the micro-triangle's normal
    double edge;       ///< longest edge of the micro-triangle
    Vector2 b;
  };

  double longest_edge() const
  {
    double longest = 0;
    for (int i = 0; i < num_across_; ++i) {
      for (int j = 0; j < num_across_ - i; ++j) {
        longest = std::max({longest, vector_length(difference(P(i + 1, j), P(i, j))),
                            vector_length(difference(P(i, j + 1), P(i, j)))});
      }
    }
    return longest;
  }

  std::vector<MicroHit> intersect_all(const Ray& ray) const
  {
    std::vector<MicroHit> hits;
    for (int i = 0; i < num_across_; ++i) {
      for (int j = 0; j < num_across_ - i; ++j) {
        add(ray, {P(i, j), P(i + 1, j), P(i, j + 1)}, barycentric(i, j), hits);
        if (i + j + 1 < num_across_) add(ray, {P(i + 1, j), P(i + 1, j + 1), P(i, j + 1)}, barycentric(i, j), hits);
      }
    }
    std::sort(hits.begin(), hits.end(), [](const MicroHit& a, const MicroHit& b) { return a.t < b.t; });
    return hits;
  }

 private:
  Vector2 barycentric(int i, int j) const
  {
    return {static_cast<double>(i) / num_across_, static_cast<double>(j) / num_across_};
  }
  const Vector3& P(int i, int j) const
  {
    const int index = i * (num_across_ + 1) - i * (i - 1) / 2 + j;
    return P_[static_cast<std::size_t>(index)];
  }
  static void add(const Ray& ray, const std::array<Vector3, 3>& corners, const Vector2& b, std::vector<MicroHit>& hits)
  {
    const PlaneHit hit = plane_hit(corners, ray);
    if (!hit.is_inside(0) || !(hit.t >= ray.t_min && hit.t <= ray.t_max)) return;
    const Vector3 edge1 = difference(corners[1], corners[0]), edge2 = difference(corners[2], corners[0]);
    const double cosine = std::abs(dot(unit_vector(cross_product(edge1, edge2)), unit_vector(ray.D)));
    const double edge =
        std::max({vector_length(edge1), vector_length(edge2), vector_length(difference(corners[2], corners[1]))});
    hits.push_back({hit.t, cosine, edge, b});
  }

  int num_across_;
  std::vector<Vector3> P_;
};

TEST(OracleDisplacedTriangle, AgreesWithDenseMicroTriangles)
{
  // A micro-triangle has its corners on the surface, so the surface is about its longest edge away at most. Hits that
  // graze, or within a few micro-triangles of the base triangle's edge, of a limit of t or of each other, can differ;
  // of the others none may be without a partner.
  constexpr int kNumAcross = 300;
  std::mt19937_64 random(9);
  std::size_t num_compared = 0;
  for (int i = 0; i < 60; ++i) {
    const RandomCase random_input = random_case(random, 40);
    const oracle::Surface surface(random_input.triangle, random_input.map);
    const MicroTriangles micro(random_input.triangle, random_input.map, kNumAcross);
    const double longest_edge = micro.longest_edge();
    for (const Ray& ray : random_input.rays) {
      const std::vector<Hit> hits = surface.intersect_all(ray);
      const auto micro_hits = micro.intersect_all(ray);
      const double D_length = vector_length(ray.D);
      const auto is_clear = [&](double t, double cosine, const Vector2& b, double tolerance) {
        return cosine > .2 && std::min({b[0], b[1], 1 - b[0] - b[1]}) > 4. / kNumAcross && t - ray.t_min > tolerance &&
               ray.t_max - t > tolerance;
      };
      for (const auto& micro_hit : micro_hits) {
        const double tolerance = 2 * micro_hit.edge / (micro_hit.cosine * D_length);
        if (!is_clear(micro_hit.t, micro_hit.cosine, micro_hit.b, tolerance)) continue;
        const bool has_partner = std::any_of(
            hits.begin(), hits.end(), [&](const Hit& hit) { return std::abs(hit.t - micro_hit.t) <= tolerance; });
        EXPECT_TRUE(has_partner) << "case " << i << " t " << micro_hit.t << " cosine " << micro_hit.cosine;
        ++num_compared;
      }
      for (const Hit& hit : hits) {
        const double cosine = std::abs(dot(hit.Ng, ray.D)) / D_length;
        if (!is_clear(hit.t, cosine, hit.b, 0)) continue;
        const bool has_partner = std::any_of(micro_hits.begin(), micro_hits.end(), [&](const auto& micro_hit) {
          return std::abs(hit.t - micro_hit.t) <= 2 * micro_hit.edge / (std::min(cosine, micro_hit.cosine) * D_length);
        });
        const double reach = 2 * longest_edge / (cosine * D_length);
        const bool is_at_limit = std::min(hit.t - ray.t_min, ray.t_max - hit.t) < reach;
        // Micro-triangles cut off peaks and creases, and with them pairs of roots.
        const bool is_in_pair = std::any_of(hits.begin(), hits.end(), [&](const Hit& other) {
          return &other != &hit && std::abs(other.t - hit.t) < reach;
        });
        EXPECT_TRUE(has_partner || is_at_limit || is_in_pair) << "case " << i << " t " << hit.t << " cosine " << cosine;
      }
    }
  }
  EXPECT_GT(num_compared, 500u);
}

TEST(OracleDisplacedTriangle, IsFoundOnceOnTexelBorders)
{
  // Rays straight down through texel centres, which are corners of four bilinear patches, and through the lines between
  // them.
  DisplacedTriangle triangle = flat_triangle();
  const HeightMap map = hard_case_parts::noise_map(16, 16, .5);
  const oracle::Surface surface(triangle, map);
  std::mt19937_64 random(10);
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 15 - y; ++x) {
      const double center_x = (x + .5) / 16, center_y = (y + .5) / 16, beside = random_between(random, 0, 1. / 32);
      for (const Vector2& target :
           {Vector2{center_x, center_y}, Vector2{center_x + beside, center_y}, Vector2{center_x, center_y + beside}}) {
        const Vector2 b{float_rounded(target[0]), float_rounded(target[1])};
        const std::vector<Hit> hits = surface.intersect_all({{b[0], b[1], 2}, {0, 0, -1}, 0, HUGE_VAL});
        ASSERT_EQ(hits.size(), 1u);
        EXPECT_NEAR(hits[0].P[2], .5 * (oracle::height_eval(map, b) - .5), 1e-12);
      }
    }
  }
}

TEST(OracleDisplacedTriangle, IsUncertainOnItsEdges)
{
  DisplacedTriangle triangle = flat_triangle();
  const HeightMap map = hard_case_parts::noise_map(8, 8, .25);
  const oracle::Surface surface(triangle, map);
  for (int i = 0; i <= 32; ++i) {
    const double along = i / 32.;
    for (const Vector2& b : {Vector2{along, 0}, Vector2{0, along}, Vector2{along, 1 - along}}) {
      const std::vector<Hit> hits = surface.intersect_all({{b[0], b[1], 2}, {0, 0, -1}, 0, HUGE_VAL});
      ASSERT_EQ(hits.size(), 1u) << b[0] << " " << b[1];
      EXPECT_FALSE(hits[0].certain);
      EXPECT_LT(hits[0].t_high - hits[0].t_low, 1e-8);
    }
  }
}

TEST(OracleDisplacedTriangle, IsUncertainWhereARayTouches)
{
  // A roof along y, its ridge at height 1, touched from the side and cut a little below.
  const HeightMap map{3, 1, {0, 1, 0}, Wrap::kClamp, Wrap::kClamp, .25, 0};
  DisplacedTriangle triangle = flat_triangle();
  const oracle::Surface surface(triangle, map);
  const auto hits_at = [&](double z) { return surface.intersect_all({{-1, .25, z}, {1, 0, 0}, 0, HUGE_VAL}); };
  const std::vector<Hit> touching = hits_at(.25);
  ASSERT_EQ(touching.size(), 1u);
  EXPECT_FALSE(touching[0].certain);
  EXPECT_NEAR(touching[0].t, 1.5, 1e-6);
  EXPECT_EQ(hits_at(.25 + 1e-9).size(), 0u);
  EXPECT_EQ(num_certain(hits_at(.25 - 1e-6)), 2u);
}

TEST(OracleDisplacedTriangle, MarksRaysThatLieInItAsUncertain)
{
  const HeightMap map{1, 1, {.5}, Wrap::kClamp, Wrap::kClamp, 1, 0};
  const std::vector<Hit> hits = oracle::intersect_all(flat_triangle(), map, {{-1, .25, .5}, {1, 0, 0}, 0, HUGE_VAL});
  EXPECT_EQ(num_certain(hits), 0u);
  // The whole segment from x = 0 to x = 0.75 is in doubt.
  ASSERT_FALSE(hits.empty());
  double low = HUGE_VAL, high = -HUGE_VAL;
  for (const Hit& hit : hits) {
    low = std::min(low, hit.t_low);
    high = std::max(high, hit.t_high);
  }
  EXPECT_LE(low, 1);
  EXPECT_GE(high, 1.75);
}

TEST(OracleDisplacedTriangle, KeepsToTheLimitsOfT)
{
  const HeightMap map{1, 1, {.5}};
  const auto hits = [&](double t_min, double t_max) {
    return oracle::intersect_all(flat_triangle(), map, {{.25, .25, 2}, {0, 0, -1}, t_min, t_max});
  };
  EXPECT_EQ(num_certain(hits(0, 2)), 1u);
  EXPECT_EQ(hits(0, 1.4999).size(), 0u);
  EXPECT_EQ(hits(1.5001, 9).size(), 0u);
  ASSERT_EQ(hits(1.5, 9).size(), 1u);
  EXPECT_FALSE(hits(1.5, 9)[0].certain);
}

TEST(OracleDisplacedTriangle, OrientsItsNormalByN)
{
  // Neither the order of the corners nor mirrored uv nor the ray's side turn it.
  const HeightMap map = hard_case_parts::noise_map(8, 8, .125);
  for (const bool is_swapped : {false, true}) {
    for (const double mirror : {1., -1.}) {
      DisplacedTriangle triangle = flat_triangle();
      if (is_swapped) std::swap(triangle.P[1], triangle.P[2]);
      for (Vector2& uv : triangle.uv) uv[0] *= mirror;
      const oracle::Surface surface(triangle, map);
      for (const Ray& ray : rays_towards(triangle, 200, .06, 11)) {
        for (const Hit& hit : surface.intersect_all(ray)) EXPECT_GT(hit.Ng[2], 0);
      }
    }
  }
}

TEST(OracleDisplacedTriangle, HasNoSurfaceWithoutNormals)
{
  DisplacedTriangle triangle = flat_triangle();
  triangle.N = {};
  const HeightMap map{1, 1, {.5}};
  EXPECT_TRUE(oracle::intersect_all(triangle, map, {{.25, .25, 2}, {0, 0, -1}, 0, HUGE_VAL}).empty());
}

TEST(OracleMesh, IsMetAnEvenNumberOfTimesByLinesIfClosed)
{
  std::size_t num_counted = 0, num_cases = 0;
  for (const HardCase& hard_case : hard_cases()) {
    if (!hard_case.is_closed) continue;
    ++num_cases;
    const oracle::Mesh mesh(hard_case.triangles, hard_case.map);
    for (const Ray& ray : hard_case.rays) {
      const Ray line{ray.O, ray.D, -HUGE_VAL, HUGE_VAL};
      std::size_t num_hits = 0;
      bool is_uncertain = false;
      for (const oracle::MeshHit& mesh_hit : mesh.intersect_all(line)) {
        is_uncertain |= !mesh_hit.hit.certain;
        ++num_hits;
      }
      if (is_uncertain) continue;
      EXPECT_EQ(num_hits % 2, 0u) << hard_case.name;
      ++num_counted;
    }
  }
  EXPECT_EQ(num_cases, 4u);
  EXPECT_GT(num_counted, 2500u);
}

TEST(OracleTriangles, AreTheSameWithAndWithoutTheirTree)
{
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto point = [&](double size) {
    return oracle::Vector3{size * uniform(random), size * uniform(random), size * uniform(random)};
  };
  std::vector<std::array<oracle::Vector3, 3>> triangles;
  for (int k = 0; k < 300; ++k) {
    const oracle::Vector3 at = point(1);
    std::array<oracle::Vector3, 3> triangle{at, at, at};
    for (oracle::Vector3& corner : triangle) {
      const oracle::Vector3 by = point(k % 3 == 0 ? .5 : .1);
      // Some lie in planes of axes, as the boxes do.
      for (std::size_t axis = k % 5 == 0 ? 1 : 0; axis < 3; ++axis) corner[axis] += by[axis];
    }
    triangles.push_back(triangle);
  }
  const oracle::TriangleTree tree(triangles, 1e-3);
  int num_met = 0, num_unclear = 0;
  for (int k = 0; k < 20000; ++k) {
    oracle::Vector3 O = point(2), D = point(1);
    if (k % 4 == 0) D[static_cast<std::size_t>(k / 4 % 3)] = 0;
    const oracle::NearestTriangle a = tree.nearest(O, D), b = tree.nearest_of_all(O, D);
    ASSERT_EQ(a.t, b.t);
    ASSERT_EQ(std::min(a.maybe, a.t), std::min(b.maybe, b.t));
    num_met += a.t < HUGE_VAL ? 1 : 0;
    num_unclear += a.maybe < a.t ? 1 : 0;
  }
  EXPECT_GT(num_met, 2000);
  EXPECT_GT(num_unclear, 20);
}

TEST(HardCases, HoldNothingButFloats)
{
  const auto is_float = [](double value) { return std::isfinite(value) && float_rounded(value) == value; };
  for (const HardCase& hard_case : hard_cases()) {
    SCOPED_TRACE(hard_case.name);
    EXPECT_GE(hard_case.rays.size(), 200u);
    EXPECT_EQ(hard_case.map.h.size(), static_cast<std::size_t>(hard_case.map.width * hard_case.map.height));
    EXPECT_TRUE(is_float(hard_case.map.scale) && is_float(hard_case.map.midlevel));
    EXPECT_TRUE(std::all_of(hard_case.map.h.begin(), hard_case.map.h.end(), is_float));
    for (const DisplacedTriangle& triangle : hard_case.triangles) {
      for (std::size_t k = 0; k < 3; ++k) {
        EXPECT_TRUE(std::all_of(triangle.P[k].begin(), triangle.P[k].end(), is_float));
        EXPECT_TRUE(std::all_of(triangle.N[k].begin(), triangle.N[k].end(), is_float));
        EXPECT_TRUE(std::all_of(triangle.uv[k].begin(), triangle.uv[k].end(), is_float));
      }
    }
    for (const Ray& ray : hard_case.rays) {
      EXPECT_TRUE(std::all_of(ray.O.begin(), ray.O.end(), is_float));
      EXPECT_TRUE(std::all_of(ray.D.begin(), ray.D.end(), is_float));
      EXPECT_GT(vector_length(ray.D), 0);
      EXPECT_TRUE(is_float(ray.t_min) && (is_float(ray.t_max) || ray.t_max == HUGE_VAL));
    }
  }
}

TEST(HardCases, HaveNamesOfTheirOwn)
{
  std::vector<std::string> names;
  for (const HardCase& hard_case : hard_cases()) names.push_back(hard_case.name);
  std::sort(names.begin(), names.end());
  EXPECT_EQ(std::adjacent_find(names.begin(), names.end()), names.end());
}

}  // namespace

}  // namespace relief
