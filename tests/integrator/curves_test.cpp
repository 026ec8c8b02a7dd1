// Curves as rays meet them: outlines, furnaces and shadows with known answers, of tubes and ribbons.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/render_scene.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

/// A curve through points, laid out as Mesh asks.
Mesh curve_mesh(const std::vector<Vec3f>& points, float radius, bool are_ribbons)
{
  Mesh mesh;
  mesh.P.push_back(points.front());
  mesh.P.insert(mesh.P.end(), points.begin(), points.end());
  mesh.P.push_back(points.back());
  mesh.radius.assign(mesh.P.size(), radius);
  mesh.are_ribbons = are_ribbons;
  for (std::uint32_t i = 1; i + 2 < mesh.P.size(); ++i) mesh.triangles.push_back({i, i + 1, i});
  return mesh;
}

/// Straight, along x, beyond the picture on both sides: the camera sees 1.6 m at the origin.
Mesh straight(float radius, bool are_ribbons)
{
  return curve_mesh({{-3, 0, 0}, {-1, 0, 0}, {0.2f, 0, 0}, {1, 0, 0}, {3, 0, 0}}, radius, are_ribbons);
}

Material glowing()
{
  Material m = diffuse_material({0, 0, 0});
  m.emission = {1, 1, 1};
  m.double_sided = true;
  return m;
}

RenderOptions options_of(const Scene& scene, int size, int samples)
{
  RenderOptions options = render_options(scene, size, samples);
  options.aov_mask = aov_bit(Aov::kBeauty);
  return options;
}

class Curves : public testing::TestWithParam<bool> {};

// A tube hides what is within its radius, as seen from the camera 4 m away: the tangents to a circle. A ribbon's edges are in the
// plane of its axis.
TEST_P(Curves, CoverTheirOutline)
{
  for (const float scale : {1.0f, 2.0f}) {
    Scene scene = empty_scene();
    add_object(scene, straight(0.1f, GetParam()), glowing(), {{scale, 0, 0}, {0, scale, 0}, {0, 0, scale}, {}});
    const double radius = 0.1 * static_cast<double>(scale);
    const double half_width = GetParam() ? radius : 4 * radius / std::sqrt(16 - radius * radius);
    const Estimate seen = estimate_mean(scene, options_of(scene, 16, 64), 8);
    EXPECT_NEAR(seen.mean, half_width / 1.6, 5 * seen.standard_error + 2e-4) << scale;
  }
}

// What leaves a convex white surface in an even glow comes back as bright: nothing is lost to shadows that a tube casts on itself.
TEST(CurveSurfaces, WhiteTubesVanishInAWhiteFurnace)
{
  for (const float radius : {1e-4f, 0.01f, 0.3f}) {
    Scene scene = empty_scene();
    add_object(scene, straight(radius, false), diffuse_material({1, 1, 1}));
    scene.cameras.front().camera.half_width = scene.cameras.front().camera.half_height = 0.1f * radius;
    scene.environment.color = {1, 1, 1};
    scene.render.max_bounces = scene.render.diffuse_bounces = 60;
    const Estimate seen = estimate_mean(scene, options_of(scene, 8, 16), 8);
    EXPECT_NEAR(seen.mean, 1.0, 1e-4) << radius;
  }
}

// A ribbon's normal at its middle is that of the tube, and it never hides itself: under a lamp behind the camera it is as bright as a
// diffuse surface that faces the lamp.
TEST(CurveSurfaces, TheMiddleOfARibbonFacesTheRay)
{
  Scene scene = empty_scene();
  add_object(scene, straight(0.2f, true), diffuse_material({0.5f, 0.5f, 0.5f}));
  Light sun;
  sun.kind = LightKind::kSun;
  sun.axis = {0, 0, -1};
  sun.emission = {kPi, kPi, kPi};
  scene.lights.push_back(sun);
  scene.cameras.front().camera.half_width = scene.cameras.front().camera.half_height = 1e-3f;
  const Rendered picture = render_scene(scene, options_of(scene, 4, 4));
  EXPECT_NEAR(picture.mean(), 0.5, 1e-3);
}

Mesh point_mesh(const std::vector<Vec3f>& points, float radius)
{
  Mesh mesh;
  mesh.P = points;
  mesh.radius.assign(points.size(), radius);
  mesh.are_points = true;
  for (std::uint32_t i = 0; i < points.size(); ++i) mesh.triangles.push_back({i, i, i});
  return mesh;
}

// A ball hides a disk as seen from the camera 4 m away, which sees 1.6 m: the tangents to a circle.
TEST(Points, CoverTheirOutline)
{
  for (const float scale : {1.0f, 2.0f}) {
    Scene scene = empty_scene();
    const Affine3 world{{scale, 0, 0}, {0, scale, 0}, {0, 0, scale}, {}};
    add_object(scene, point_mesh({{-0.15f, 0, 0}, {0.15f, 0, 0}}, 0.1f), glowing(), world);
    const double radius = 0.1 * static_cast<double>(scale), away = 0.15 * static_cast<double>(scale);
    // A cone around an axis that leans by the angle a: an ellipse in the picture's plane.
    const double a = std::atan(away / 4), b = std::asin(radius / std::hypot(4.0, away));
    const double long_half = 2 * (std::tan(a + b) - std::tan(a - b));
    const double wide = 4 * std::sin(b) / std::sqrt(std::cos(a + b) * std::cos(a - b));
    const Estimate seen = estimate_mean(scene, options_of(scene, 16, 64), 8);
    EXPECT_NEAR(seen.mean, 2 * 3.14159265 * long_half * wide / (3.2 * 3.2), 5 * seen.standard_error + 2e-4) << scale;
  }
}

// What leaves a ball meets the others of its cloud, and not itself: between white ones in an even glow nothing is lost.
TEST(Points, AreWhiteInAWhiteFurnace)
{
  for (const float radius : {1e-3f, 0.2f}) {
    Scene scene = empty_scene();
    const float r = radius;
    add_object(scene, point_mesh({{-r, 0, 0}, {r, 0, 0}, {0, 1.6f * r, 0}, {0, 0.5f * r, r}}, r),
               diffuse_material({1, 1, 1}));
    scene.cameras.front().camera.half_width = scene.cameras.front().camera.half_height = 0.3f * radius;
    scene.environment.color = {1, 1, 1};
    scene.render.max_bounces = scene.render.diffuse_bounces = 60;
    const Estimate seen = estimate_mean(scene, options_of(scene, 8, 16), 8);
    EXPECT_NEAR(seen.mean, 1.0, 5 * seen.standard_error + 1e-4) << radius;
  }
}

// One in front of another keeps the sun from it.
TEST(Points, ShadeOneAnother)
{
  Scene scene = empty_scene();
  add_object(scene, point_mesh({{0, 0, 0}, {0, 1.0f, 0}}, 0.3f), diffuse_material({0.5f, 0.5f, 0.5f}));
  Light sun;
  sun.kind = LightKind::kSun;
  sun.axis = {0, -1, 0};
  sun.emission = {kPi, kPi, kPi};
  scene.lights.push_back(sun);
  scene.render.max_bounces = scene.render.diffuse_bounces = 0;
  scene.cameras.front().camera.half_width = scene.cameras.front().camera.half_height = 0.06f;
  const Rendered picture = render_scene(scene, options_of(scene, 4, 4));
  EXPECT_EQ(picture.mean(), 0.0);
}

INSTANTIATE_TEST_SUITE_P(Shapes, Curves, testing::Values(false, true), [](const auto& shape) {
  return shape.param ? "Ribbons" : "Tubes";
});

}  // namespace
}  // namespace relief::test
