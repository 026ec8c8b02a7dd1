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
  options.aov_mask = 1u << static_cast<int>(Aov::kBeauty);
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

INSTANTIATE_TEST_SUITE_P(Shapes, Curves, testing::Values(false, true), [](const auto& shape) {
  return shape.param ? "Ribbons" : "Tubes";
});

}  // namespace
}  // namespace relief::test
