// Smooth surfaces of meshes by their vertices and normals: through the vertices, with the normals there, and with one tangent
// plane along each side.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "displacement/curved_heights.h"
#include "displacement/embree_geometry.h"
#include "displacement/lattice_split.h"
#include "tests/displacement/random_cases.h"

namespace relief {
namespace {

struct Corners {
  Vec3f P[3], N[3];
};

/// A point of the surface over a triangle.
Vec3d surface(const Corners& c, const CurvedTriangle& curved, double b1, double b2)
{
  const double b[3] = {1 - b1 - b2, b1, b2};
  Vec3d P{}, N{};
  for (int k = 0; k < 3; ++k) {
    P = P + b[k] * to_double(c.P[k]);
    N = N + b[k] * to_double(c.N[k]);
  }
  return P + N * (curved.displacement(b) / length(N));
}

/// Unit normal by differences, towards the inside of the triangle.
Vec3d normal(const Corners& c, const CurvedTriangle& curved, double b1, double b2)
{
  constexpr double kStep = 1e-5;
  const double step1 = b1 + b2 > 0.5 && b1 > 0.1 ? -kStep : kStep, step2 = b1 + b2 > 0.5 && b2 > 0.1 ? -kStep : kStep;
  const Vec3d at = surface(c, curved, b1, b2);
  // Second order, one-sided.
  const auto slope = [&](double s1, double s2) {
    return (surface(c, curved, b1 + s1, b2 + s2) - at) * 4.0 - (surface(c, curved, b1 + 2 * s1, b2 + 2 * s2) - at);
  };
  const Vec3d n = cross(slope(step1, 0), slope(0, step2)) * (step1 * step2 > 0 ? 1.0 : -1.0);
  return n * (1 / length(n));
}

Vec3f random_normal(std::mt19937_64& random, double lean)
{
  const oracle::Vector3 n = unit_vector(combination(1, {0, 0, 1}, lean, random_direction(random)));
  return {static_cast<float>(n[0]), static_cast<float>(n[1]), static_cast<float>(n[2])};
}

/// Two triangles of one side: 0, 1, 2 and 1, 0, 3 of four vertices.
struct Pair {
  Corners first, second;

  explicit Pair(std::mt19937_64& random)
  {
    Vec3f P[4], N[4];
    const double xs[4] = {0, 1, .4, .6}, ys[4] = {0, 0, .9, -.9};
    for (int k = 0; k < 4; ++k) {
      const auto jitter = [&] { return random_between(random, -.15, .15); };
      P[k] = {static_cast<float>(xs[k] + jitter()), static_cast<float>(ys[k] + jitter()), static_cast<float>(jitter())};
      N[k] = random_normal(random, .5) * static_cast<float>(random_between(random, .7, 1.4));
    }
    first = {{P[0], P[1], P[2]}, {N[0], N[1], N[2]}};
    second = {{P[1], P[0], P[3]}, {N[1], N[0], N[3]}};
  }
};

TEST(CurvedHeights, GoThroughTheVerticesWithTheirNormals)
{
  std::mt19937_64 random(1);
  for (int round = 0; round < 200; ++round) {
    const Corners c = Pair(random).first;
    const CurvedTriangle curved(c.P, c.N);
    for (int k = 0; k < 3; ++k) {
      double b[3] = {0, 0, 0};
      b[k] = 1;
      EXPECT_EQ(curved.displacement(b), 0);
      // Near the vertex, from three directions: what is left falls with the distance.
      for (const double share : {.2, .5, .8}) {
        constexpr double kNear = 1e-4;
        double at[3] = {};
        at[k] = 1 - kNear;
        at[(k + 1) % 3] = share * kNear;
        at[(k + 2) % 3] = (1 - share) * kNear;
        const Vec3d away = surface(c, curved, at[1], at[2]) - to_double(c.P[k]);
        const Vec3d N = to_double(c.N[k]);
        EXPECT_NEAR(dot(away, N) / (length(away) * length(N)), 0, 2e-3);
      }
    }
  }
}

TEST(CurvedHeights, AreTheSameAlongASide)
{
  std::mt19937_64 random(2);
  for (int round = 0; round < 1000; ++round) {
    const Pair pair(random);
    const CurvedTriangle first(pair.first.P, pair.first.N), second(pair.second.P, pair.second.N);
    const double along = std::floor(random_unit(random) * 4097) / 4096;
    const double b_first[3] = {1 - along, along, 0}, b_second[3] = {along, 1 - along, 0};
    ASSERT_EQ(first.displacement(b_first), second.displacement(b_second));
  }
}

TEST(CurvedHeights, HaveOneTangentPlaneAlongASide)
{
  std::mt19937_64 random(3);
  double widest = 0, widest_flat = 0;
  for (int round = 0; round < 1000; ++round) {
    const Pair pair(random);
    const CurvedTriangle first(pair.first.P, pair.first.N), second(pair.second.P, pair.second.N);
    const double along = random_between(random, .05, .95);
    const Vec3d a = normal(pair.first, first, along, 1e-9), b = normal(pair.second, second, 1 - along, 1e-9);
    widest = std::max(widest, std::acos(std::min(1.0, dot(a, b))));
    const auto facet = [](const Corners& c) {
      const Vec3d n = cross(to_double(c.P[1]) - to_double(c.P[0]), to_double(c.P[2]) - to_double(c.P[0]));
      return n * (1 / length(n));
    };
    widest_flat = std::max(widest_flat, std::acos(std::min(1.0, dot(facet(pair.first), facet(pair.second)))));
  }
  std::cout << "[ figures  ] largest angle across a side: " << widest << ", of the flat triangles " << widest_flat
            << "\n";
  EXPECT_GT(widest_flat, .2);
  EXPECT_LT(widest, 2e-4);  // what differences can tell
}

TEST(CurvedHeights, AreWithinTheirBounds)
{
  std::mt19937_64 random(4);
  double wide = 0, seen = 0;
  for (int round = 0; round < 2000; ++round) {
    const Corners c = Pair(random).first;
    const CurvedTriangle curved(c.P, c.N);
    double low, high;
    curved.bounds(&low, &high);
    ASSERT_TRUE(low <= 0 && high >= 0);
    double least = 0, most = 0;
    for (int k = 0; k < 100; ++k) {
      const oracle::Vector2 at = random_barycentric(random);
      const double b[3] = {1 - at[0] - at[1], at[0], at[1]};
      const double d = curved.displacement(b);
      ASSERT_TRUE(d >= low && d <= high) << d << " in " << low << " " << high;
      least = std::min(least, d);
      most = std::max(most, d);
    }
    if (!(high < HUGE_VAL)) continue;
    wide += high - low;
    seen += most - least;
  }
  std::cout << "[ figures  ] bounds are " << wide / seen << " times as wide as the heights\n";
  EXPECT_LT(wide, 6 * seen);
}

TEST(CurvedHeights, OfFlatMeshesAreNone)
{
  const Corners flat{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}}};
  const CurvedTriangle curved(flat.P, flat.N);
  const double b[3] = {.25, .25, .5};
  EXPECT_EQ(curved.displacement(b), 0);
}

/// Smooth normals are those of the curved surface, of triangles of one cell too.
TEST(CurvedHeights, AreShadedWithOneNormalAlongASide)
{
  std::mt19937_64 random(6);
  double across_side = 0, at_corner = 0;
  for (int round = 0; round < 100; ++round) {
    const Pair pair(random);
    const Vec3f P[4] = {pair.first.P[0], pair.first.P[1], pair.first.P[2], pair.second.P[2]};
    Normal3f N[4];
    for (int k = 0; k < 4; ++k) N[k] = as_normal(k < 3 ? pair.first.N[k] : pair.second.N[2]);
    const TriangleIndices triangles[2] = {{0, 1, 2}, {1, 0, 3}};
    MeshView view;
    view.P = P;
    view.N = N;
    view.triangles = triangles;
    view.num_vertices = 4;
    view.num_triangles = 2;
    const CurvedHeights heights{view, {}, 1, 0};
    for (const int num_cells : {1, 2, 32}) {
      LatticeCache cache(1 << 20);
      const ProceduralField field(heights.source(), lattices_make(view, num_cells), 0, cache);
      const DisplacedMesh displaced(view, field, {.height = {}, .scale = 1, .midlevel = 0});
      DisplacedGeometry geometry;
      geometry.mesh = displaced.view();
      geometry.procedural = &field;
      for (int k = 0; k < 3; ++k) {
        const Vec3d found = displaced_smooth_normal(geometry, 0, {k == 1 ? 1.0f : 0.0f, k == 2 ? 1.0f : 0.0f});
        const Vec3d expected = to_double(pair.first.N[k]);
        at_corner = std::max(at_corner, length(found - expected * (1 / length(expected))));
      }
      for (int at = 0; at <= num_cells; ++at) {
        const float along = static_cast<float>(at) / static_cast<float>(num_cells);
        const Vec3d a = displaced_smooth_normal(geometry, 0, {along, 0}),
                    b = displaced_smooth_normal(geometry, 1, {1 - along, 0});
        across_side = std::max(across_side, length(a - b));
      }
    }
  }
  // Heights are floats.
  EXPECT_LT(at_corner, 1e-5);
  EXPECT_LT(across_side, 1e-4);
}

/// Of a sphere's corners the surface is much nearer to the sphere than the triangle is.
TEST(CurvedHeights, OfAnIcosahedronAreNearlyASphere)
{
  const float a = 0.850651f, b0 = 0.525731f;
  const Corners c{{{0, b0, a}, {0, -b0, a}, {a, 0, b0}}, {{0, b0, a}, {0, -b0, a}, {a, 0, b0}}};
  const CurvedTriangle curved(c.P, c.N);
  std::mt19937_64 random(5);
  for (int k = 0; k < 1000; ++k) {
    const oracle::Vector2 b = random_barycentric(random);
    EXPECT_NEAR(length(surface(c, curved, b[0], b[1])), 1, .041);  // the triangle: .21
  }
}

}  // namespace
}  // namespace relief
