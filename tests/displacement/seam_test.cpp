// Walls of texture seams against an oracle: where a ray passes from one side of an edge to the other between the two
// displaced edges, found from the edge's ruled surface alone.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iostream>
#include <random>
#include <string>
#include <vector>

#include "displacement/tessellation.h"
#include "tests/displacement/closed_surfaces.h"

namespace relief {
namespace {

using oracle::Ray;
using oracle::Vector2;
using oracle::Vector3;

double dot_product(const Vector3& a, const Vector3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/// An edge that two triangles share, with the texture coordinates of both.
struct Seam {
  Vector3 P[2], N[2];
  Vector2 uv[2][2];  ///< by side, then by end
};

std::vector<Seam> seams_of(const std::vector<oracle::DisplacedTriangle>& triangles)
{
  std::vector<Seam> seams;
  for (std::size_t a = 0; a < triangles.size(); ++a) {
    for (std::size_t b = a + 1; b < triangles.size(); ++b) {
      std::vector<std::pair<std::size_t, std::size_t>> shared;
      for (std::size_t k = 0; k < 3; ++k) {
        for (std::size_t m = 0; m < 3; ++m) {
          if (triangles[a].P[k] == triangles[b].P[m]) shared.emplace_back(k, m);
        }
      }
      if (shared.size() != 2) continue;
      Seam seam;
      for (std::size_t end = 0; end < 2; ++end) {
        const auto [k, m] = shared[end];
        seam.P[end] = triangles[a].P[k];
        seam.N[end] = triangles[a].N[k];
        seam.uv[0][end] = triangles[a].uv[k];
        seam.uv[1][end] = triangles[b].uv[m];
      }
      if (seam.uv[0][0] != seam.uv[1][0] || seam.uv[0][1] != seam.uv[1][1]) seams.push_back(seam);
    }
  }
  return seams;
}

/// Where a ray passes through the wall of a seam: P(f) + s·N(f) = O + tD, so that P(f) − O, N(f) and D lie in a plane,
/// which is a quadratic equation for f.
/// @param ambiguous  set where a root is too near to the wall's border to tell
void add_wall_roots(const Seam& seam,
                    const oracle::HeightMap& map,
                    const Ray& ray,
                    std::vector<double>* roots,
                    bool* ambiguous)
{
  constexpr double kMargin = 1e-7;
  const Vector3 P = combination(1, seam.P[0], -1, ray.O), dP = combination(1, seam.P[1], -1, seam.P[0]);
  const Vector3 N = seam.N[0], dN = combination(1, seam.N[1], -1, seam.N[0]);
  const double c = dot_product(cross_product(P, N), ray.D), a = dot_product(cross_product(dP, dN), ray.D);
  const double b = dot_product(cross_product(P, dN), ray.D) + dot_product(cross_product(dP, N), ray.D);
  std::vector<double> fractions;
  if (std::abs(a) < 1e-14 * (std::abs(b) + std::abs(c))) {
    if (b != 0) fractions.push_back(-c / b);
  } else if (const double discriminant = b * b - 4 * a * c; discriminant >= 0) {
    const double q = -.5 * (b + std::copysign(std::sqrt(discriminant), b));
    fractions.push_back(q / a);
    if (q != 0) fractions.push_back(c / q);
  }
  for (const double f : fractions) {
    if (!(f > -kMargin && f < 1 + kMargin)) continue;
    const Vector3 Pf = combination(1, P, f, dP), Nf = combination(1, N, f, dN);
    // Pf + s·Nf = tD, solved by least squares: it has a solution.
    const double NN = dot_product(Nf, Nf), ND = dot_product(Nf, ray.D), DD = dot_product(ray.D, ray.D);
    const double PN = dot_product(Pf, Nf), PD = dot_product(Pf, ray.D), determinant = NN * DD - ND * ND;
    const double s = (PD * ND - PN * DD) / determinant, t = (PD * NN - PN * ND) / determinant;
    const double d = s * vector_length(Nf);
    double heights[2];
    for (std::size_t side = 0; side < 2; ++side) {
      const Vector2 &uv0 = seam.uv[side][0], &uv1 = seam.uv[side][1];
      const Vector2 uv{uv0[0] + f * (uv1[0] - uv0[0]), uv0[1] + f * (uv1[1] - uv0[1])};
      heights[side] = map.scale * (oracle::height_eval(map, uv) - map.midlevel);
    }
    const auto [low, high] = std::minmax(heights[0], heights[1]);
    if (!(t > ray.t_min - kMargin && t < ray.t_max + kMargin && d > low - kMargin && d < high + kMargin)) continue;
    *ambiguous |= f < kMargin || f > 1 - kMargin || t < ray.t_min + kMargin || t > ray.t_max - kMargin ||
                  d < low + kMargin || d > high - kMargin;
    roots->push_back(t);
  }
}

/// A point that is on a wall if the gap is wide enough.
Vector3 random_wall_point(std::mt19937_64& random, const std::vector<Seam>& seams)
{
  const Seam& seam = seams[static_cast<std::size_t>(random_index(random, static_cast<int>(seams.size())))];
  const double f = random_unit(random), d = random_between(random, -.3, .3);
  const Vector3 N = unit_vector(combination(1 - f, seam.N[0], f, seam.N[1]));
  return combination(1, combination(1 - f, seam.P[0], f, seam.P[1]), d, N);
}

class SeamWalls : public testing::TestWithParam<DisplacementMethod> {};

TEST_P(SeamWalls, AreMetWhereTheirRuledSurfaceIs)
{
  const ClosedSurface surface = seamed_box();
  const TracedCase traced(surface.triangles, surface.map, HeightFormat::kFloat, 1, true);
  const DisplacedGeometry geometry = traced.geometry(GetParam());
  DisplacedScene scene(geometry, best_table());
  const oracle::Mesh mesh(surface.triangles, surface.map);
  const std::vector<Seam> seams = seams_of(surface.triangles);
  std::mt19937_64 random(11);
  int num_judged = 0, num_walls = 0;
  double largest_error = 0;
  for (int k = 0; k < 8000; ++k) {
    Ray ray = k % 3 == 0 ? ray_from_inside(random, surface)
                         : ray_through(random_vector(random, 2, 4), random_wall_point(random, seams));
    if (k % 6 == 5) ray.t_max = float_rounded(random_between(random, .2, 1.5));
    bool ambiguous = false;
    double expected = HUGE_VAL;
    for (const oracle::MeshHit& root : mesh.intersect_all(ray)) {
      ambiguous |= !root.hit.certain;
      expected = std::min(expected, root.hit.t);
    }
    std::vector<double> walls;
    for (const Seam& seam : seams) add_wall_roots(seam, surface.map, ray, &walls, &ambiguous);
    const double wall = walls.empty() ? HUGE_VAL : *std::min_element(walls.begin(), walls.end());
    if (ambiguous) continue;
    ++num_judged;
    const RTCRayHit found = scene.hit(ray, {});
    ASSERT_EQ(scene.occluded(ray), std::min(wall, expected) < HUGE_VAL) << ray_text(ray);
    if (!(std::min(wall, expected) < HUGE_VAL)) {
      ASSERT_EQ(found.hit.geomID, RTC_INVALID_GEOMETRY_ID) << ray_text(ray) << " t " << found.ray.tfar;
      continue;
    }
    ASSERT_NE(found.hit.geomID, RTC_INVALID_GEOMETRY_ID)
        << ray_text(ray) << " surface " << expected << " wall " << wall;
    const auto t = static_cast<double>(found.ray.tfar);
    ASSERT_NEAR(t, std::min(wall, expected), 1e-6 * (1 + t)) << ray_text(ray);
    const DisplacedPlace at = displaced_hit_decode({found.hit.u, found.hit.v, found.hit.Ng_x});
    const SurfacePoint point = displaced_surface_point(geometry, found.hit.primID, at);
    const bool on_wall = at.edge >= 0;
    ASSERT_EQ(on_wall, wall < expected) << ray_text(ray);
    num_walls += on_wall ? 1 : 0;
    const Vec3d on_ray{ray.O[0] + t * ray.D[0], ray.O[1] + t * ray.D[1], ray.O[2] + t * ray.D[2]};
    largest_error = std::max(largest_error, length(point.P - on_ray));
    // The outside is where the normal points to.
    const double cosine = point.Ng.x * ray.D[0] + point.Ng.y * ray.D[1] + point.Ng.z * ray.D[2];
    ASSERT_EQ(cosine > 0, k % 3 == 0) << ray_text(ray) << " wall " << on_wall;
  }
  std::cout << "[ figures  ] " << displacement_method_label(GetParam()) << ": " << num_judged << " rays, " << num_walls
            << " nearest hits on walls, points off the ray by " << largest_error << " at most\n";
  EXPECT_LT(largest_error, 1e-5);
  EXPECT_GE(num_judged, 4000);
  EXPECT_GE(num_walls, 200);
}

/// Two halves of a square, one at height 0 and the other at 1: all of the wall is outside of both halves' own heights.
TEST_P(SeamWalls, ReachOverGapsThatNeitherSideReachesInto)
{
  oracle::HeightMap map{4, 4, std::vector<double>(16, 0), oracle::Wrap::kRepeat, oracle::Wrap::kRepeat, 1, 0};
  std::fill(map.h.begin() + 8, map.h.end(), 1);
  const Vector3 up{0, 0, 1};
  const auto uv = [](double u, double v) -> Vector2 { return {float_rounded(u), float_rounded(v)}; };
  const std::vector<oracle::DisplacedTriangle> triangles{
      {{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}}, {{up, up, up}}, {{uv(.2, .2), uv(.3, .2), uv(.2, .3)}}},
      {{{{1, 1, 0}, {0, 1, 0}, {1, 0, 0}}}, {{up, up, up}}, {{uv(.3, .8), uv(.2, .8), uv(.3, .7)}}}};
  for (const bool weld : {false, true}) {
    const TracedCase traced(triangles, map, HeightFormat::kFloat, 1, weld);
    DisplacedScene scene(traced.geometry(GetParam()), best_table());
    for (const double z : {.01, .3, .5, .99}) {
      const float t = scene.intersect(ray_through({0, .2, z}, {1, 1.2, z}));
      EXPECT_EQ(t < HUGE_VALF, weld) << z;
      if (t < HUGE_VALF) {
        EXPECT_NEAR(static_cast<double>(t), .4, 1e-6) << z;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Displacement, SeamWalls, testing::ValuesIn(traversing_methods()), method_test_name);

/// Rays from inside that meet nothing.
int num_leaks(const ClosedSurface& surface, bool weld_seams)
{
  const TracedCase traced(surface.triangles, surface.map, HeightFormat::kFloat, 1, weld_seams);
  DisplacedScene scene(traced.geometry(DisplacementMethod::chord), best_table());
  std::mt19937_64 random(12);
  int count = 0;
  for (int k = 0; k < 10000; ++k) count += scene.intersect(ray_from_inside(random, surface)) < HUGE_VALF ? 0 : 1;
  return count;
}

TEST(SeamWalls, AreWhatClosesTheBox)
{
  EXPECT_GE(num_leaks(seamed_box(), false), 300);
  EXPECT_EQ(num_leaks(seamed_box(), true), 0);
}

TEST(SeamWalls, AreOneASideWhereTexturesDiffer)
{
  const ClosedSurface box = seamed_box(), torus = closed_torus();
  // 12 edges of 3 quads; those of the torus differ by whole periods only.
  EXPECT_EQ(TracedCase(box.triangles, box.map, HeightFormat::kFloat, 1, true).displaced_mesh().report().num_walls, 72u);
  EXPECT_EQ(TracedCase(torus.triangles, torus.map, HeightFormat::kFloat, 1, true).displaced_mesh().report().num_walls,
            0u);
}

constexpr const char* kTessellationNames[] = {"Quads", "Grids", "Blocks"};

class TessellationOfSeams : public testing::TestWithParam<TessellationKind> {};
INSTANTIATE_TEST_SUITE_P(Kinds,
                         TessellationOfSeams,
                         testing::Values(TessellationKind::kQuads, TessellationKind::kGrids, TessellationKind::kBlocks),
                         [](const auto& kind) { return kTessellationNames[static_cast<int>(kind.param)]; });

TEST_P(TessellationOfSeams, LetsNoRayOut)
{
  const ClosedSurface box = seamed_box();
  for (const bool weld : {true, false}) {
    const TracedCase traced(box.triangles, box.map, HeightFormat::kFloat, 1, weld);
    const Tessellation tessellation(traced.mesh(), tessellation_layout_make(traced.mesh(), GetParam(), 1));
    RTCDevice device = rtcNewDevice(nullptr);
    RTCScene scene = tessellation_scene_make(device, {});
    RTCGeometry geometry = tessellation.geometry_make(device);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene);
    EmbreeContext context;
    embree_context_init(context, false);
    std::mt19937_64 random(13);
    int count = 0;
    for (int k = 0; k < 20000; ++k) {
      RTCRayHit query{};
      // Not at vertices: there Embree's own triangles let rays through.
      const Vector3 O = box.inside(random);
      query.ray = embree_ray(ray_through(O, combination(1, O, 1, random_direction(random))));
      query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
      embree_intersect1(scene, context, query);
      count += query.hit.geomID == RTC_INVALID_GEOMETRY_ID ? 1 : 0;
    }
    EXPECT_EQ(count > 0, !weld) << count;
    rtcReleaseScene(scene);
    rtcReleaseDevice(device);
  }
}

}  // namespace
}  // namespace relief
