// Whole queries from near and from afar: through Embree's boxes, instances, texture transforms and the world's metres.
// Rays that must hit something do, and what they hit is where they meet it.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "displacement/vec3d.h"
#include "integrator/scene_context.h"
#include "integrator/trace.h"
#include "tests/support/displacement_methods.h"
#include "tests/support/scene_builder.h"
#include "tests/support/test_rays.h"

namespace relief::test {
namespace {

/// Origins are this far from what they are aimed at, in sizes of the object.
constexpr double kDistances[] = {1e-2, 1, 16, 1e3, 3e4, 1e6};

/// An object of about two units' size, in its own space, and where it is.
struct Placed {
  const char* name;
  Affine3 world_from_object;
};

const Placed kPlaced[] = {
    {"as it is", {}},
    {"turned, stretched and far from the origin", {{0.6f, 0.8f, 0}, {-1.6f, 1.2f, 0}, {0, 0, 0.5f}, {300, -20, 100}}},
    {"small", {{1e-3f, 0, 0}, {0, 0, 1e-3f}, {0, -1e-3f, 0}, {1, 2, 3}}},
    {"large", {{1e4f, 0, 0}, {0, 2e4f, 0}, {5e3f, 0, 1e4f}, {0, 0, 0}}},
};

double random_between(std::mt19937_64& random, double low, double high)
{
  return std::uniform_real_distribution<double>(low, high)(random);
}

Vec3d random_direction(std::mt19937_64& random)
{
  const double z = random_between(random, -1, 1), phi = random_between(random, 0, 2 * M_PI), r = std::sqrt(1 - z * z);
  return {r * std::cos(phi), r * std::sin(phi), z};
}

Vec3d apply(const Affine3& m, Vec3d v)
{
  return v.x * to_double(m.x) + v.y * to_double(m.y) + v.z * to_double(m.z) + to_double(m.p);
}

/// A ray from `distance` away that passes a point as well as single precision can.
TraceRay ray_from(Vec3d P_world, Vec3d to, double distance)
{
  const Vec3f O = to_float(P_world - distance * to);
  return {O, to_float(P_world - to_double(O)), 0, kInfinity};
}

/// By how much a ray passes a point, metres.
double passes_by(const TraceRay& ray, Vec3d P)
{
  const Vec3d D = to_double(ray.D), v = P - to_double(ray.O);
  return length(cross(v, D)) / length(D);
}

/// Where a ray meets an object's plane z = 0.
Vec3d plane_point(const TraceRay& ray, const Affine3& m)
{
  const Vec3d O = to_double(ray.O), D = to_double(ray.D), N = cross(to_double(m.x), to_double(m.y));
  return O + dot(to_double(m.p) - O, N) / dot(D, N) * D;
}

/// A flat grid of 2 by 2 units in the plane z = 0.
Mesh grid_mesh(int quads)
{
  Mesh mesh;
  for (int j = 0; j <= quads; ++j) {
    for (int i = 0; i <= quads; ++i) {
      const float u = static_cast<float>(i) / static_cast<float>(quads),
                  v = static_cast<float>(j) / static_cast<float>(quads);
      mesh.P.push_back({2 * u - 1, 2 * v - 1, 0});
      mesh.N.push_back(as_normal({0, 0, 1}));
      mesh.uv[0].push_back({u, v});
    }
  }
  const auto at = [&](int i, int j) { return static_cast<std::uint32_t>(j * (quads + 1) + i); };
  for (int j = 0; j < quads; ++j) {
    for (int i = 0; i < quads; ++i) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  return mesh;
}

/// One displaced object, its map turned and of another scale than the mesh's uv.
Scene displaced(Mesh mesh, const Affine3& world_from_object, DisplacementMethod method, float scale)
{
  Scene scene = empty_scene();
  Material material = diffuse_material({0.5f, 0.5f, 0.5f});
  material.displacement_index = 0;
  add_object(scene, std::move(mesh), material, world_from_object);
  constexpr int kSize = 256;
  DisplacementSettings& settings = add_displacement(scene, kSize, noise_texels(kSize, 3), scale);
  settings.method = method;
  settings.height.m00 = 0.12f;
  settings.height.m01 = -0.16f;
  settings.height.m10 = 0.16f;
  settings.height.m11 = 0.12f;
  return scene;
}

class FarRays : public testing::TestWithParam<DisplacementMethod> {};

TEST_P(FarRays, OntoTheInsideOfAPlaneHitItWhereTheyMeetIt)
{
  constexpr int kQuads = 32;
  const int num_rays = static_cast<int>(num_test_rays(600'000) / (std::size(kPlaced) * std::size(kDistances)));
  for (const Placed& placed : kPlaced) {
    const Affine3& m = placed.world_from_object;
    const Scene scene = displaced(grid_mesh(kQuads), m, GetParam(), 0);
    const SceneContext context(scene, {});
    const double size = length(to_double(m.x)) + length(to_double(m.y));
    const Vec3d N = cross(to_double(m.x), to_double(m.y)) * (1 / length(cross(to_double(m.x), to_double(m.y))));
    const double position = size + length(to_double(m.p));
    for (const double distance : kDistances) {
      std::mt19937_64 random(5 + (test_part() << 32));
      std::vector<TraceRay> rays;
      while (rays.size() < static_cast<std::size_t>(num_rays)) {
        // Half of them onto edges.
        double x = random_between(random, -0.95, 0.95), y = random_between(random, -0.95, 0.95);
        if (random() % 4 == 0) x = std::round(x * kQuads / 2) * 2 / kQuads;
        if (random() % 4 == 0) y = std::round(y * kQuads / 2) * 2 / kQuads;
        Vec3d to = random_direction(random);
        if (std::abs(dot(to, N)) < 0.05) continue;
        const TraceRay ray = ray_from(apply(m, {x, y, 0}), to, distance * size);
        const Vec3d from_centre = plane_point(ray, m) - to_double(m.p);
        // Single precision may take rays from afar past the plane's edge.
        const Vec3d x_axis = to_double(m.x), y_axis = to_double(m.y);
        const double xx = dot(x_axis, x_axis), yy = dot(y_axis, y_axis), xy = dot(x_axis, y_axis),
                     px = dot(from_centre, x_axis), py = dot(from_centre, y_axis), d = xx * yy - xy * xy;
        if (std::abs(px * yy - py * xy) > 0.99 * d || std::abs(py * xx - px * xy) > 0.99 * d) continue;
        rays.push_back(ray);
      }
      const std::vector<TraceHit> hits = trace_rays(context, rays);
      std::size_t num_leaks = 0;
      double farthest = 0;
      for (std::size_t k = 0; k < rays.size(); ++k) {
        num_leaks += hits[k].hit ? 0 : 1;
        if (hits[k].hit) farthest = std::max(farthest, length(to_double(hits[k].P) - plane_point(rays[k], m)));
      }
      EXPECT_EQ(num_leaks, 0u) << placed.name << " from " << distance << " sizes";

      EXPECT_LT(farthest, 16 * 0x1p-24 * position) << placed.name << " from " << distance << " sizes";
    }
  }
}

TEST_P(FarRays, ThroughTheInsideOfAClosedSurfaceHitIt)
{
  constexpr int kColumns = 32, kRows = 16;
  constexpr float kScale = 0.3f;
  const int num_rays = static_cast<int>(num_test_rays(600'000) / (std::size(kPlaced) * std::size(kDistances)));
  // Without the seam at which a sphere's first column meets its last.
  Mesh sphere = sphere_mesh(1, kColumns, kRows, true);
  for (int r = 0; r <= kRows; ++r) {
    for (int c = 0; c <= kColumns; ++c) {
      const int same = r == 0 || r == kRows ? 0 : c % kColumns;
      sphere.uv[0].push_back(
          {static_cast<float>(same <= kColumns / 2 ? same : kColumns - same) / 4, static_cast<float>(r) / 4});
      sphere.P[static_cast<std::size_t>(r * (kColumns + 1) + c)] =
          sphere.P[static_cast<std::size_t>(r * (kColumns + 1) + same)];
      sphere.N[static_cast<std::size_t>(r * (kColumns + 1) + c)] =
          sphere.N[static_cast<std::size_t>(r * (kColumns + 1) + same)];
    }
  }
  for (const Placed& placed : kPlaced) {
    const Affine3& m = placed.world_from_object;
    const Scene scene = displaced(sphere, m, GetParam(), kScale);
    const SceneContext context(scene, {});
    const double size = length(to_double(m.x)) + length(to_double(m.y));
    const double shortest = std::min({length(to_double(m.x)), length(to_double(m.y)), length(to_double(m.z))});
    for (const double distance : kDistances) {
      std::mt19937_64 random(6 + (test_part() << 32));
      std::vector<TraceRay> rays;
      while (rays.size() < static_cast<std::size_t>(num_rays)) {
        // In the object's space the ball of half a unit is inside whatever the displacement, and in the world half of it is.
        const Vec3d inside = 0.25 * std::cbrt(random_between(random, 0, 1)) * random_direction(random);
        const Vec3d P = apply(m, inside);
        Vec3d to = random_direction(random);
        // Every second one through a vertex's displacement line, or a point of an edge.
        if (random() % 2 == 0) {
          const TriangleIndices tri = sphere.triangles[random() % sphere.triangles.size()];
          const double along = random() % 2 == 0 ? 0 : random_between(random, 0, 1);
          const Vec3d target = (1 - along) * to_double(sphere.P[tri.v0]) + along * to_double(sphere.P[tri.v1]);
          to = apply(m, target) - P;
          to = to * (1 / length(to));
        }
        const TraceRay ray = ray_from(P, random() % 2 == 0 ? to : -1.0 * to, distance * size);
        if (passes_by(ray, P) < 0.2 * shortest) rays.push_back(ray);
      }
      const std::vector<TraceHit> hits = trace_rays(context, rays);
      const auto num_leaks = std::count_if(hits.begin(), hits.end(), [](const TraceHit& hit) { return !hit.hit; });
      EXPECT_EQ(num_leaks, 0) << placed.name << " from " << distance << " sizes";
    }
  }
}

TEST_P(FarRays, MeetASmallThingInALargeSceneFromItsOtherEnd)
{
  Scene scene =
      displaced(grid_mesh(32), {{0.01f, 0, 0}, {0, 0.01f, 0}, {0, 0, 0.01f}, {0.5f, 0.25f, 0}}, GetParam(), 0);
  Material plain = diffuse_material({0.5f, 0.5f, 0.5f});
  add_object(scene, quad_mesh({-1000, -1000, -1}, {2000, 0, 0}, {0, 2000, 0}), plain);
  const SceneContext context(scene, {});
  std::mt19937_64 random(8);
  std::vector<TraceRay> rays;
  while (rays.size() < 20'000) {
    const Vec3d P{0.5 + random_between(random, -0.009, 0.009), 0.25 + random_between(random, -0.009, 0.009), 0};
    const Vec3d to{random_between(random, -1, 1), random_between(random, -1, 1), -0.5};
    const TraceRay ray = ray_from(P, to, 900);
    if (passes_by(ray, P) < 0.0005) rays.push_back(ray);
  }
  int num_leaks = 0;
  for (const TraceHit& hit : trace_rays(context, rays)) num_leaks += hit.hit && hit.instance_index == 0 ? 0 : 1;
  EXPECT_EQ(num_leaks, 0);
}

TEST(FarRaysOnPlainMeshes, HitThemWhetherInPlaceOrInstances)
{
  for (const bool instanced : {false, true}) {
    for (const Placed& placed : kPlaced) {
      const Affine3& m = placed.world_from_object;
      Scene scene = empty_scene();
      add_object(scene, quad_mesh({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}), diffuse_material({0.5f, 0.5f, 0.5f}), m);
      if (instanced) scene.instances.push_back(scene.instances[0]);
      const SceneContext context(scene, {});
      const double size = length(to_double(m.x)) + length(to_double(m.y));
      // From 16 lengths on rays are moved, of instances from one.
      for (const double distance : {1e-2, 0.9, 1.1, 4.0, 15.0, 17.0, 1e3, 3e4, 1e6}) {
        std::mt19937_64 random(9);
        std::vector<TraceRay> rays;
        while (rays.size() < 1000) {
          const Vec3d P = apply(m, {random_between(random, -0.5, 0.5), random_between(random, -0.5, 0.5), 0});
          const TraceRay ray = ray_from(P, to_double(m.z) * (1 / length(to_double(m.z))), distance * size);
          if (passes_by(ray, P) < 0.1 * size) rays.push_back(ray);
        }
        const std::vector<TraceHit> hits = trace_rays(context, rays);
        const auto num_leaks = std::count_if(hits.begin(), hits.end(), [](const TraceHit& hit) { return !hit.hit; });
        EXPECT_EQ(num_leaks, 0) << placed.name << (instanced ? ", twice, from " : " from ") << distance << " sizes";
      }
    }
  }
}

/// A lamp so far away that rays from behind it are moved past it, to the things: they meet it before.
TEST(FarRaysOnLamps, MeetThemAndTheThingsBehindThem)
{
  constexpr float kHeight = 3e5f, kRadius = 1e3f;
  constexpr unsigned kThing = 0, kLamp = 1, kNothing = RTC_INVALID_GEOMETRY_ID;
  Scene scene = empty_scene();
  add_object(scene, quad_mesh({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}), diffuse_material({0.5f, 0.5f, 0.5f}));
  Light lamp;
  lamp.P = {0, 0, kHeight};
  lamp.radius = kRadius;
  lamp.emission = {1, 1, 1};
  scene.lights.push_back(lamp);
  const SceneContext context(scene, {});
  struct Case {
    Vec3f O, to;
    unsigned object;
    float t;  ///< metres
  };
  const float slanted = length(Vec3f{1e5f, 0, 1e6f});
  const Case cases[8] = {
      {{0, 0, 2}, {0, 0, kHeight}, kLamp, kHeight - kRadius - 2},
      {{0, 0, 1e15f}, {0, 0, 0}, kLamp, 1e15f},
      {{0, 0, 1e5f}, {0, 0, 0}, kThing, 1e5f},
      {{0, 0, 1e5f}, {0, 0, kHeight}, kLamp, kHeight - kRadius - 1e5f},
      {{0, 0, 1e6f}, {0, 0, 0}, kLamp, 1e6f - kHeight - kRadius},
      {{1e5f, 0, 1e6f}, {0, 0, 0}, kThing, slanted},                 // beside the lamp
      {{1e5f, 0, 1e6f}, {5e4f, 0, 0}, kNothing, 0},                  // beside both
      {{0, 5e4f, kHeight}, {0, 0, kHeight}, kLamp, 5e4f - kRadius},  // away from the thing
  };
  const auto expect = [&](unsigned i, unsigned object, float t) {
    EXPECT_EQ(object, cases[i].object) << i;
    if (object != kNothing) {
      EXPECT_NEAR(t, cases[i].t, 1e-5f * cases[i].t) << i;
    }
  };
  EmbreeContext embree;
  embree_context_init(embree, false);
  RTCRayHit8 packet;
  auto* const rays = reinterpret_cast<RTCRayHitN*>(&packet);
  for (unsigned i = 0; i < 8; ++i) {
    const Vec3f O = cases[i].O, D = normalize(cases[i].to - O);
    RTCRayHit ray{};
    ray.ray = {O.x, O.y, O.z, 0, D.x, D.y, D.z, 0, kInfinity, kRayBounce, i, 0};
    ray.hit.geomID = ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    RTCRayN* const lanes = RTCRayHitN_RayN(rays, 8);
    RTCRayN_org_x(lanes, 8, i) = O.x;
    RTCRayN_org_y(lanes, 8, i) = O.y;
    RTCRayN_org_z(lanes, 8, i) = O.z;
    RTCRayN_tnear(lanes, 8, i) = 0;
    RTCRayN_dir_x(lanes, 8, i) = D.x;
    RTCRayN_dir_y(lanes, 8, i) = D.y;
    RTCRayN_dir_z(lanes, 8, i) = D.z;
    RTCRayN_time(lanes, 8, i) = 0;
    RTCRayN_tfar(lanes, 8, i) = kInfinity;
    RTCRayN_mask(lanes, 8, i) = kRayBounce;
    RTCRayN_id(lanes, 8, i) = i;
    RTCRayN_flags(lanes, 8, i) = 0;
    rtcCopyHitToHitN(RTCRayHitN_HitN(rays, 8), &ray.hit, 8, i);
    context.accel->intersect(embree, ray);
    expect(i, ray.hit.geomID, ray.ray.tfar);
  }
  context.accel->intersect8(embree, packet);
  for (unsigned i = 0; i < 8; ++i) expect(i, packet.hit.geomID[i], packet.ray.tfar[i]);
}

/// All but Embree's grids, which let single rays from afar through.
std::vector<DisplacementMethod> methods_from_afar()
{
  std::vector<DisplacementMethod> methods(std::begin(kDisplacementMethods), std::end(kDisplacementMethods));
  std::erase(methods, DisplacementMethod::tessellate_grid);
  return methods;
}

INSTANTIATE_TEST_SUITE_P(Methods, FarRays, testing::ValuesIn(methods_from_afar()), method_test_name);

}  // namespace
}  // namespace relief::test
