#include "kernel/texture/ray_cone.h"

#include <gtest/gtest.h>

#include <cmath>

namespace relief {
namespace {

TEST(RayCone, PixelOfAPerspectiveCameraGrowsWithDistance)
{
  // 90° field of view, 1000 pixels: at 10 m the window is 20 m high.
  const RayCone cone = ray_cone_propagate(ray_cone_from_perspective(1.0f, 1000), 10.0f);
  EXPECT_FLOAT_EQ(cone.width, 0.02f);
}

TEST(RayCone, PixelOfAnOrthographicCameraKeepsItsWidth)
{
  const RayCone cone = ray_cone_propagate(ray_cone_from_orthographic(2.0f, 1000), 1e4f);
  EXPECT_FLOAT_EQ(cone.width, 0.004f);
}

TEST(RayCone, MirrorsKeepTheSpreadAndRoughnessOnlyWidensIt)
{
  const RayCone cone{0.1f, 0.001f};
  EXPECT_EQ(ray_cone_scatter(cone, 0.0f).spread, cone.spread);
  float last = 0;
  for (float alpha = 0.0f; alpha <= 1.0f; alpha += 0.05f) {
    const RayCone next = ray_cone_scatter(cone, alpha);
    EXPECT_EQ(next.width, cone.width);
    EXPECT_GE(next.spread, last);
    EXPECT_LE(next.spread, kMaxConeSpread);
    last = next.spread;
  }
}

TEST(RayCone, SpreadIsTheMedianTiltOfGgx)
{
  // Fraction of GGX microfacet area (projected) below tilt θ: tan²θ / (α² + tan²θ).
  for (const double alpha : {0.01, 0.1, 0.3}) {
    const double tan_half =
        std::tan(0.5 * static_cast<double>(ray_cone_spread_from_roughness(static_cast<float>(alpha))));
    EXPECT_NEAR(tan_half * tan_half / (alpha * alpha + tan_half * tan_half), 0.5, 1e-6);
  }
}

TEST(RayConeFootprint, HasTheAreaOfTheConesSection)
{
  const RayCone cone{0.2f, 0.0f};
  const double cosine = 0.25;
  const double width = static_cast<double>(ray_cone_footprint_world(cone, static_cast<float>(cosine)));
  EXPECT_NEAR(width * width, 0.2 * 0.2 / cosine, 1e-6);
}

TEST(RayConeFootprint, ScalesFromMetresToUv)
{
  // A 4 m × 1 m wall with one texture over it: areas 4 m² and 1.
  EXPECT_FLOAT_EQ(ray_cone_footprint_uv(0.1f, 4.0f, 1.0f), 0.05f);
  EXPECT_FLOAT_EQ(ray_cone_footprint_uv(0.1f, 4.0f, -1.0f), 0.05f);
}

TEST(RayConeFootprint, DegenerateTrianglesReadTheFinestLevel)
{
  EXPECT_EQ(ray_cone_footprint_uv(0.1f, 0.0f, 1.0f), 0.0f);
  EXPECT_EQ(ray_cone_footprint_uv(0.1f, 0.0f, 0.0f), 0.0f);
  EXPECT_EQ(ray_cone_footprint_uv(0.1f, 1.0f, 0.0f), 0.0f);
  EXPECT_EQ(ray_cone_footprint_uv(0.1f, kInfinity, kInfinity), 0.0f);
  EXPECT_EQ(ray_cone_footprint_world({0.1f, 0.0f}, 0.0f), kInfinity);
  EXPECT_EQ(ray_cone_footprint_world({0.1f, 0.0f}, -1e-9f), kInfinity);
}

}  // namespace
}  // namespace relief
