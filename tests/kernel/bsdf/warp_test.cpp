// Each warp as a trio: the inverse undoes it, its density integrates to one, and its points follow the density (χ²).
#include <gtest/gtest.h>

#include "kernel/bsdf/ggx.h"
#include "kernel/sample/warp.h"
#include "tests/support/chi2.h"

namespace relief {
namespace {

/// A map of the square to directions, its inverse and its density, as the tests see them.
struct Warp {
  std::string name;
  std::function<Vec3f(Vec2f)> map;
  std::function<Vec2f(Vec3f)> inverse;
  std::function<double(Vec3f)> pdf;
  double inverse_error;  ///< allowed; cosines near 1 keep few digits of the angle
};

std::vector<Warp> directional_warps()
{
  std::vector<Warp> warps = {
      {"cosine hemisphere", warp_cosine_hemisphere, warp_cosine_hemisphere_inverse,
       [](Vec3f w) { return static_cast<double>(warp_cosine_hemisphere_pdf(w.z)); }, 1e-5},
      {"hemisphere", warp_hemisphere, warp_hemisphere_inverse,
       [](Vec3f w) { return w.z > 0.0f ? static_cast<double>(warp_hemisphere_pdf()) : 0.0; }, 1e-5},
      {"sphere", warp_sphere, warp_sphere_inverse, [](Vec3f) { return static_cast<double>(warp_sphere_pdf()); }, 1e-5},
      {"cone of 60 degrees", [](Vec2f u) { return warp_cone(0.5f, u); },
       [](Vec3f w) { return warp_cone_inverse(0.5f, w); },
       [](Vec3f w) { return w.z > 0.5f ? static_cast<double>(warp_cone_pdf(0.5f)) : 0.0; }, 1e-5},
  };
  for (const float z : {1.0f, 0.6f, 0.05f}) {
    for (const float alpha : {0.15f, 0.5f, 1.0f}) {
      const Vec3f wo{std::sqrt(1.0f - z * z), 0.0f, z};
      warps.push_back(
          {"GGX visible normals, z " + std::to_string(z) + ", alpha " + std::to_string(alpha),
           [wo, alpha](Vec2f u) { return warp_ggx_visible_normal(wo, alpha, u); },
           [wo, alpha](Vec3f wm) { return warp_ggx_visible_normal_inverse(wo, alpha, wm); },
           [wo, alpha](Vec3f wm) { return static_cast<double>(warp_ggx_visible_normal_pdf(wo, alpha, wm)); }, 2e-3});
    }
  }
  return warps;
}

TEST(Warp, InverseUndoesIt)
{
  TestRandom random(1);
  for (const Warp& warp : directional_warps()) {
    for (int n = 0; n < 2000; ++n) {
      const Vec2f u{0.001f + 0.998f * random.next(), 0.001f + 0.998f * random.next()};
      const Vec3f w = warp.map(u);
      const Vec2f back = warp.inverse(w);
      ASSERT_NEAR(static_cast<double>(length(w)), 1.0, 1e-6) << warp.name;
      ASSERT_NEAR(back.x, u.x, warp.inverse_error) << warp.name << " " << u.x << " " << u.y;
      ASSERT_NEAR(back.y, u.y, warp.inverse_error) << warp.name << " " << u.x << " " << u.y;
    }
  }
}

// Significance 1 % for all warps together (Šidák), a million samples each, seed = index.
TEST(Warp, FollowsItsDensity)
{
  const std::vector<Warp> warps = directional_warps();
  for (std::size_t i = 0; i < warps.size(); ++i) {
    TestRandom random(i);
    Chi2Histogram histogram(20, 32);
    for (int n = 0; n < 1000000; ++n) {
      const float u = random.next();
      const Vec3f w = warps[i].map({u, random.next()});
      histogram.add(w.x, w.y, w.z);
    }
    const Chi2Result result = histogram.test([&](double x, double y, double z) {
      return warps[i].pdf({static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)});
    });
    EXPECT_GT(result.p_value, sidak_threshold(0.01, static_cast<int>(warps.size())))
        << warps[i].name << ", seed " << i << ": statistic " << result.statistic << ", degrees of freedom "
        << result.degrees_of_freedom << " " << result.failure;
  }
}

TEST(WarpGgxVisibleNormal, DensityIsThatOfVisibleNormals)
{
  TestRandom random(2);
  for (int n = 0; n < 5000; ++n) {
    const float alpha = 0.002f + 0.998f * random.next();
    const Vec3f wo = warp_hemisphere({0.001f + 0.999f * random.next(), random.next()});
    const float u = random.next();
    const Vec3f wm = warp_ggx_visible_normal(wo, alpha, {u, random.next()});
    // Heitz 2018, Eq. 3, in double from D and G1 as Walter et al. 2007 wrote them.
    const double tan2 = (1.0 - static_cast<double>(wm.z) * wm.z) / (static_cast<double>(wm.z) * wm.z);
    const double a2 = static_cast<double>(alpha) * alpha;
    const double sin2 = static_cast<double>(wm.x) * wm.x + static_cast<double>(wm.y) * wm.y;
    const double cos4 = std::pow(static_cast<double>(wm.z), 4.0);
    const double D = a2 / (3.14159265358979 * cos4 * std::pow(a2 + sin2 / (static_cast<double>(wm.z) * wm.z), 2.0));
    const double z = static_cast<double>(wo.z);
    const double G1 = 2.0 / (1.0 + std::sqrt(1.0 + a2 * (1.0 - z * z) / (z * z)));
    const double expected = G1 * std::max(0.0, static_cast<double>(dot(wo, wm))) * D / z;
    ASSERT_NEAR(static_cast<double>(warp_ggx_visible_normal_pdf(wo, alpha, wm)), expected, 1e-4 * expected)
        << n << " alpha " << alpha << " tan² " << tan2;
  }
}

TEST(WarpDisk, InverseUndoesItAndStaysInside)
{
  TestRandom random(3);
  for (int n = 0; n < 5000; ++n) {
    const Vec2f u{random.next(), random.next()};
    const Vec2f p = warp_disk(u);
    ASSERT_LE(dot(p, p), 1.0f + 1e-6f);
    const Vec2f back = warp_disk_inverse(p);
    ASSERT_NEAR(back.x, u.x, 1e-5);
    ASSERT_NEAR(back.y, u.y, 1e-5);
  }
  EXPECT_EQ(warp_disk_inverse(warp_disk({0.5f, 0.5f})), (Vec2f{0.5f, 0.5f}));
}

TEST(WarpDisk, KeepsAreas)
{
  // The area of a small square's image over the square's is π everywhere.
  TestRandom random(4);
  for (int n = 0; n < 1000; ++n) {
    const Vec2f u{0.01f + 0.97f * random.next(), 0.01f + 0.97f * random.next()};
    // A square across a diagonal has its image bent there.
    if (std::abs(std::abs(u.x - 0.5f) - std::abs(u.y - 0.5f)) < 0.02f) continue;
    constexpr float h = 5e-3f;
    const Vec2f a = warp_disk(u), b = warp_disk({u.x + h, u.y}), c = warp_disk({u.x, u.y + h});
    const float area = std::abs((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x)) / (h * h);
    ASSERT_NEAR(area * warp_disk_pdf(), 1.0f, 0.03f) << u.x << " " << u.y;
  }
}

TEST(WarpPolygon, InverseUndoesItAndAreasAreKept)
{
  TestRandom random(6);
  for (const int corners : {3, 4, 5, 7, 16}) {
    const double n = corners;
    EXPECT_NEAR(warp_polygon_pdf(corners) * n / 2 * std::sin(2 * std::acos(-1.0) / n), 1, 1e-6);
    for (int k = 0; k < 1000; ++k) {
      const Vec2f u{0.99f * random.next(), 0.01f + 0.98f * random.next()};
      const Vec2f p = warp_polygon(u, corners), back = warp_polygon_inverse(p, corners);
      ASSERT_NEAR(back.x, u.x, 2e-5) << corners;
      ASSERT_NEAR(back.y, u.y, 1e-5) << corners;
      // The area of a small square's image over the square's, but across a corner, where it is bent.
      constexpr float h = 2e-3f;
      if (std::floor(u.x * static_cast<float>(corners)) != std::floor((u.x + h) * static_cast<float>(corners)))
        continue;
      const Vec2f b = warp_polygon({u.x + h, u.y}, corners), c = warp_polygon({u.x, u.y + h}, corners);
      const float area = std::abs((b.x - p.x) * (c.y - p.y) - (b.y - p.y) * (c.x - p.x)) / (h * h);
      ASSERT_NEAR(area * warp_polygon_pdf(corners), 1.0f, 0.07f) << corners << ": " << u.x << " " << u.y;
    }
  }
}

TEST(WarpTriangle, IsUniformAndInvertible)
{
  TestRandom random(5);
  constexpr int kSamples = 400000;
  double moments[3] = {0, 0, 0};
  for (int n = 0; n < kSamples; ++n) {
    const Vec2f u{random.next(), random.next()};
    const Vec2f b = warp_triangle(u);
    ASSERT_TRUE(b.x >= 0.0f && b.y >= 0.0f && b.x + b.y <= 1.0f + 1e-6f);
    const Vec2f back = warp_triangle_inverse(b);
    ASSERT_NEAR(back.x, u.x, 1e-5);
    ASSERT_NEAR(back.y, u.y, 1e-4);
    moments[0] += static_cast<double>(b.x);
    moments[1] += static_cast<double>(b.y);
    moments[2] += static_cast<double>(b.x) * b.y;
  }
  // Means of the uniform density: 1/3, 1/3, 1/12; five standard deviations (0.236 and 0.078 over √samples).
  EXPECT_NEAR(moments[0] / kSamples, 1.0 / 3.0, 5.0 * 0.236 / std::sqrt(kSamples));
  EXPECT_NEAR(moments[1] / kSamples, 1.0 / 3.0, 5.0 * 0.236 / std::sqrt(kSamples));
  EXPECT_NEAR(moments[2] / kSamples, 1.0 / 12.0, 5.0 * 0.078 / std::sqrt(kSamples));
}

TEST(WarpCone, SmallConesKeepTheirDigits)
{
  const float one_minus_cos = 1e-9f;  // half angle 4.5e-5 rad, whose cosine is 1 in float
  const Vec3f w = warp_cone(one_minus_cos, {0.7f, 0.1f});
  const double angle = std::sqrt(static_cast<double>(w.x) * w.x + static_cast<double>(w.y) * w.y);
  EXPECT_NEAR(angle, std::sqrt(2.0 * 0.7e-9), 1e-9);
  EXPECT_NEAR(warp_cone_inverse(one_minus_cos, w).x, 0.7f, 1e-5f);
}

}  // namespace
}  // namespace relief
