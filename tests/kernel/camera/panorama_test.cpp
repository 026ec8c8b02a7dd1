// Panoramas against closed forms in double precision, written down for themselves.
#include "kernel/camera/panorama.h"

#include <cmath>
#include <numbers>
#include <string>

#include <gtest/gtest.h>

#include "kernel/camera/camera_ray.h"
#include "tests/support/chi2.h"

namespace relief {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;

Panorama panorama(PanoramaKind kind)
{
  Panorama p;
  p.kind = kind;
  // An angle of .04 radians a millimetre, and a little less further out.
  p.k[1] = 0.04f;
  p.k[2] = -1e-4f;
  p.k[3] = -1e-5f;
  return p;
}

constexpr PanoramaKind kKinds[] = {
    PanoramaKind::kEquirectangular, PanoramaKind::kCylindrical, PanoramaKind::kEquidistant, PanoramaKind::kEquisolid,
    PanoramaKind::kPolynomial,      PanoramaKind::kMirrorBall,  PanoramaKind::kCubeFace};

/// How far two directions are from each other.
double off(Vec3f D, double x, double y, double z)
{
  const double dx = static_cast<double>(D.x) - x, dy = static_cast<double>(D.y) - y, dz = static_cast<double>(D.z) - z;
  return std::sqrt(dx * dx + dy * dy + dz * dz);
}

TEST(Panorama, LooksAheadInTheMiddleAndUpAbove)
{
  for (const PanoramaKind kind : kKinds) {
    EXPECT_LT(off(panorama_point(panorama(kind), 0, 0).D, 0, 0, -1), 1e-6) << static_cast<int>(kind);
    const Vec3f up = panorama_point(panorama(kind), 0, 0.3f).D, right = panorama_point(panorama(kind), 0.3f, 0).D;
    EXPECT_GT(up.y, 0.1f);
    EXPECT_NEAR(up.x, 0, 1e-6);
    EXPECT_GT(right.x, 0.1f);
    EXPECT_NEAR(right.y, 0, 1e-6);
  }
}

TEST(Panorama, EquirectangularKeepsToItsRanges)
{
  Panorama p = panorama(PanoramaKind::kEquirectangular);
  p.longitude_min = -0.5f;
  p.longitude_max = 2;
  p.latitude_min = -0.25f;
  p.latitude_max = 1;
  for (const auto& [x, y] : {std::pair{-1.0f, -1.0f}, {1.0f, 1.0f}, {0.2f, -0.7f}}) {
    const double longitude = -0.5 + 2.5 * (1 + static_cast<double>(x)) / 2;
    const double latitude = -0.25 + 1.25 * (1 + static_cast<double>(y)) / 2;
    EXPECT_LT(off(panorama_point(p, x, y).D, std::cos(latitude) * std::sin(longitude), std::sin(latitude),
                  -std::cos(latitude) * std::cos(longitude)),
              1e-6);
  }
}

TEST(Panorama, CylinderShowsHeightsStraight)
{
  Panorama p = panorama(PanoramaKind::kCylindrical);
  p.height_min = -0.5f;
  p.height_max = 2;
  const double size = std::hypot(1.0, 2.0);
  EXPECT_LT(off(panorama_point(p, 0.5f, 1).D, 1 / size, 2 / size, 0), 1e-6);
}

/// Of a fisheye: the angle from ahead of a point so many parts of the picture's half width to the right.
double angle_of_point(const Panorama& p, float x)
{
  const Vec3f D = panorama_point(p, x, 0).D;
  return std::atan2(static_cast<double>(D.x), -static_cast<double>(D.z));
}

TEST(Panorama, FisheyesHaveTheirAngles)
{
  Panorama even = panorama(PanoramaKind::kEquidistant);
  even.half_field = 2;
  EXPECT_NEAR(angle_of_point(even, 0.6f), 1.2, 1e-6);
  Panorama solid = panorama(PanoramaKind::kEquisolid);
  EXPECT_NEAR(angle_of_point(solid, 0.6f), 2 * std::asin(0.6 * 18 / (2 * 10.5)), 1e-6);
  const Panorama lens = panorama(PanoramaKind::kPolynomial);
  const double r = 0.6 * 18;
  EXPECT_NEAR(angle_of_point(lens, 0.6f), 0.04 * r - 1e-4 * r * r - 1e-5 * r * r * r, 1e-6);
  // A ball's normal is halfway between what it shows and the eye.
  EXPECT_NEAR(angle_of_point(panorama(PanoramaKind::kMirrorBall), 0.6f), 2 * std::asin(0.6), 1e-6);
  EXPECT_NEAR(angle_of_point(panorama(PanoramaKind::kCubeFace), 0.6f), 0.6 * kTurn / 8, 1e-6);
}

TEST(Panorama, LensesShowNothingBeyondTheirField)
{
  Panorama even = panorama(PanoramaKind::kEquidistant);
  EXPECT_TRUE(is_zero(panorama_point(even, 0.8f, 0.7f).D));
  EXPECT_FALSE(is_zero(panorama_point(even, 0.7f, 0.7f).D));
  Panorama solid = panorama(PanoramaKind::kEquisolid);
  solid.half_field = 1;
  const auto edge = static_cast<float>(2 * 10.5 * std::sin(0.5) / 18);
  EXPECT_FALSE(is_zero(panorama_point(solid, edge * 0.999f, 0).D));
  EXPECT_TRUE(is_zero(panorama_point(solid, edge * 1.001f, 0).D));
  Panorama lens = panorama(PanoramaKind::kPolynomial);
  lens.half_field = 0.3f;
  EXPECT_FALSE(is_zero(panorama_point(lens, 0.4f, 0).D));
  EXPECT_TRUE(is_zero(panorama_point(lens, 0.6f, 0).D));
  EXPECT_TRUE(is_zero(panorama_point(panorama(PanoramaKind::kMirrorBall), 0.8f, -0.7f).D));
  EXPECT_TRUE(is_zero(panorama_point(even, std::nanf(""), 0).D));
}

TEST(Panorama, ProjectingUndoesLooking)
{
  TestRandom random(1);
  for (const PanoramaKind kind : kKinds) {
    const Panorama p = panorama(kind);
    for (int n = 0; n < 2000; ++n) {
      const float x = 1.8f * random.next() - 0.9f, y = 1.8f * random.next() - 0.9f;
      const Vec3f D = panorama_point(p, x, y).D;
      if (is_zero(D)) continue;
      EXPECT_NEAR(length(D), 1, 1e-6);
      const Vec2f back = panorama_project(p, D * 3.0f);
      ASSERT_NEAR(back.x, x, 2e-5) << static_cast<int>(kind) << ": " << x << " " << y;
      ASSERT_NEAR(back.y, y, 2e-5) << static_cast<int>(kind) << ": " << x << " " << y;
    }
  }
}

TEST(Panorama, StraightBehindIsNotInTheMiddle)
{
  for (const PanoramaKind kind : {PanoramaKind::kEquidistant, PanoramaKind::kEquisolid, PanoramaKind::kMirrorBall}) {
    const Vec2f behind = panorama_project(panorama(kind), {0, 0, 1});
    EXPECT_GE(std::abs(behind.x), 0.9999f) << static_cast<int>(kind);
  }
}

/// By the solid angle of a small parallelogram.
TEST(Panorama, KnowsTheSolidAngleOfAPoint)
{
  TestRandom random(2);
  for (const PanoramaKind kind : kKinds) {
    const Panorama p = panorama(kind);
    for (int n = 0; n < 500; ++n) {
      constexpr float h = 2e-3f;
      const float x = 1.6f * random.next() - 0.8f, y = 1.6f * random.next() - 0.8f;
      const PanoramaPoint at = panorama_point(p, x, y);
      const Vec3f right = panorama_point(p, x + h, y).D, left = panorama_point(p, x - h, y).D,
                  up = panorama_point(p, x, y + h).D, down = panorama_point(p, x, y - h).D;
      if (is_zero(at.D) || is_zero(right) || is_zero(left) || is_zero(up) || is_zero(down)) continue;
      const float expected = length(cross(right - left, up - down)) / (4 * h * h);
      ASSERT_NEAR(at.solid_angle, expected, 0.01f * expected + 1e-4f)
          << static_cast<int>(kind) << ": " << x << " " << y;
    }
  }
}

/// Sum of solid angles over the picture.
double whole(const Panorama& p)
{
  constexpr int kSide = 1000;
  double sum = 0;
  for (int i = 0; i < kSide * kSide; ++i) {
    const auto at = [](int k) { return 2 * (static_cast<float>(k) + 0.5f) / kSide - 1; };
    sum += static_cast<double>(panorama_point(p, at(i % kSide), at(i / kSide)).solid_angle);
  }
  return sum * 4 / (kSide * kSide);
}

TEST(Panorama, ShowsAsMuchAsItShould)
{
  EXPECT_NEAR(whole(panorama(PanoramaKind::kEquirectangular)), 2 * kTurn, 1e-3);
  EXPECT_NEAR(whole(panorama(PanoramaKind::kMirrorBall)), 2 * kTurn, 0.02);
  EXPECT_NEAR(whole(panorama(PanoramaKind::kCubeFace)), 2 * kTurn / 6, 1e-3);
  // A band of heights from −1 to 1 is what has sines of latitudes up to √½.
  EXPECT_NEAR(whole(panorama(PanoramaKind::kCylindrical)), 2 * kTurn * std::sqrt(0.5), 1e-3);
  EXPECT_NEAR(whole(panorama(PanoramaKind::kEquidistant)), kTurn, 0.02);
  Panorama solid = panorama(PanoramaKind::kEquisolid);
  solid.half_field = 1;
  EXPECT_NEAR(whole(solid), kTurn * (1 - std::cos(1.0)), 0.02);
}

/// A camera of a panorama, turned by a quarter about +Y: ahead is −X.
Camera camera_of(PanoramaKind kind)
{
  Camera camera;
  camera.projection = Projection::kPanoramic;
  camera.panorama = panorama(kind);
  camera.half_width = camera.half_height = 1;
  camera.world_from_camera = {{0, 0, -1}, {0, 1, 0}, {1, 0, 0}, {5, 6, 7}};
  camera_fit(camera, 200, 100);
  return camera;
}

CameraRay ray_of(const Camera& camera, float x, float y, Vec2f lens = {})
{
  return camera_ray_make(camera, camera.world_from_camera, x, y, lens, std::sqrt(camera.pixel_aspect) / 100);
}

TEST(PanoramicRay, StartsAtTheCameraAndIsClippedByDistance)
{
  Camera camera = camera_of(PanoramaKind::kEquirectangular);
  camera.clip_start = 2;
  camera.clip_end = 9;
  const CameraRay ray = ray_of(camera, 0.25f, 0.5f);
  EXPECT_EQ(ray.O, (Vec3f{5, 6, 7}));
  // A quarter of a turn to the left of −X.
  EXPECT_LT(off(ray.D, 0, 0, 1), 1e-6);
  EXPECT_FLOAT_EQ(ray.t_min, 2);
  EXPECT_FLOAT_EQ(ray.t_max, 9);
}

TEST(PanoramicRay, ConesAreAsWideAsPixels)
{
  // 200 × 100 pixels of 1.8° a side at the equator, and of 1.8° × .9° at 60°.
  const Camera camera = camera_of(PanoramaKind::kEquirectangular);
  EXPECT_FLOAT_EQ(camera.pixel_aspect, 0.5f);
  EXPECT_NEAR(ray_of(camera, 0.3f, 0.5f).cone_spread, kTurn / 200, 1e-6);
  EXPECT_NEAR(ray_of(camera, 0.3f, 0.5f + 1.0f / 3).cone_spread, kTurn / 200 * std::sqrt(0.5), 1e-6);
}

TEST(PanoramicRay, LensesShowNothingOutside)
{
  EXPECT_LT(ray_of(camera_of(PanoramaKind::kEquidistant), 0.01f, 0.01f).t_max, 0);
  EXPECT_GT(ray_of(camera_of(PanoramaKind::kEquidistant), 0.5f, 0.01f).t_max, 0);
}

/// All points of the lens see the same point of the ball that is in focus, and lie across the way there.
TEST(PanoramicRay, IsInFocusAtADistance)
{
  for (const PanoramaKind kind : kKinds) {
    Camera camera = camera_of(kind);
    camera.aperture_radius = 0.2f;
    camera.focus_distance = 4;
    for (const auto& [x, y] : {std::pair{0.5f, 0.5f}, {0.4f, 0.7f}}) {
      Camera pinhole = camera;
      pinhole.aperture_radius = 0;
      const CameraRay straight = ray_of(pinhole, x, y);
      const Vec3f focus = straight.O + straight.D * 4.0f;
      for (const Vec2f lens : {Vec2f{1, 0}, Vec2f{0, 1}, Vec2f{-0.6f, 0.3f}}) {
        const CameraRay ray = ray_of(camera, x, y, lens);
        EXPECT_NEAR(length(ray.O - straight.O), 0.2f * std::sqrt(dot(lens, lens)), 1e-5);
        EXPECT_NEAR(dot(ray.O - straight.O, straight.D), 0, 1e-5);
        EXPECT_NEAR(length(cross(focus - ray.O, ray.D)), 0, 1e-5) << static_cast<int>(kind);
      }
    }
  }
}

}  // namespace
}  // namespace relief
