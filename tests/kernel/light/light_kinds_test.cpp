// Every kind of light against closed forms in double precision. Estimates are means of kScrambles independently scrambled
// Sobol sets; a test accepts |mean − truth| < 6 standard errors + rounding. With 31 degrees of freedom 6 standard errors
// are a two-sided significance of 1.2e-6; `rounding` is what the light's plane, known in float, leaves open.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "kernel/light/light_sampler.h"
#include "kernel/sample/sobol.h"
#include "tests/kernel/light/polygon_light.h"

namespace relief {
namespace {

constexpr int kScrambles = 32;

reference::Vec to_double(Vec3f v) { return {double(v.x), double(v.y), double(v.z)}; }

struct Random {
  std::uint64_t state;
  double next()
  {
    state = hash_mix(state + 0x9e3779b97f4a7c15u);
    return static_cast<double>(state >> 11) * 0x1p-53;
  }
  float between(double a, double b) { return static_cast<float>(a + (b - a) * next()); }
  Vec3f direction()
  {
    const double z = 2 * next() - 1, phi = 2 * std::numbers::pi * next(), r = std::sqrt(1 - z * z);
    return {static_cast<float>(r * std::cos(phi)), static_cast<float>(r * std::sin(phi)), static_cast<float>(z)};
  }
};

Light flat_light(LightKind kind, Vec3f P, Vec3f u, Vec3f v)
{
  Light light;
  light.kind = kind;
  light.P = P;
  light.edge_u = u;
  light.edge_v = v;
  const Vec3f n = cross(u, v);
  light.axis = normalize(n);
  light.area = length(n) * (kind == LightKind::kRectangle ? 4.0f : kind == LightKind::kDisk ? kPi : 0.5f);
  light.emission = {1, 1, 1};
  return light;
}

std::vector<reference::Vec> outline(const Light& light)
{
  using reference::add, reference::mul;
  const reference::Vec P = to_double(light.P), u = to_double(light.edge_u), v = to_double(light.edge_v);
  if (light.kind == LightKind::kTriangle) return {P, add(P, u), add(P, v)};
  if (light.kind == LightKind::kRectangle) {
    return {add(P, add(mul(u, -1), mul(v, -1))), add(P, add(u, mul(v, -1))), add(P, add(u, v)),
            add(P, add(mul(u, -1), v))};
  }
  // A polygon of the ellipse's own area; its moments differ from the ellipse's by a few 1e-7.
  const int sides = 4000;
  const double step = 2 * std::numbers::pi / sides, radius = std::sqrt(step / std::sin(step));
  std::vector<reference::Vec> points;
  points.reserve(sides);
  for (int i = 0; i < sides; ++i) {
    points.push_back(add(P, add(mul(u, radius * std::cos(i * step)), mul(v, radius * std::sin(i * step)))));
  }
  return points;
}

/// Relative error that rounding may cause: heights over the light's plane are differences of coordinates.
double rounding(const Light& light, Vec3f P)
{
  const double height = std::abs(static_cast<double>(dot(P - light.P, light.axis)));
  return 1e-5 +
         3e-7 * static_cast<double>(length(P) + length(light.P) + length(light.edge_u) + length(light.edge_v)) / height;
}

struct Estimate {
  double mean = 0, standard_error = 0;
};

/// Mean of f(LightSample) / pdf over sample sets of 2^log_n points each.
template <typename F>
Estimate estimate(const Light& light, Vec3f P, int log_n, F f)
{
  double sum = 0, squares = 0;
  const std::uint32_t n = 1u << log_n;
  for (int s = 0; s < kScrambles; ++s) {
    double mean = 0;
    for (std::uint32_t i = 0; i < n; ++i) {
      const LightSample sample = light_sample(light, P, sample_2d(static_cast<std::uint32_t>(s), 2 * i, 3));
      if (sample.pdf > 0.0f) mean += f(sample) / static_cast<double>(sample.pdf) / n;
    }
    sum += mean;
    squares += mean * mean;
  }
  const double mean = sum / kScrambles;
  return {mean, std::sqrt(std::max(squares / kScrambles - mean * mean, 0.0) / (kScrambles - 1))};
}

void expect_irradiance(const Light& light, Vec3f P, Vec3f N, double truth, int log_n = 10)
{
  const Estimate found = estimate(light, P, log_n, [N](const LightSample& sample) {
    return static_cast<double>(sample.radiance.x) * std::max(0.0, static_cast<double>(dot(sample.wi, N)));
  });
  EXPECT_LE(std::abs(found.mean - truth), 6 * found.standard_error + rounding(light, P) * truth)
      << "truth " << truth << " mean " << found.mean << " standard error " << found.standard_error << " P " << P.x
      << " " << P.y << " " << P.z << " light at " << light.P.x << " " << light.P.y << " " << light.P.z;
}

/// A light of random shape near the origin and a point that sees its front, from almost touching to far away. Oblique
/// rectangles and ellipses are sampled by area, whose estimates are not normally distributed close by: points keep off.
struct Configuration {
  Light light;
  Vec3f P, N;
};

Configuration random_configuration(LightKind kind, Random& random, bool orthogonal)
{
  const float scale = std::pow(10.0f, random.between(-3, 4));
  const Vec3f u = random.direction() * scale * random.between(0.2, 2);
  Vec3f v = random.direction() * scale * random.between(0.2, 2);
  if (orthogonal) v = cross(v, normalize(u));
  Configuration c;
  c.light = flat_light(kind, random.direction() * scale, u, v);
  const bool by_area = !orthogonal && kind != LightKind::kTriangle;
  const float distance = std::pow(10.0f, random.between(by_area ? 0.3 : -1.5, 2)) * scale;
  const Vec3f on_light = c.light.P + u * random.between(-1, 1) + v * random.between(-1, 1);
  Vec3f away = random.direction();
  if (dot(away, c.light.axis) < 0) away = -away;
  c.P = on_light + away * distance;
  c.N = normalize(random.direction() - away);
  return c;
}

class FlatLight : public ::testing::TestWithParam<LightKind> {};

TEST_P(FlatLight, IrradianceEqualsLambertsFormula)
{
  Random random{static_cast<std::uint64_t>(GetParam()) + 1};
  for (int k = 0; k < 120; ++k) {
    const Configuration c = random_configuration(GetParam(), random, k % 2 == 0);
    const double truth = reference::polygon_irradiance(outline(c.light), to_double(c.P), to_double(c.N));
    SCOPED_TRACE(k);
    expect_irradiance(c.light, c.P, c.N, truth);
  }
}

TEST_P(FlatLight, ReciprocalDensityIsTheSolidAngle)
{
  Random random{static_cast<std::uint64_t>(GetParam()) + 100};
  for (int k = 0; k < 120; ++k) {
    const Configuration c = random_configuration(GetParam(), random, k % 2 == 0);
    const double truth = reference::polygon_solid_angle(outline(c.light), to_double(c.P));
    const Estimate found = estimate(c.light, c.P, 10, [](const LightSample&) { return 1.0; });
    EXPECT_LE(std::abs(found.mean - truth), 6 * found.standard_error + rounding(c.light, c.P) * truth)
        << k << " truth " << truth;
  }
}

TEST_P(FlatLight, DensityOfAHitEqualsTheSamples)
{
  Random random{static_cast<std::uint64_t>(GetParam()) + 200};
  for (int k = 0; k < 2000; ++k) {
    const Configuration c = random_configuration(GetParam(), random, k % 2 == 0);
    const LightSample sample = light_sample(c.light, c.P, {random.between(0, 1), random.between(0, 1)});
    if (sample.pdf == 0.0f && GetParam() == LightKind::kDisk) continue;  // beside the disk
    ASSERT_GT(sample.pdf, 0.0f) << k;
    ASSERT_EQ(light_pdf(c.light, c.P, sample.wi, sample.distance), sample.pdf) << k;
    // The sample lies on the light, within the rounding of the geometry.
    const Vec3f P_light = c.P + sample.wi * sample.distance;
    const float size = max_component(abs(c.light.edge_u) + abs(c.light.edge_v) + abs(c.P) + abs(c.light.P));
    ASSERT_LT(std::abs(dot(P_light - c.light.P, c.light.axis)), 1e-5f * size) << k;
  }
}

TEST_P(FlatLight, EmitsFromItsFrontOnlyUnlessTwoSided)
{
  Light light = flat_light(GetParam(), {1, 2, 3}, {1, 0, 0}, {0, 1, 0});
  const Vec3f front{1.2f, 2.2f, 5}, back{1.2f, 2.2f, 1};
  const Vec2f u{0.3f, 0.6f};
  EXPECT_GT(light_sample(light, front, u).pdf, 0.0f);
  EXPECT_EQ(light_sample(light, back, u).pdf, 0.0f);
  EXPECT_EQ(light_emitted(light, {0, 0, -1}).x, 1.0f);
  EXPECT_EQ(light_emitted(light, {0, 0, 1}).x, 0.0f);
  light.two_sided = true;
  EXPECT_GT(light_sample(light, back, u).pdf, 0.0f);
  EXPECT_EQ(light_sample(light, back, u).radiance.x, 1.0f);
  EXPECT_EQ(light_emitted(light, {0, 0, 1}).x, 1.0f);
}

TEST_P(FlatLight, DegenerateGeometryGivesNoSampleOrAFiniteOne)
{
  const Vec3f zero{}, x{1, 0, 0}, tiny{1e-30f, 0, 0}, huge{1e15f, 0, 0};
  const Vec3f edges_v[] = {zero, x, {0, 1, 0}, {0, 1e-20f, 0}, {0, 1e-6f, 0}, {0, 1e15f, 0}, {1, 1e-7f, 0}};
  int usable = 0;
  for (const Vec3f edge_u : {zero, x, tiny, huge}) {
    for (const Vec3f edge_v : edges_v) {
      Light light = flat_light(GetParam(), {}, edge_u, edge_v);
      // As light_set.cpp leaves triangles without a normal.
      if (!(light.area > 0.0f) || !is_finite(light.axis)) {
        light.axis = {0, 0, -1};
        light.area = 0;
      }
      light.two_sided = true;
      const Vec3f points[] = {{0, 0, 1},           {0, 0, 0},     {0.1f, 0.1f, 0}, {0, 0, 1e-30f},
                              {0.2f, 0.2f, 1e-7f}, {1e20f, 0, 3}, {5, 5, 0}};
      for (const Vec3f P : points) {
        for (const Vec2f u : {Vec2f{0, 0}, Vec2f{0.5f, 0.5f}, Vec2f{0x1.fffffep-1f, 0x1.fffffep-1f}}) {
          const LightSample sample = light_sample(light, P, u);
          ASSERT_TRUE(sample.pdf >= 0.0f && is_finite(sample.pdf));
          if (sample.pdf == 0.0f) continue;
          ++usable;
          ASSERT_TRUE(is_finite(sample.wi) && is_finite(sample.radiance) && is_finite(sample.distance));
          ASSERT_NEAR(length(sample.wi), 1.0f, 1e-5f);
          ASSERT_TRUE(is_finite(light_pdf(light, P, sample.wi, sample.distance)));
        }
      }
    }
  }
  EXPECT_GT(usable, 20);
}

INSTANTIATE_TEST_SUITE_P(Kinds,
                         FlatLight,
                         ::testing::Values(LightKind::kRectangle, LightKind::kDisk, LightKind::kTriangle),
                         [](const auto& kind) {
                           return kind.param == LightKind::kRectangle ? "Rectangle"
                                  : kind.param == LightKind::kDisk    ? "Disk"
                                                                      : "Triangle";
                         });

TEST(DiskLight, IrradianceOnItsAxisEqualsTheClosedForm)
{
  // E = π L r² / (r² + h²).
  for (const float h : {0.5f, 2.0f, 50.0f}) {
    const Light light = flat_light(LightKind::kDisk, {0, 0, h}, {0, 1.5f, 0}, {1.5f, 0, 0});
    expect_irradiance(light, {}, {0, 0, 1}, std::numbers::pi * 2.25 / (2.25 + double(h) * double(h)), 12);
  }
}

/// χ² of sampled positions against solid angles of equal parts of the light. 200000 independent samples; parts expecting
/// fewer than 10 are joined with their successor.
void expect_uniform_in_solid_angle(const Light& light, Vec3f P)
{
  const int side = 8, n = 200000;
  const auto parts = static_cast<std::size_t>(light.kind == LightKind::kTriangle ? 2 * side * side : side * side);
  std::vector<double> expected(parts, 0.0);
  std::vector<int> counts(parts, 0);
  using reference::add, reference::mul;
  const reference::Vec base = to_double(light.P), eu = to_double(light.edge_u), ev = to_double(light.edge_v);
  const bool is_triangle = light.kind == LightKind::kTriangle;
  const auto at = [&](int i, int j) {
    const double u = static_cast<double>(i) / side, v = static_cast<double>(j) / side;
    return is_triangle ? add(base, add(mul(eu, u), mul(ev, v)))
                       : add(base, add(mul(eu, 2 * u - 1), mul(ev, 2 * v - 1)));
  };
  double total = 0;
  for (int i = 0; i < side; ++i) {
    for (int j = 0; j < side; ++j) {
      const auto cell = static_cast<std::size_t>(i * side + j);
      const auto p = to_double(P);
      if (is_triangle) {
        if (i + j < side)
          expected[2 * cell] = reference::polygon_solid_angle({at(i, j), at(i + 1, j), at(i, j + 1)}, p);
        if (i + j + 2 <= side) {
          expected[2 * cell + 1] = reference::polygon_solid_angle({at(i + 1, j + 1), at(i + 1, j), at(i, j + 1)}, p);
        }
        total += expected[2 * cell] + expected[2 * cell + 1];
      } else {
        expected[cell] = reference::polygon_solid_angle({at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)}, p);
        total += expected[cell];
      }
    }
  }
  for (int k = 0; k < n; ++k) {
    const LightSample sample = light_sample(light, P, sample_2d(sample_pixel_hash(3, k, 0), 0, 0));
    ASSERT_GT(sample.pdf, 0.0f);
    const Vec3f q = P + sample.wi * sample.distance - light.P;
    Vec2f st = sample.barycentric;
    if (!is_triangle) {
      st = {0.5f + 0.5f * dot(q, light.edge_u) / length_squared(light.edge_u),
            0.5f + 0.5f * dot(q, light.edge_v) / length_squared(light.edge_v)};
    }
    const int i = std::clamp(static_cast<int>(st.x * side), 0, side - 1);
    const int j = std::clamp(static_cast<int>(st.y * side), 0, side - 1);
    const auto cell = static_cast<std::size_t>(i * side + j);
    const bool upper = st.x * side - static_cast<float>(i) + st.y * side - static_cast<float>(j) > 1.0f;
    ++counts[is_triangle ? 2 * cell + (upper && i + j + 2 <= side ? 1 : 0) : cell];
  }
  double chi_squared = 0, waiting_expected = 0, waiting_count = 0;
  int degrees = -1;
  for (std::size_t i = 0; i < parts; ++i) {
    waiting_expected += expected[i] / total * n;
    waiting_count += counts[i];
    if (waiting_expected < 10) continue;
    chi_squared += (waiting_count - waiting_expected) * (waiting_count - waiting_expected) / waiting_expected;
    ++degrees;
    waiting_expected = waiting_count = 0;
  }
  const double v = 2.0 / (9.0 * degrees);
  const double z = (std::cbrt(chi_squared / degrees) - (1 - v)) / std::sqrt(v);
  EXPECT_LT(z, 4.5) << "chi squared " << chi_squared << " degrees " << degrees;
}

TEST(RectangleLight, PositionsAreUniformInSolidAngle)
{
  const Light light = flat_light(LightKind::kRectangle, {0, 0, 1}, {0, 2, 0}, {1, 0, 0});
  for (const Vec3f P :
       {Vec3f{0, 0, 0}, Vec3f{0.9f, 1.8f, 0.95f}, Vec3f{-4, 3, 0.3f}, Vec3f{1.5f, 0, -2}, Vec3f{0, 0, -60}}) {
    if (dot(P - light.P, light.axis) < 0) FAIL();
    expect_uniform_in_solid_angle(light, P);
  }
}

TEST(RectangleLight, NarrowOneIsUniformInSolidAngleAlongItsLength)
{
  // A tube of 10 m × 1 cm, seen from 10 cm beside one end and from beyond the other.
  const Light light = flat_light(LightKind::kRectangle, {0, 0, 1}, {0, 5, 0}, {0.005f, 0, 0});
  expect_uniform_in_solid_angle(light, {0, 4.5f, 0.9f});
  expect_uniform_in_solid_angle(light, {0.1f, 5.5f, 0.7f});
}

TEST(TriangleLight, PositionsAreUniformInSolidAngle)
{
  const Light light = flat_light(LightKind::kTriangle, {0, 0, 1}, {0, 2, 0}, {1, 0.5f, 0});
  for (const Vec3f P : {Vec3f{0.3f, 0.6f, 0}, Vec3f{0.4f, 1, 0.97f}, Vec3f{-4, 3, 0.3f}, Vec3f{1.5f, 0, -0.9f}}) {
    expect_uniform_in_solid_angle(light, P);
  }
}

TEST_P(FlatLight, FarOneHasADensityThatVariesByLessThanEight)
{
  // The bound that light_is_wide states: no point farther from the plane than the longest edge is seen more unevenly.
  Random random{17};
  for (int k = 0; k < 2000; ++k) {
    const Configuration c = random_configuration(GetParam(), random, true);
    const Light& light = c.light;
    const bool triangle = GetParam() == LightKind::kTriangle;
    const float longest = std::sqrt(std::max({length_squared(light.edge_u), length_squared(light.edge_v),
                                              triangle ? length_squared(light.edge_u - light.edge_v) : 0.0f}));
    const float height = (triangle ? 1.0f : 2.0f) * longest * 1.001f;
    const Vec3f P = c.P + light.axis * (height - dot(c.P - light.P, light.axis));
    float least = kInfinity, most = 0;
    for (int i = 0; i < 64; ++i) {
      const LightSample sample = light_sample(light, P, {random.between(0, 1), random.between(0, 1)});
      least = std::min(least, sample.pdf);
      most = std::max(most, sample.pdf);
    }
    ASSERT_GT(least, 0.0f) << k;
    EXPECT_LT(most, 8.0f * least) << k;
  }
}

TEST(TriangleLight, SliverIsUniformInSolidAngleAlongItsLength)
{
  const Light light = flat_light(LightKind::kTriangle, {0, 0, 1}, {0, 10, 0}, {0.02f, 0, 0});
  expect_uniform_in_solid_angle(light, {0.01f, 8, 0.9f});
  expect_uniform_in_solid_angle(light, {0.01f, 1, 0.9f});
}

TEST(TriangleLight, BarycentricWeightsNameTheSampledPoint)
{
  Random random{5};
  for (int k = 0; k < 5000; ++k) {
    const Configuration c = random_configuration(LightKind::kTriangle, random, false);
    const LightSample sample = light_sample(c.light, c.P, {random.between(0, 1), random.between(0, 1)});
    const Vec2f b = sample.barycentric;
    ASSERT_TRUE(b.x >= 0 && b.y >= 0 && b.x + b.y <= 1 + 1e-6f) << k;
    const Vec3f expected = c.light.P + c.light.edge_u * b.x + c.light.edge_v * b.y;
    const float size = max_component(abs(c.P) + abs(c.light.P) + abs(c.light.edge_u) + abs(c.light.edge_v));
    ASSERT_LT(length(c.P + sample.wi * sample.distance - expected), 1e-5f * size) << k;
  }
}

TEST(PointLight, IntensityFallsWithTheSquareOfTheDistance)
{
  Light light;
  light.P = {1, 2, 3};
  light.emission = {8, 4, 2};
  const LightSample sample = light_sample(light, {1, 2, 1}, {});
  EXPECT_EQ(sample.radiance, (Vec3f{2, 1, 0.5f}));
  EXPECT_EQ(sample.wi, (Vec3f{0, 0, 1}));
  EXPECT_EQ(sample.distance, 2.0f);
  EXPECT_EQ(sample.pdf, 1.0f);
  EXPECT_TRUE(sample.delta);
  EXPECT_EQ(light_pdf(light, {}, sample.wi, 2), 0.0f);
  EXPECT_EQ(light_sample(light, light.P, {}).pdf, 0.0f);
}

TEST(SpotLight, FalloffIsThatOfTheExtension)
{
  Light light;
  light.kind = LightKind::kSpot;
  light.axis = {0, 0, -1};
  light.emission = {1, 1, 1};
  light.cos_inner = std::cos(0.3f);
  light.cos_outer = std::cos(0.6f);
  for (float angle = 0.01f; angle < 1.5f; angle += 0.01f) {
    const Vec3f P{std::sin(angle), 0, -std::cos(angle)};
    const double attenuation =
        std::clamp((std::cos(double(angle)) - std::cos(0.6)) / (std::cos(0.3) - std::cos(0.6)), 0.0, 1.0);
    EXPECT_NEAR(light_sample(light, P, {}).radiance.x, attenuation * attenuation, 1e-5) << angle;
  }
  light.cos_inner = light.cos_outer;
  EXPECT_EQ(light_sample(light, {std::sin(0.59f), 0, -std::cos(0.59f)}, {}).radiance.x, 1.0f);
  EXPECT_EQ(light_sample(light, {std::sin(0.61f), 0, -std::cos(0.61f)}, {}).pdf, 0.0f);
}

TEST(SpotLight, SmoothFalloffsAreCubic)
{
  Light light;
  light.kind = LightKind::kSpot;
  light.emission = {1, 1, 1};
  light.cos_inner = std::cos(0.3f);
  light.cos_outer = std::cos(0.6f);
  for (float angle = 0.01f; angle < 1.5f; angle += 0.01f) {
    const Vec3f P{std::sin(angle), 0, -std::cos(angle)};
    const double cosine = std::cos(double(angle));
    const double t = std::clamp((cosine - std::cos(0.6)) / (std::cos(0.3) - std::cos(0.6)), 0.0, 1.0);
    light.falloff = SpotFalloff::kSmooth;
    EXPECT_NEAR(light_sample(light, P, {}).radiance.x, t * t * (3 - 2 * t), 1e-5) << angle;
    light.falloff = SpotFalloff::kSmoothCosine;
    EXPECT_NEAR(light_sample(light, P, {}).radiance.x, t * t * (3 - 2 * t) * cosine, 1e-5) << angle;
  }
  light.cos_inner = light.cos_outer;
  EXPECT_FLOAT_EQ(light_sample(light, {std::sin(0.599f), 0, -std::cos(0.599f)}, {}).radiance.x, std::cos(0.599f));
}

/// Irradiance at the origin, on a plane across z, by samples of a light on a regular grid.
/// @param check  called with each sample; a fatal failure in it ends the sum
template <typename Check>
double irradiance_on_grid(const Light& light, int side, const Check& check)
{
  double sum = 0;
  for (int i = 0; i < side * side && !testing::Test::HasFatalFailure(); ++i) {
    const int column = i % side, row = i / side;
    const Vec2f cell{static_cast<float>(column), static_cast<float>(row)};
    const LightSample sample = light_sample(light, {}, (cell + Vec2f{0.5f, 0.5f}) * (1.0f / static_cast<float>(side)));
    check(sample);
    sum += double(sample.radiance.x) / double(sample.pdf) * std::max(0.0, double(sample.wi.z));
  }
  return sum / (side * side);
}

// A ball that is above the horizon as a whole lights a surface as the point at its centre does.
TEST(PointLight, BallGivesThePointsIrradiance)
{
  Light light;
  light.P = {0.3f, -0.4f, 1.2f};
  light.emission = {2, 2, 2};
  for (const float radius : {1e-4f, 0.1f, 0.7f, 1.1f}) {
    light.radius = radius;
    const double irradiance = irradiance_on_grid(light, 512, [&](const LightSample& sample) {
      ASSERT_FALSE(sample.delta);
      ASSERT_EQ(sample.pdf, light_pdf(light, {}, sample.wi, sample.distance));
      // The sampled point is on the ball, on the side that is seen.
      ASSERT_NEAR(length(sample.wi * sample.distance - light.P), radius, 2e-6f);
      ASSERT_LE(sample.distance, length(light.P));
    });
    EXPECT_NEAR(irradiance * std::pow(double(length(light.P)), 3) / (2 * double(light.P.z)), 1.0, 2e-5) << radius;
  }
}

// Radiance I / πr² from a cone of half angle α about the normal is the irradiance I sin²α / r²: a ball fills asin(r / d) and,
// from inside, everything; a disk that faces the point fills atan(r / d).
TEST(PointLight, PointsInsideAreLitAsFromAllAround)
{
  Light light;
  light.P = {0, 0, 0.5f};
  light.emission = {2, 2, 2};
  for (const bool faces_viewer : {false, true}) {
    light.faces_viewer = faces_viewer;
    for (const float radius : {0.1f, 0.499f, 0.501f, 2.0f, 1e4f}) {
      light.radius = radius;
      const double irradiance = irradiance_on_grid(light, 256, [&](const LightSample& sample) {
        ASSERT_GT(sample.pdf, 0.0f);
        ASSERT_NEAR(sample.distance, ball_light_distance(light, light.P, sample.wi), 1e-5f * sample.distance);
      });
      const double ratio = std::pow(double(radius) / double(light.P.z), 2);
      const double sin_squared = faces_viewer ? ratio / (1 + ratio) : std::min(ratio, 1.0);
      EXPECT_NEAR(irradiance * std::pow(double(radius), 2) / (2 * sin_squared), 1.0, 1e-4) << radius;
    }
  }
}

// A ray meets a ball where it enters, or, from inside, where it leaves; behind it there is nothing.
TEST(PointLight, RaysMeetABallOnce)
{
  Light light;
  light.radius = 1;
  EXPECT_EQ(ball_light_distance(light, {0, 0, 3}, {0, 0, 1}), 2.0f);
  EXPECT_LT(ball_light_distance(light, {0, 0, 3}, {0, 0, -1}), 0.0f);
  EXPECT_LT(ball_light_distance(light, {0, 1.01f, 3}, {0, 0, 1}), 0.0f);
  EXPECT_EQ(ball_light_distance(light, {0, 0, 0.5f}, {0, 0, 1}), 1.5f);
  EXPECT_EQ(ball_light_distance(light, {0, 0, 0.5f}, {0, 0, -1}), 0.5f);
  light.faces_viewer = true;
  EXPECT_EQ(ball_light_distance(light, {0, 0, 3}, {0, 0, 1}), 3.0f);
  EXPECT_LT(ball_light_distance(light, {0, 0, 3}, {0, 0, -1}), 0.0f);
  EXPECT_NEAR(ball_light_distance(light, {0, 0, 0.5f}, normalize(Vec3f{1, 0, 1})), 0.70710678f, 1e-6f);
  EXPECT_LT(ball_light_distance(light, {0, 0, 0.5f}, {1, 0, 0}), 0.0f);
}

TEST(DiskLight, SpreadKeepsThePower)
{
  for (const float half : {0.05f, 0.3f, 1.0f, 1.5f}) {
    Light light;
    light.kind = LightKind::kDisk;
    light.emission = {1, 1, 1};
    light.spread_tan = std::tan(half);
    light.spread_scale = 1.0f / (light.spread_tan - half);
    // ∫ L cos θ over the hemisphere, by the midpoint rule over the angle.
    constexpr int kSteps = 100000;
    double flux = 0;
    for (int i = 0; i < kSteps; ++i) {
      const double angle = (i + 0.5) * 1.5707963267948966 / kSteps;
      const Vec3f wi{static_cast<float>(std::sin(angle)), 0, static_cast<float>(std::cos(angle))};
      flux += static_cast<double>(light_emitted(light, wi).x) * std::cos(angle) * std::sin(angle);
    }
    EXPECT_NEAR(flux * 2 * 1.5707963267948966 / kSteps, 1, 2e-3) << half;
    EXPECT_EQ(light_emitted(light, {std::sin(half + 0.01f), 0, std::cos(half + 0.01f)}).x, 0);
  }
}

/// However narrow a spread is, what shines to a point is sampled, and nothing else: a lamp of one degree was fireflies.
TEST(PlateLights, AreSampledWhereTheirSpreadShines)
{
  for (const LightKind kind : {LightKind::kRectangle, LightKind::kDisk}) {
    for (const double half : {0.01, 0.1, 0.7, 1.4}) {
      // Skewed and not.
      for (const float skew : {0.0f, 0.3f}) {
        Light light = flat_light(kind, {0, 0, 0}, {0.7f, 0, 0}, {skew, 0.5f, 0});
        light.emission = {1, 1, 1};
        light.spread_tan = static_cast<float>(std::tan(half));
        light.spread_scale = 1.0f / (light.spread_tan - static_cast<float>(half));
        const float side = light.axis.z > 0 ? 1.0f : -1.0f;
        // In the middle of the beam, at its rim, and out of it.
        for (const Vec3f P : {Vec3f{0.1f, 0.05f, side}, Vec3f{0.698f, 0.02f, side}, Vec3f{0.2f, 9, side}}) {
          // By the midpoint rule over the angles about the axis, which all points of the plane have to P.
          constexpr int kSteps = 2000;
          double expected = 0;
          for (int i = 0; i < kSteps; ++i) {
            const double tangent = std::tan(half) * (i + 0.5) / kSteps, cosine = 1 / std::sqrt(1 + tangent * tangent);
            int seen = 0;
            for (int k = 0; k < 360; ++k) {
              const double phi = (k + 0.5) * M_PI / 180;
              const double x = double(P.x) + tangent * std::cos(phi), y = double(P.y) + tangent * std::sin(phi);
              const double v = y / 0.5, u = (x - double(skew) * v) / 0.7;
              const bool is_on = kind == LightKind::kDisk ? u * u + v * v <= 1 : std::abs(u) <= 1 && std::abs(v) <= 1;
              seen += is_on ? 1 : 0;
            }
            // cos θ / d² cos θ of an element of area.
            expected += (std::tan(half) - tangent) / (std::tan(half) - half) * std::pow(cosine, 4) * seen / 360 * 2 *
                        M_PI * tangent * std::tan(half) / kSteps;
          }
          constexpr std::uint32_t kSamples = 1 << 14;
          double sum = 0, squares = 0;
          for (std::uint32_t i = 0; i < kSamples; ++i) {
            const LightSample sample = light_sample(light, P, sample_2d(3, i, 0));
            if (!(sample.pdf > 0)) continue;
            ASSERT_NEAR(light_pdf(light, P, sample.wi, sample.distance), sample.pdf, 1e-3f * sample.pdf);
            const double f = double(sample.radiance.x) * std::abs(double(sample.wi.z)) / double(sample.pdf);
            sum += f;
            squares += f * f;
          }
          EXPECT_NEAR(sum / kSamples, expected, 0.01 * expected + 1e-9)
              << half << " " << skew << " " << P.x << " " << P.y;
          if (expected > 0 && half < 1) {
            EXPECT_LT(squares * kSamples, 4.5 * sum * sum) << half << " " << skew << " " << P.x;
          }
        }
      }
    }
  }
}

TEST(SunLight, IrradianceIsTheSameEverywhere)
{
  Light light;
  light.kind = LightKind::kSun;
  light.axis = {0, -1, 0};
  light.emission = {3, 2, 1};
  const LightSample sample = light_sample(light, {1e6f, 5, 0}, {});
  EXPECT_EQ(sample.wi, (Vec3f{0, 1, 0}));
  EXPECT_EQ(sample.distance, kInfinity);
  EXPECT_EQ(sample.radiance, light.emission);
  EXPECT_EQ(sample.pdf, 1.0f);
  EXPECT_TRUE(sample.delta);
}

/// The sampler, its density and what rays meet are of the same cone, which causes the irradiance that was asked for.
TEST(SunLight, OfAnAngleFillsItsCone)
{
  for (const double signed_half : {1e-4, 4.65e-3, 0.1, 1.0, 1.55, -1e-4, -4.65e-3, -0.1, -1.0, -1.2}) {
    const double half = std::abs(signed_half);
    Light light;
    light.faces_viewer = signed_half < 0;
    light.kind = LightKind::kSun;
    light.axis = normalize(Vec3f{0.3f, -0.8f, 0.5f});
    light.emission = {3, 2, 1};
    light.cone = static_cast<float>(2 * std::sin(half / 2) * std::sin(half / 2));
    constexpr int kSteps = 128;
    double irradiance = 0;
    for (int i = 0; i < kSteps * kSteps; ++i) {
      const Vec2f u{(static_cast<float>(i % kSteps) + 0.5f) / kSteps, (static_cast<float>(i / kSteps) + 0.5f) / kSteps};
      const LightSample sample = light_sample(light, {1e6f, 5, 0}, u);
      ASSERT_TRUE(sun_light_is_met(light, sample.wi)) << half;
      ASSERT_EQ(sample.pdf, sun_light_pdf(light, sample.wi));
      ASSERT_FALSE(sample.delta);
      irradiance += static_cast<double>(sample.radiance.x) * -static_cast<double>(dot(sample.wi, light.axis)) /
                    static_cast<double>(sample.pdf);
    }
    EXPECT_NEAR(irradiance / (kSteps * kSteps), 3.0, 3e-4) << half;
    const Vec3f across = normalize(cross(light.axis, {1, 0, 0}));
    const auto at_angle = [&](double angle) {
      return across * static_cast<float>(std::sin(angle)) - light.axis * static_cast<float>(std::cos(angle));
    };
    EXPECT_TRUE(sun_light_is_met(light, at_angle(half * 0.99)));
    EXPECT_FALSE(sun_light_is_met(light, at_angle(half * 1.01)));
  }
}

/// Of a flat sun a plane sees what a disk at a distance of 1 sends it, each part as much: the sum over the disk in double precision.
TEST(SunLight, ThatIsFlatLightsPlanesAsADiskDoes)
{
  const double half = 1.05, tangent = std::tan(half);
  Light light;
  light.kind = LightKind::kSun;
  light.faces_viewer = true;
  light.axis = {0, 0, -1};
  light.emission = {1, 1, 1};
  light.cone = static_cast<float>(2 * std::sin(half / 2) * std::sin(half / 2));
  for (const double tilt : {0.0, 0.5, 1.0, 1.6, 2.2}) {
    const double N[3] = {std::sin(tilt), 0, std::cos(tilt)};
    constexpr int kSteps = 512;
    double expected = 0, across = 0, found = 0;
    for (int i = 0; i < kSteps * kSteps; ++i) {
      const double u = (i % kSteps + 0.5) / kSteps, turn = 2 * std::numbers::pi * (i / kSteps + 0.5) / kSteps;
      const double r = tangent * std::sqrt(u), cosine = 1 / std::sqrt(1 + r * r);
      expected += std::max(cosine * (r * std::cos(turn) * N[0] + N[2]), 0.0);
      across += cosine;
      const LightSample sample =
          light_sample(light, {}, {static_cast<float>(u), static_cast<float>(i / kSteps + 0.5) / kSteps});
      const Vec3f n{static_cast<float>(N[0]), 0, static_cast<float>(N[2])};
      found += static_cast<double>(sample.radiance.y * std::max(dot(sample.wi, n), 0.0f) / sample.pdf);
    }
    EXPECT_NEAR(found / (kSteps * kSteps), expected / across, 1e-4) << tilt;
  }
}

/// A lamp of any kind, with a size.
Light some_lamp(LightKind kind)
{
  Light light = flat_light(kind, {0.5f, -2, 1}, {0.7f, 0.2f, 0}, {-0.3f, 0.9f, 0.4f});
  light.radius = 0.6f;
  light.cos_inner = 0.9f;
  light.cos_outer = 0.6f;
  light.cone = 0.01f;
  return light;
}

/// What is true of every kind in the list: whoever adds one has it tested.
TEST(LightKinds, RaysMeetLampsWhereTheyShineFrom)
{
  int num_met = 0;
  const auto check = [&](LightKind kind, const char* name) {
    const Light light = some_lamp(kind);
    if (!light_is_met(light)) return;
    ++num_met;
    const Vec3f half = light_half_extent(light);
    for (std::uint32_t i = 0; i < 1024; ++i) {
      const LightRay ray = light_emit(light, sample_2d(1, i, 0), sample_2d(1, i, 2), false);
      ASSERT_NEAR(length(ray.wo), 1.0f, 1e-5f) << name;
      const Vec3f from_centre = abs(ray.P - light.P);
      ASSERT_TRUE(from_centre.x <= half.x * 1.00001f && from_centre.y <= half.y * 1.00001f &&
                  from_centre.z <= half.z * 1.00001f)
          << name;
      // Rounding moves what grazes a plate by its cosine.
      if (dot(ray.wo, light_place(light, ray.P, ray.wo).N) < 0.01f) continue;
      ASSERT_NEAR(light_distance(light, ray.P + 2.0f * ray.wo, -ray.wo), 2.0f, 1e-3f) << name;
      ASSERT_LT(light_distance(light, ray.P + 2.0f * ray.wo, ray.wo), 0.0f) << name;
      ASSERT_GT(light_pdf(light, ray.P + 2.0f * ray.wo, -ray.wo, 2.0f), 0.0f) << name;
    }
  };
#define LIGHT_KIND(name, Type) check(LightKind::name, #name);
#include "kernel/light/light_kinds.inc"
  EXPECT_EQ(num_met, 4);
}

}  // namespace
}  // namespace relief
