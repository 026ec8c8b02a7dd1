// Rays through points of the picture, against closed forms.
#include "kernel/camera/camera_ray.h"

#include <cmath>

#include <gtest/gtest.h>

namespace relief {
namespace {

Camera perspective()
{
  Camera camera;
  camera.half_height = 0.4f;
  return camera;
}

CameraRay ray_of(const Camera& camera, float x, float y, Vec2f lens = {})
{
  return camera_ray_make(camera, camera.world_from_camera, x, y, lens, 1.0f / 90);
}

/// Where a ray crosses the plane z = −depth.
Vec2f at_depth(const CameraRay& ray, float depth)
{
  const float t = (-depth - ray.O.z) / ray.D.z;
  return {ray.O.x + t * ray.D.x, ray.O.y + t * ray.D.y};
}

TEST(CameraRay, PixelsOfAnyShapeFillTheWindow)
{
  Camera camera = perspective();
  camera.pixel_aspect = 2;
  camera_fit(camera, 160, 90);
  // The window is 2 · 160/90 times as wide as high.
  EXPECT_FLOAT_EQ(camera.half_width, 0.4f * 2 * 160 / 90);
  const Vec2f corner = at_depth(ray_of(camera, 1, 0), 3);
  EXPECT_NEAR(corner.x, 3 * 0.4 * 2 * 160 / 90, 1e-5);
  EXPECT_NEAR(corner.y, 3 * 0.4, 1e-5);
}

TEST(CameraRay, AllPointsOfALensSeeWhatIsInFocus)
{
  Camera camera = perspective();
  camera_fit(camera, 160, 90);
  camera.aperture_radius = 0.2f;
  camera.focus_distance = 5;
  for (const Projection projection : {Projection::kPerspective, Projection::kOrthographic}) {
    camera.projection = projection;
    const Vec2f expected = at_depth(ray_of(camera, 0.3f, 0.8f), 5);
    for (const Vec2f lens : {Vec2f{1, 0}, Vec2f{-0.5f, 0.8f}, Vec2f{0.1f, -3}}) {
      const CameraRay ray = ray_of(camera, 0.3f, 0.8f, lens);
      const Vec2f focus = at_depth(ray, 5);
      EXPECT_NEAR(focus.x, expected.x, 1e-5);
      EXPECT_NEAR(focus.y, expected.y, 1e-5);
      EXPECT_NEAR(length(ray.D), 1, 1e-6);
    }
  }
}

}  // namespace
}  // namespace relief
