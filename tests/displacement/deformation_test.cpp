// Displaced meshes that deform while the shutter is open: a ray at a time meets what it would of a still mesh of that shape.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "kernel/math/step_place.h"
#include "tests/displacement/closed_surfaces.h"

namespace relief {
namespace {

using oracle::Ray;
using oracle::Vector3;
using Triangles = std::vector<oracle::DisplacedTriangle>;

Vector3 turned(const Vector3& v, double angle)
{
  const double c = std::cos(angle), s = std::sin(angle);
  return {c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]};
}

/// A way to deform.
struct Bending {
  std::string name;
  std::function<Vector3(const Vector3& P, int step)> P;
  std::function<Vector3(const Vector3& N, const Vector3& P, int step)> N;
};

std::vector<Bending> bendings()
{
  const auto stretched = [](const Vector3& P, int step) -> Vector3 {
    return {P[0] * (1 + .4 * step), P[1] + .1 * P[2] * step * step, P[2] * (1 + .1 * step)};
  };
  return {{"stretched", stretched,
           [](const Vector3& N, const Vector3&, int step) -> Vector3 {
             return {N[0] + .2 * N[1] * step, N[1] * (1 + .3 * step), N[2]};
           }},
          {"twisted", [](const Vector3& P, int step) { return turned(P, .3 * step * (1 + P[2])); },
           [](const Vector3& N, const Vector3& P, int step) { return turned(N, .3 * step * (1 + P[2])); }},
          // Boxes have to do without bounds of d/|N|.
          {"with normals that nearly turn over", stretched,
           [](const Vector3& N, const Vector3&, int step) { return turned(N, 2.6 * step); }}};
}

constexpr int kSteps = 3;

/// A closed surface and its shapes.
struct Deforming {
  ClosedSurface surface;
  Bending bending;
  std::vector<Triangles> steps;

  Deforming(ClosedSurface closed, Bending way) : surface(std::move(closed)), bending(std::move(way))
  {
    for (int step = 0; step < kSteps; ++step) {
      Triangles& bent = steps.emplace_back(surface.triangles);
      for (oracle::DisplacedTriangle& triangle : bent) {
        for (std::size_t k = 0; k < 3; ++k) {
          triangle.N[k] = float_rounded(bending.N(triangle.N[k], triangle.P[k], step));
          triangle.P[k] = float_rounded(bending.P(triangle.P[k], step));
        }
      }
    }
    set_time(.5f);
  }
  /// Makes the surface that of a time.
  void set_time(float time)
  {
    surface.triangles = at(time);
    if (still_inside == nullptr) still_inside = surface.inside;
    surface.inside = [this, place = step_place(time, kSteps)](std::mt19937_64& random) {
      const Vector3 P = still_inside(random);
      const auto step = static_cast<int>(place.step);
      return combination(1 - static_cast<double>(place.part), bending.P(P, step), static_cast<double>(place.part),
                         bending.P(P, step + 1));
    };
  }
  /// The shape at a time, rounded as that of meshes that are not displaced.
  Triangles at(float time) const
  {
    const StepPlace place = step_place(time, kSteps);
    Triangles mixed = steps[place.step];
    const auto mix = [&](Vector3& from, const Vector3& to) {
      const Vec3f v = mesh_mix(TracedCase::vector3(from), TracedCase::vector3(to), place.part);
      from = {v.x, v.y, v.z};
    };
    for (std::size_t i = 0; i < mixed.size(); ++i) {
      for (std::size_t k = 0; k < 3; ++k) {
        mix(mixed[i].P[k], steps[place.step + 1][i].P[k]);
        mix(mixed[i].N[k], steps[place.step + 1][i].N[k]);
      }
    }
    return mixed;
  }

 private:
  std::function<Vector3(std::mt19937_64&)> still_inside;
};

float random_time(std::mt19937_64& random)
{
  constexpr float kEnds[] = {0, .5f, 1 - 0x1p-24f};
  const int choice = random_index(random, 8);
  return choice < 3 ? kEnds[choice] : static_cast<float>(random_unit(random));
}

std::vector<ClosedSurface> closed_surfaces() { return {closed_sphere(), closed_torus(), seamed_box()}; }

class DisplacedMeshThatDeforms : public testing::TestWithParam<DisplacementMethod> {};

TEST_P(DisplacedMeshThatDeforms, IsAtEachTimeTheStillMeshOfThatShape)
{
  for (const ClosedSurface& closed : closed_surfaces()) {
    for (const Bending& bending : bendings()) {
      Deforming deforming(closed, bending);
      const auto& map = closed.map;
      constexpr int kLevels = 2, kTimes = 4, kRays = 400;
      const TracedCase traced(deforming.surface.triangles, map, HeightFormat::kFloat, kLevels, closed.weld_seams,
                              deforming.steps);
      DisplacedScene scene(traced.geometry(GetParam()), best_table());
      std::mt19937_64 random(5);
      int num_hits = 0;
      for (int i = 0; i < kTimes; ++i) {
        const float time = random_time(random);
        deforming.set_time(time);
        const TracedCase still(deforming.surface.triangles, map, HeightFormat::kFloat, kLevels, closed.weld_seams);
        DisplacedScene still_scene(still.geometry(GetParam()), best_table());
        for (int k = 0; k < kRays; ++k) {
          const Ray ray = k % 2 == 0 ? ray_from_inside(random, deforming.surface)
                                     : ray_through(random_vector(random, 2, 4), random_vector(random, 0, 1.5));
          const LodCone cone{k % 3 == 0 ? .1f : 0.0f, 0, 0};
          const RTCRayHit expected = still_scene.hit(ray, cone), hit = scene.hit(ray, cone, time);
          const std::string label =
              closed.name + " " + bending.name + " at " + std::to_string(time) + ", " + ray_text(ray);
          ASSERT_EQ(hit.hit.geomID, expected.hit.geomID) << label;
          ASSERT_EQ(hit.ray.tfar, expected.ray.tfar) << label;
          ASSERT_EQ(scene.occluded(ray, cone, time), still_scene.occluded(ray, cone)) << label;
          // Of two triangles that share the point either may be reported.
          if (hit.hit.geomID == RTC_INVALID_GEOMETRY_ID || hit.hit.primID != expected.hit.primID) continue;
          ++num_hits;
          const DisplacedPoint point = scene.resolve(hit), still_point = still_scene.resolve(expected);
          ASSERT_EQ(point.P, still_point.P) << label;
          ASSERT_EQ(point.Ng, still_point.Ng) << label;
          ASSERT_EQ(point.leave, still_point.leave) << label;
        }
      }
      EXPECT_GT(num_hits, kTimes * kRays / 4) << closed.name << " " << bending.name;
    }
  }
}

TEST_P(DisplacedMeshThatDeforms, LetsNoRayOutAtAnyTime)
{
  const std::vector<Bending> all = bendings();
  // What turns over has no inside.
  for (const Bending* bending : {all.data(), all.data() + 1}) {
    for (const ClosedSurface& closed : closed_surfaces()) {
      Deforming deforming(closed, *bending);
      const TracedCase traced(deforming.surface.triangles, closed.map, HeightFormat::kFloat, 1, closed.weld_seams,
                              deforming.steps);
      DisplacedScene scene(traced.geometry(GetParam()), best_table());
      std::mt19937_64 random(7);
      Leaks leaks;
      const std::uint64_t num_rays = num_test_rays(60000) / 6;
      float time = 0;
      for (std::uint64_t k = 0; k < num_rays; ++k) {
        if (k % 20 == 0) {
          time = random_time(random);
          deforming.set_time(time);
        }
        leaks.trace(scene, ray_from_inside(random, deforming.surface), time);
      }
      leaks.expect_none(closed.name + " " + bending->name);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Displacement,
                         DisplacedMeshThatDeforms,
                         testing::ValuesIn(traversing_methods()),
                         method_test_name);

}  // namespace
}  // namespace relief
