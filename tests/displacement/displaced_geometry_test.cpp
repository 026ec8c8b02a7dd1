// The library for other programs: what its header promises, as such a program sees it.
#include "displacement/include/relief/displaced_geometry.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <vector>

namespace relief {
namespace {

/// An octahedron whose normals point away from its centre, and a map of one height or several.
struct Octahedron {
  std::vector<float> positions{1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1};
  std::vector<float> normals = positions;
  std::vector<float> uv{.1f, .2f, .9f, .1f, .5f, .9f, .2f, .7f, .8f, .6f, .4f, .3f};
  std::vector<std::uint32_t> triangles{0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5};
  std::vector<float> heights{.75f, .75f, .75f, .75f};
  float scale = .5f, midlevel = .25f;

  DisplacementSource source() const
  {
    DisplacementSource out{positions, normals, uv, triangles, heights, 2, heights.size() / 2};
    out.scale = scale;
    out.midlevel = midlevel;
    return out;
  }
};

class DisplacedGeometryTest : public testing::Test {
 protected:
  DisplacedGeometryTest() : device_(rtcNewDevice(nullptr)) {}
  ~DisplacedGeometryTest() override { rtcReleaseDevice(device_); }

  RTCScene scene_make(const DisplacedEmbreeGeometry& displaced) const
  {
    RTCScene scene = rtcNewScene(device_);
    rtcAttachGeometry(scene, displaced.geometry());
    rtcCommitScene(scene);
    return scene;
  }

  /// Of what a constructor throws.
  std::string error_of(const std::function<void(Octahedron&)>& spoil) const
  {
    Octahedron octahedron;
    spoil(octahedron);
    try {
      const DisplacedEmbreeGeometry displaced(device_, octahedron.source());
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "no error";
  }

  RTCDevice device_;
};

RTCRayHit ray_make(const std::array<float, 3>& O, const std::array<float, 3>& D)
{
  RTCRayHit ray{};
  ray.ray.org_x = O[0], ray.ray.org_y = O[1], ray.ray.org_z = O[2];
  ray.ray.dir_x = D[0], ray.ray.dir_y = D[1], ray.ray.dir_z = D[2];
  ray.ray.tfar = std::numeric_limits<float>::infinity();
  ray.ray.mask = ~0u;
  ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  return ray;
}

void trace(RTCScene scene, RTCRayHit& ray)
{
#if RTC_VERSION_MAJOR >= 4
  rtcIntersect1(scene, &ray);
#else
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(scene, &context, &ray);
#endif
}

bool is_occluded(RTCScene scene, RTCRay ray)
{
#if RTC_VERSION_MAJOR >= 4
  rtcOccluded1(scene, &ray);
#else
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(scene, &context, &ray);
#endif
  return ray.tfar < 0;
}

TEST_F(DisplacedGeometryTest, HitsAreOnTheDisplacedSurfaceAlsoOfBuffersThatAreGone)
{
  auto octahedron = std::make_unique<Octahedron>();
  const Octahedron copy = *octahedron;
  DisplacedEmbreeGeometry first(device_, octahedron->source());
  octahedron.reset();
  const DisplacedEmbreeGeometry displaced = std::move(first);
  RTCScene scene = scene_make(displaced);
  constexpr float kD = .25f;
  std::mt19937 random(1);
  std::normal_distribution<float> normal;
  for (int k = 0; k < 1000; ++k) {
    // From outside towards somewhere near the centre.
    const std::array<float, 3> to{.2f * normal(random), .2f * normal(random), .2f * normal(random)};
    std::array<float, 3> O{normal(random), normal(random), normal(random)}, D{};
    const float size = std::hypot(O[0], O[1], O[2]);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      O[axis] *= 4 / size;
      D[axis] = to[axis] - O[axis];
    }
    RTCRayHit ray = ray_make(O, D);
    trace(scene, ray);
    ASSERT_EQ(ray.hit.geomID, 0u) << k;
    ASSERT_TRUE(is_occluded(scene, ray_make(O, D).ray)) << k;
    const DisplacedSurfacePoint point = displaced.point(ray.hit.primID, ray.hit.u, ray.hit.v);
    const float b[3] = {1 - ray.hit.u - ray.hit.v, ray.hit.u, ray.hit.v};
    std::array<float, 3> base{};
    std::array<float, 2> uv{};
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t vertex = copy.triangles[3 * ray.hit.primID + c];
      for (std::size_t axis = 0; axis < 3; ++axis) base[axis] += b[c] * copy.positions[3 * vertex + axis];
      for (std::size_t axis = 0; axis < 2; ++axis) uv[axis] += b[c] * copy.uv[2 * vertex + axis];
    }
    const float base_length = std::hypot(base[0], base[1], base[2]);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(point.P[axis], base[axis] * (1 + kD / base_length), 2e-6f) << k;
      EXPECT_NEAR(point.P[axis], O[axis] + ray.ray.tfar * D[axis], 4e-6f) << k;
    }
    EXPECT_NEAR(point.uv[0], uv[0], 1e-6f);
    EXPECT_NEAR(point.uv[1], uv[1], 1e-6f);
    EXPECT_EQ(point.Ng[0], ray.hit.Ng_x);
    EXPECT_EQ(point.Ng[2], ray.hit.Ng_z);
    EXPECT_NEAR(std::hypot(ray.hit.Ng_x, ray.hit.Ng_y, ray.hit.Ng_z), 1, 1e-6f);
    EXPECT_LT(ray.hit.Ng_x * D[0] + ray.hit.Ng_y * D[1] + ray.hit.Ng_z * D[2], 0) << k;
  }
  RTCRayHit beside = ray_make({4, 3, 0}, {-1, 0, 0});
  trace(scene, beside);
  EXPECT_EQ(beside.hit.geomID, RTC_INVALID_GEOMETRY_ID);
  rtcReleaseScene(scene);
}

TEST_F(DisplacedGeometryTest, PacketsHitWhatSingleRaysHit)
{
  Octahedron octahedron;
  octahedron.heights.clear();
  for (int i = 0; i < 32; ++i) octahedron.heights.push_back(.5f + .5f * std::sin(1.7f * static_cast<float>(i)));
  const DisplacedEmbreeGeometry displaced(device_, octahedron.source());
  RTCScene scene = scene_make(displaced);
  RTCRayHit8 packet{};
  std::vector<RTCRayHit> single;
  alignas(32) int valid[8];
  for (int k = 0; k < 8; ++k) {
    const float angle = 2 * std::numbers::pi_v<float> * (static_cast<float>(k) + .3f) / 8;
    RTCRayHit ray = ray_make({4 * std::cos(angle), 4 * std::sin(angle), .1f}, {-std::cos(angle), -std::sin(angle), 0});
    valid[k] = k == 3 ? 0 : -1;
    packet.ray.org_x[k] = ray.ray.org_x, packet.ray.org_y[k] = ray.ray.org_y, packet.ray.org_z[k] = ray.ray.org_z;
    packet.ray.dir_x[k] = ray.ray.dir_x, packet.ray.dir_y[k] = ray.ray.dir_y, packet.ray.dir_z[k] = ray.ray.dir_z;
    packet.ray.tfar[k] = ray.ray.tfar;
    packet.ray.mask[k] = ~0u;
    packet.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
    trace(scene, ray);
    single.push_back(ray);
  }
#if RTC_VERSION_MAJOR >= 4
  rtcIntersect8(valid, scene, &packet);
#else
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect8(valid, scene, &context, &packet);
#endif
  for (std::size_t k = 0; k < 8; ++k) {
    if (k == 3) {
      EXPECT_EQ(packet.hit.geomID[k], RTC_INVALID_GEOMETRY_ID);
      continue;
    }
    EXPECT_EQ(packet.hit.primID[k], single[k].hit.primID) << k;
    EXPECT_EQ(packet.ray.tfar[k], single[k].ray.tfar) << k;
    EXPECT_EQ(packet.hit.Ng_x[k], single[k].hit.Ng_x) << k;
  }
  rtcReleaseScene(scene);
}

TEST_F(DisplacedGeometryTest, NormalsAreOfAnyLength)
{
  // The longest and the shortest floats whose relations are not lost, and what they are interpolated to.
  RTCRayHit expected = ray_make({1, 2, 3}, {-1.1f, -2, -2.9f});
  for (const float length : {1.f, 3e38f, 1e-35f}) {
    Octahedron octahedron;
    for (float& n : octahedron.normals) n *= length;
    const DisplacedEmbreeGeometry displaced(device_, octahedron.source());
    RTCScene scene = scene_make(displaced);
    RTCRayHit ray = ray_make({1, 2, 3}, {-1.1f, -2, -2.9f});
    trace(scene, ray);
    ASSERT_EQ(ray.hit.geomID, 0u) << length;
    if (length == 1) expected = ray;
    EXPECT_NEAR(ray.ray.tfar, expected.ray.tfar, 1e-6f) << length;
    EXPECT_NEAR(ray.hit.Ng_x, expected.hit.Ng_x, 1e-6f) << length;
    rtcReleaseScene(scene);
  }
}

TEST_F(DisplacedGeometryTest, WhatEndsBeforeItsSceneIsGoneFromIt)
{
  auto displaced = std::make_unique<DisplacedEmbreeGeometry>(device_, Octahedron().source());
  RTCScene scene = scene_make(*displaced);
  const RTCRayHit towards = ray_make({1, 2, 3}, {-1.1f, -2, -2.9f});
  RTCRayHit ray = towards;
  trace(scene, ray);
  EXPECT_EQ(ray.hit.geomID, 0u);
  displaced.reset();
  const auto expect_gone = [&] {
    RTCRayHit after = towards;
    trace(scene, after);
    EXPECT_EQ(after.hit.geomID, RTC_INVALID_GEOMETRY_ID);
    EXPECT_EQ(after.ray.tfar, towards.ray.tfar);
    EXPECT_FALSE(is_occluded(scene, towards.ray));
  };
  expect_gone();
  // Also from a tree that is built anew.
  rtcCommitGeometry(rtcGetGeometry(scene, 0));
  rtcCommitScene(scene);
  expect_gone();
  EXPECT_EQ(rtcGetDeviceError(device_), RTC_ERROR_NONE);
  rtcReleaseScene(scene);
}

TEST_F(DisplacedGeometryTest, BadInputIsNamed)
{
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::pair<std::function<void(Octahedron&)>, const char*> cases[] = {
      {[&](Octahedron& o) { o.positions[4] = nan; }, "positions[4]: expected a finite number, found nan"},
      {[&](Octahedron& o) { o.heights[1] = INFINITY; }, "heights[1]: expected a finite number, found inf"},
      {[&](Octahedron& o) { o.scale = nan; }, "scale: expected a finite number, found nan"},
      {[&](Octahedron& o) { o.midlevel = -nan; }, "midlevel: expected a finite number, found -nan"},
      {[&](Octahedron& o) { o.normals[0] = nan; }, "normals[0]: expected a finite number, found nan"},
      {[&](Octahedron& o) { o.uv[11] = nan; }, "uv[11]: expected a finite number, found nan"},
      {[](Octahedron& o) { o.scale = 4e18f; },
       "expected a surface within 1e18 of the origin, found positions up to 1, which heights move by up to 2e+18"},
      {[](Octahedron& o) { o.positions[7] = -3e38f; },
       "expected a surface within 1e18 of the origin, found positions up to 3e+38, which heights move by up to 0.25"},
      {[](Octahedron& o) { o.heights[0] = 3e38f, o.scale = 0; }, "no error"},
      {[](Octahedron& o) { o.positions.pop_back(); }, "positions: expected three entries a vertex, found 17"},
      {[](Octahedron& o) { o.triangles.clear(); }, "triangles: expected three entries a triangle, found 0"},
      {[](Octahedron& o) { o.triangles[5] = 6; }, "triangles[5]: expected the index of one of 6 vertices, found 6"},
      {[](Octahedron& o) { o.normals.resize(3); }, "normals: expected 18 entries, found 3"},
      {[](Octahedron& o) { o.normals[3] = o.normals[4] = o.normals[5] = 0; },
       "normals[3]: expected a direction, found 0 0 0"},
      {[](Octahedron& o) { o.uv.push_back(0); }, "uv: expected 12 entries, found 13"},
      {[](Octahedron& o) { o.heights.clear(); }, "expected a map of 1 to 65536 texels a side, found 2 x 0"},
      {[](Octahedron& o) { o.heights.push_back(0); }, "heights: expected 4 entries, found 5"},
  };
  const std::string none = "no error", name = "relief::DisplacementSource: ";
  for (const auto& [spoil, expected] : cases) EXPECT_EQ(error_of(spoil), expected == none ? none : name + expected);
  EXPECT_THROW(DisplacedEmbreeGeometry(nullptr, Octahedron().source()), std::invalid_argument);
}

}  // namespace
}  // namespace relief
