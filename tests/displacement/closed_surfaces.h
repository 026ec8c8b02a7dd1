// Closed displaced surfaces, rays from inside of them, and Embree scenes to trace those in.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "displacement/embree.h"
#include "tests/displacement/hard_cases.h"
#include "tests/displacement/judge.h"
#include "tests/oracle/displaced_mesh.h"

namespace relief {

struct ClosedSurface {
  std::string name;
  std::vector<oracle::DisplacedTriangle> triangles;
  oracle::HeightMap map;
  std::function<oracle::Vector3(std::mt19937_64&)> inside;  ///< a point within the surface
  bool weld_seams = false;                                  ///< it is closed by the walls of its seams only
};

/// A globe with its poles on the z axis. The map repeats around it and is constant near the poles, where u is not
/// continuous.
inline ClosedSurface closed_sphere()
{
  constexpr int kNumU = 24, kNumV = 12, kWidth = 96, kHeight = 48;
  const auto P_of = [](int i, int j) -> oracle::Vector3 {
    if (j == 0 || j == kNumV) return {0, 0, j == 0 ? 1. : -1.};
    const double theta = hard_case_parts::kPi * j / kNumV, phi = 2 * hard_case_parts::kPi * (i % kNumU) / kNumU;
    return {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
  };
  ClosedSurface sphere{"sphere", hard_case_parts::grid_triangles(kNumU, kNumV, 1, 1, P_of, P_of),
                       hard_case_parts::noise_map(kWidth, kHeight, .2), [](std::mt19937_64& random) {
                         const double radius = random_index(random, 2) == 0 ? 0 : .5;
                         return random_vector(random, 0, radius);
                       }};
  sphere.map.wrap_v = oracle::Wrap::kClamp;
  constexpr std::size_t kConstantRows = 8;  // also at a quarter of the resolution
  for (std::size_t row = 0; row < kHeight; ++row) {
    if (row >= kConstantRows && row < kHeight - kConstantRows) continue;
    for (std::size_t column = 0; column < kWidth; ++column) sphere.map.h[kWidth * row + column] = .5;
  }
  return sphere;
}

/// Periodic in u and v.
inline ClosedSurface closed_torus()
{
  constexpr int kNumAround = 20, kNumTube = 10;
  const auto angle_u = [](int i) { return 2 * hard_case_parts::kPi * (i % kNumAround) / kNumAround; };
  const auto angle_v = [](int j) { return -2 * hard_case_parts::kPi * (j % kNumTube) / kNumTube; };
  const auto N_of = [&](int i, int j) -> oracle::Vector3 {
    return {std::cos(angle_v(j)) * std::cos(angle_u(i)), std::cos(angle_v(j)) * std::sin(angle_u(i)),
            std::sin(angle_v(j))};
  };
  const auto P_of = [&](int i, int j) {
    return combination(.4, N_of(i, j), 1, {std::cos(angle_u(i)), std::sin(angle_u(i)), 0});
  };
  return {"torus", hard_case_parts::grid_triangles(kNumAround, kNumTube, 3, 2, P_of, N_of),
          hard_case_parts::noise_map(31, 17, .15), [](std::mt19937_64& random) {
            const double phi = random_between(random, 0, 2 * hard_case_parts::kPi);
            return combination(1, random_vector(random, 0, .1), 1, {std::cos(phi), std::sin(phi), 0});
          }};
}

/// A box with rounded normals whose sides lie in different places of the map, turned and stretched: seams along all of
/// its edges, with gaps as wide as the displacement, and three of them at each corner.
inline ClosedSurface seamed_box()
{
  constexpr int kQuads = 3;
  ClosedSurface box{"seamed box", {}, hard_case_parts::noise_map(19, 23, .6), [](std::mt19937_64& random) {
                      return random_vector(random, 0, .3);
                    }};
  box.weld_seams = true;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const double side : {-1., 1.}) {
      const auto P_of = [=](int i, int j) {
        oracle::Vector3 P{};
        P[axis] = side;
        P[(axis + 1) % 3] = 2. * i / kQuads - 1;
        P[(axis + 2) % 3] = 2. * j / kQuads - 1;
        return P;
      };
      const auto N_of = [=](int i, int j) { return unit_vector(P_of(i, j)); };
      const double stretch = .6 + .13 * static_cast<double>(axis);
      for (oracle::DisplacedTriangle& triangle :
           hard_case_parts::grid_triangles(kQuads, kQuads, stretch, stretch, P_of, N_of)) {
        for (oracle::Vector2& uv : triangle.uv) {
          const double turned = side > 0 ? 1 - uv[1] : uv[1];
          uv = {float_rounded(turned + .31 * static_cast<double>(axis)), float_rounded(uv[0] + .17 * side)};
        }
        box.triangles.push_back(triangle);
      }
    }
  }
  return box;
}

/// Rays from inside in all directions; at corners, edges and next to them; along axes and along displacement lines.
inline oracle::Ray ray_from_inside(std::mt19937_64& random, const ClosedSurface& surface)
{
  const oracle::Vector3 O = surface.inside(random);
  const int num_triangles = static_cast<int>(surface.triangles.size());
  const oracle::DisplacedTriangle& triangle =
      surface.triangles[static_cast<std::size_t>(random_index(random, num_triangles))];
  const auto corner = static_cast<std::size_t>(random_index(random, 3));
  const double along = random_unit(random), beside = std::pow(10, random_between(random, -17, -5));
  const oracle::Vector2 edges[3] = {{along, 0}, {0, along}, {along, 1 - along}};
  const oracle::Vector2 corners[3] = {{0, 0}, {1, 0}, {0, 1}};
  switch (random_index(random, 8)) {
    case 0:
      return ray_through(O, oracle::surface_eval(triangle, surface.map, corners[corner]).P);
    case 1:
      return ray_through(O, oracle::surface_eval(triangle, surface.map, edges[corner]).P);
    case 2: {
      const oracle::Vector2 edge = edges[corner];
      const oracle::Vector2 b{edge[0] + beside * (1. / 3 - edge[0]), edge[1] + beside * (1. / 3 - edge[1])};
      return ray_through(O, oracle::surface_eval(triangle, surface.map, b).P);
    }
    case 3: {
      // Exactly along a corner's displacement line, which several triangles share.
      const oracle::Vector3 D = triangle.N[corner];
      return {float_rounded(combination(1, triangle.P[corner], -.25, D)), D, 0, HUGE_VAL};
    }
    case 4: {
      oracle::Vector3 D{};
      D[corner] = random_index(random, 2) == 0 ? 1 : -1;
      if (random_index(random, 2) == 0) D[(corner + 1) % 3] = float_rounded(random_between(random, -1, 1));
      return {float_rounded(O), D, 0, HUGE_VAL};
    }
    default:
      return ray_through(O, combination(1, O, 1, random_direction(random)));
  }
}

/// A ray as Embree takes it.
inline RTCRay embree_ray(const oracle::Ray& ray, float time = 0)
{
  RTCRay result{};
  const Vec3f O = TracedCase::vector3(ray.O), D = TracedCase::vector3(ray.D);
  result.org_x = O.x;
  result.org_y = O.y;
  result.org_z = O.z;
  result.dir_x = D.x;
  result.dir_y = D.y;
  result.dir_z = D.z;
  result.tnear = static_cast<float>(ray.t_min);
  result.tfar = static_cast<float>(ray.t_max);
  result.time = time;
  result.mask = ~0u;
  return result;
}

/// An Embree scene as the renderer makes it.
class DisplacedScene {
 public:
  DisplacedScene(const DisplacedGeometry& geometry, const TraversalTable& table) : geometry_(geometry)
  {
    device_ = rtcNewDevice(nullptr);
    scene_ = rtcNewScene(device_);
    rtcSetSceneBuildQuality(scene_, RTC_BUILD_QUALITY_HIGH);
    rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);
    RTCGeometry made = displaced_geometry_make(device_, geometry_, table);
    rtcCommitGeometry(made);
    rtcAttachGeometry(scene_, made);
    rtcReleaseGeometry(made);
    rtcCommitScene(scene_);
    geometry_.scene = scene_;
    embree_context_init(context_, false);
  }
  ~DisplacedScene()
  {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  DisplacedScene(const DisplacedScene&) = delete;
  DisplacedScene& operator=(const DisplacedScene&) = delete;

  /// @return  t of the nearest hit; infinite: none
  float intersect(const oracle::Ray& ray, const LodCone& cone = {}, float time = 0)
  {
    const RTCRayHit query = hit(ray, cone, time);
    return query.hit.geomID != RTC_INVALID_GEOMETRY_ID ? query.ray.tfar : HUGE_VALF;
  }
  /// The nearest hit as Embree reports it.
  RTCRayHit hit(const oracle::Ray& ray, const LodCone& cone, float time = 0)
  {
    RTCRayHit query{};
    query.ray = embree_ray(ray, time);
    query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    context_.cones = &cone;
    embree_intersect1(scene_, context_, query);
    return query;
  }
  /// Counts what rays do from now on.
  void count(TraversalCounters* counters) { context_.displacement = counters; }
  /// A hit, completed.
  DisplacedPoint resolve(const RTCRayHit& query) const
  {
    return displaced_resolve(geometry_, {}, 0.0f, query.hit.primID,
                             {query.hit.u, query.hit.v, query.hit.Ng_x, query.ray.time});
  }
  bool occluded(const oracle::Ray& ray, const LodCone& cone = {}, float time = 0)
  {
    RTCRay query = embree_ray(ray, time);
    context_.cones = &cone;
    embree_occluded1(scene_, context_, query);
    return query.tfar < 0;
  }

 private:
  DisplacedGeometry geometry_;
  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
  EmbreeContext context_;
};

inline std::string ray_text(const oracle::Ray& ray)
{
  std::ostringstream out;
  out.precision(9);
  out << "O " << ray.O[0] << " " << ray.O[1] << " " << ray.O[2] << " D " << ray.D[0] << " " << ray.D[1] << " "
      << ray.D[2] << " t in " << ray.t_min << " " << ray.t_max;
  return out.str();
}

/// Rays that got out of a closed surface.
struct Leaks {
  std::uint64_t num_closest = 0, num_shadow = 0;
  std::string first;  ///< one of them

  void trace(DisplacedScene& scene, const oracle::Ray& ray, float time = 0)
  {
    const bool closest = !(scene.intersect(ray, {}, time) < HUGE_VALF), shadow = !scene.occluded(ray, {}, time);
    if ((closest || shadow) && first.empty()) first = ray_text(ray) + " at " + std::to_string(time);
    num_closest += closest ? 1 : 0;
    num_shadow += shadow ? 1 : 0;
  }
  void expect_none(const std::string& surface) const
  {
    EXPECT_EQ(num_closest, 0u) << surface << " " << first;
    EXPECT_EQ(num_shadow, 0u) << surface << " " << first;
  }
};

}  // namespace relief
