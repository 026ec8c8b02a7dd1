// The environment light and its tables: orientation, and sampling, density and radiance as a trio. Integrals are taken
// by midpoint quadrature over the sphere in (θ, φ), which knows nothing of the cells.
#include "kernel/light/environment.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "integrator/environment_tables.h"
#include "scene/mip_chain.h"

namespace relief {
namespace {

/// An RGB half map with its mip levels.
struct TestMap {
  MipChain chain;
  TextureView view;

  TestMap(int width, int height, const std::function<Vec3f(int, int)>& color)
      : chain(TexelLayout{width, height, 3, TexelFormat::kHalf})
  {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const Vec3f c = color(x, y);
        const std::uint16_t halves[3] = {half_from_float(c.x), half_from_float(c.y), half_from_float(c.z)};
        std::memcpy(chain.level(0) + static_cast<std::size_t>(y * width + x) * sizeof halves, halves, sizeof halves);
      }
    }
    mip_chain_build(chain);
    for (int level = 0; level < chain.num_levels(); ++level) {
      view.levels[level] = chain.level(level);
    }
    view.width = width;
    view.height = height;
    view.num_levels = chain.num_levels();
    view.num_channels = 3;
    view.format = TexelFormat::kHalf;
    view.wrap_v = Wrap::kClamp;
  }
};

/// Three numbers in [0, 1) that look unrelated from texel to texel.
Vec3f random_color(unsigned seed, int x, int y)
{
  std::minstd_rand random(seed * 31u + static_cast<unsigned>(x) * 7919u + static_cast<unsigned>(y) * 104729u + 1u);
  random.discard(3);
  const auto number = [&] { return static_cast<float>(random() % 4096) / 4096.0f; };
  return {number(), number(), number()};
}

struct MapCase {
  const char* name;
  int width, height;
  float rotation;
  std::function<Vec3f(int, int)> color;
};

const std::vector<MapCase>& map_cases()
{
  static const std::vector<MapCase> cases = {
      {"one texel", 1, 1, 0.3f,
       [](int, int) {
         return Vec3f{1, 2, 3};
       }},
      {"one row", 16, 1, 0.0f, [](int x, int y) { return random_color(1, x, y); }},
      {"one column", 1, 9, 0.0f, [](int x, int y) { return random_color(2, x, y); }},
      {"odd", 13, 7, -1.0f, [](int x, int y) { return random_color(3, x, y); }},
      {"random", 64, 32, 2.0f, [](int x, int y) { return random_color(4, x, y); }},
      {"sun", 64, 32, 0.7f, [](int x, int y) { return x == 20 && y == 9 ? splat3(60000) : splat3(0.01f); }},
      {"lone sun", 64, 32, 0.0f, [](int x, int y) { return x == 63 && y == 9 ? splat3(60000) : Vec3f{}; }},
      {"sun at the pole", 64, 32, 0.0f, [](int, int y) { return y == 0 ? splat3(60000) : splat3(0.01f); }},
      {"half black", 40, 20, 4.0f, [](int x, int y) { return y < 10 ? random_color(5, x, y) : Vec3f{}; }},
      {"larger than the table", 2200, 1030, 0.0f,
       [](int x, int y) { return x == 1800 && y == 333 ? splat3(50000) : random_color(6, x / 50, y / 50); }},
  };
  return cases;
}

/// Runs a claim on every map.
void for_each_map(const std::function<void(const EnvironmentView&, const MapCase&)>& claim)
{
  for (const MapCase& map_case : map_cases()) {
    SCOPED_TRACE(map_case.name);
    const TestMap map(map_case.width, map_case.height, map_case.color);
    const EnvironmentTables tables = environment_tables_make(&map.view, {1, 0.5f, 2}, map_case.rotation);
    claim(tables.view(), map_case);
  }
}

Vec3f direction(double z, double phi)
{
  const double r = std::sqrt(std::max(0.0, 1 - z * z));
  return {static_cast<float>(r * std::cos(phi)), static_cast<float>(z), static_cast<float>(r * std::sin(phi))};
}

/// ∫ f dω by the midpoint rule in (θ, φ).
double sphere_integral(int num_theta, int num_phi, const std::function<double(Vec3f)>& f)
{
  double sum = 0;
  for (int i = 0; i < num_theta; ++i) {
    const double theta = M_PI * (i + 0.5) / num_theta;
    double row = 0;
    for (int j = 0; j < num_phi; ++j) {
      row += f(direction(std::cos(theta), 2 * M_PI * (j + 0.5) / num_phi));
    }
    sum += row * std::sin(theta);
  }
  return sum * 2 * M_PI * M_PI / num_theta / num_phi;
}

class Uniform2 {
 public:
  explicit Uniform2(unsigned seed) : random_(seed) {}
  Vec2f operator()() { return {number(), number()}; }

 private:
  float number() { return static_cast<float>(random_() >> 8) * 0x1p-24f; }
  std::mt19937 random_;
};

TEST(EnvironmentOrientation, CentreLooksAlongMinusZRightIsPlusXTopIsPlusY)
{
  EnvironmentView environment;
  const auto expect_uv = [&](Vec3f wi, float u, float v) {
    const Vec2f uv = environment_uv(environment, wi);
    EXPECT_NEAR(uv.x, u, 1e-6f);
    EXPECT_NEAR(uv.y, v, 1e-6f);
  };
  expect_uv({0, 0, -1}, 0.5f, 0.5f);
  expect_uv({1, 0, 0}, 0.75f, 0.5f);
  expect_uv({-1, 0, 0}, 0.25f, 0.5f);
  EXPECT_NEAR(environment_uv(environment, {0, 1, 0}).y, 0.0f, 1e-6f);
  EXPECT_NEAR(environment_uv(environment, {0, -1, 0}).y, 1.0f, 1e-6f);
}

TEST(EnvironmentOrientation, RotationTurnsCounterClockwiseSeenFromAbove)
{
  const TestMap map(4, 2, [](int x, int) { return x == 2 ? splat3(1) : Vec3f{}; });  // around u = 5/8
  const Vec3f wi = direction(0.0, -M_PI / 2 + M_PI / 4);                             // −Z turned towards +X by 45°
  ASSERT_NEAR(environment_eval(environment_tables_make(&map.view, splat3(1), 0).view(), wi).x, 1.0f, 1e-5f);
  // From above, with +X to the right and −Z up, a quarter turn counter-clockwise takes (x, −z) to (−z…): up goes left.
  const Vec3f turned{wi.z, 0, -wi.x};
  ASSERT_LT(turned.x, 0);
  ASSERT_LT(turned.z, 0);
  const float quarter = kPi / 2;
  EXPECT_NEAR(environment_eval(environment_tables_make(&map.view, splat3(1), quarter).view(), turned).x, 1.0f, 1e-5f);
  EXPECT_NEAR(environment_eval(environment_tables_make(&map.view, splat3(1), quarter - 8 * kPi).view(), turned).x, 1.0f,
              1e-5f);
}

TEST(EnvironmentSampling, ReturnsUnitDirectionsWithTheirRadianceAndDensity)
{
  for_each_map([](const EnvironmentView& environment, const MapCase&) {
    Uniform2 uniform(1);
    constexpr int kSamples = 20000;
    int num_other_cell = 0;
    for (int i = 0; i < kSamples; ++i) {
      const EnvironmentSample s = environment_sample(environment, uniform());
      ASSERT_NEAR(length(s.wi), 1.0f, 1e-6f);
      ASSERT_EQ(s.radiance, environment_eval(environment, s.wi));
      ASSERT_GT(s.pdf_solid_angle, 0.0f);
      num_other_cell += std::abs(environment_pdf(environment, s.wi) - s.pdf_solid_angle) > 1e-5f * s.pdf_solid_angle;
    }
    // A direction within rounding (some 1e-7 of a turn) of a cell's border may be found in the neighbour: with 1024
    // cells, up to 4 borders · 1024 · 2e-7 of all directions. In the limit of the last column x = 1 − 2⁻²⁴ it is u = 1.
    EXPECT_LE(num_other_cell, kSamples / 500);
  });
}

TEST(EnvironmentSampling, EvalPdfIsEvalAndPdf)
{
  for_each_map([](const EnvironmentView& environment, const MapCase&) {
    Uniform2 uniform(2);
    for (int i = 0; i < 1000; ++i) {
      const Vec2f u = uniform();
      const Vec3f wi = direction(2 * static_cast<double>(u.x) - 1, 6.28 * static_cast<double>(u.y));
      const EnvironmentSample s = environment_eval_pdf(environment, wi);
      EXPECT_EQ(s.radiance, environment_eval(environment, wi));
      EXPECT_EQ(s.pdf_solid_angle, environment_pdf(environment, wi));
    }
  });
}

TEST(EnvironmentSampling, DensityIntegratesToOne)
{
  for_each_map([](const EnvironmentView& environment, const MapCase& map_case) {
    const bool large = map_case.width > 1000;
    const double integral = sphere_integral(large ? 2501 : 1001, large ? 5003 : 2003, [&](Vec3f wi) {
      return static_cast<double>(environment_pdf(environment, wi));
    });
    // The midpoint rule misplaces cell borders by up to half a step: where a sun's cell holds everything, about one
    // step in the 30 that cross it.
    EXPECT_NEAR(integral, 1.0, large ? 0.1 : 0.04);
  });
}

TEST(EnvironmentSampling, CellProbabilitiesAddUpToOneExactly)
{
  for_each_map([](const EnvironmentView& environment, const MapCase&) {
    EXPECT_EQ(environment.row_cdf[environment.num_rows], 1.0f);
    double solid_angle = 0;
    for (int row = 0; row < environment.num_rows; ++row) {
      const float* cdf = environment.column_cdf + static_cast<std::ptrdiff_t>(row) * (environment.num_columns + 1);
      EXPECT_EQ(cdf[0], 0.0f);
      EXPECT_EQ(cdf[environment.num_columns], 1.0f);
      for (int i = 0; i < environment.num_columns; ++i) {
        ASSERT_LE(cdf[i], cdf[i + 1]);
        ASSERT_EQ(cdf[i] * 0x1p24f, std::floor(cdf[i] * 0x1p24f));
      }
      solid_angle += static_cast<double>(environment_cell_solid_angle(environment, row)) * environment.num_columns;
    }
    EXPECT_NEAR(solid_angle, 4 * M_PI, 1e-5);
  });
}

// Pearson's χ² over 16 × 32 bins of equal solid angle, 200000 samples, expected counts by 40 × 40 midpoints a bin, bins
// below 5 expected joined. Significance 1e-5 for each of the 10 maps (z < 4.27 by Wilson and Hilferty).
TEST(EnvironmentSampling, DirectionsFollowTheDensity)
{
  for_each_map([](const EnvironmentView& environment, const MapCase& map_case) {
    if (map_case.width > 1000 || std::string(map_case.name).find("sun") != std::string::npos) {
      // One cell holds nearly all: midpoints cannot resolve its border; CellsAreChosenAsOftenAsTheySay covers these.
      return;
    }
    constexpr int kZ = 16, kPhi = 32, kSub = 40, kSamples = 200000;
    std::vector<double> expected(kZ * kPhi), counted(kZ * kPhi);
    for (int i = 0; i < kZ * kSub; ++i) {
      for (int j = 0; j < kPhi * kSub; ++j) {
        const Vec3f wi = direction(-1 + 2 * (i + 0.5) / (kZ * kSub), 2 * M_PI * (j + 0.5) / (kPhi * kSub));
        expected[static_cast<std::size_t>(i / kSub * kPhi + j / kSub)] +=
            static_cast<double>(environment_pdf(environment, wi)) * 4 * M_PI / (kZ * kSub * kPhi * kSub) * kSamples;
      }
    }
    Uniform2 uniform(3);
    for (int k = 0; k < kSamples; ++k) {
      const Vec3f wi = environment_sample(environment, uniform()).wi;
      double phi = std::atan2(static_cast<double>(wi.z), static_cast<double>(wi.x));
      phi = phi < 0 ? phi + 2 * M_PI : phi;
      const int i = std::min(kZ - 1, static_cast<int>((static_cast<double>(wi.y) + 1) / 2 * kZ));
      const int j = std::min(kPhi - 1, static_cast<int>(phi / (2 * M_PI) * kPhi));
      counted[static_cast<std::size_t>(i * kPhi + j)] += 1;
    }
    double chi_squared = 0, small_expected = 0, small_counted = 0;
    int degrees = -1;
    for (std::size_t b = 0; b < expected.size(); ++b) {
      if (expected[b] < 5) {
        small_expected += expected[b];
        small_counted += counted[b];
        continue;
      }
      chi_squared += (counted[b] - expected[b]) * (counted[b] - expected[b]) / expected[b];
      ++degrees;
    }
    if (small_expected > 0) {
      chi_squared += (small_counted - small_expected) * (small_counted - small_expected) / small_expected;
      ++degrees;
    }
    const double k = 2.0 / (9.0 * degrees);
    EXPECT_LT((std::cbrt(chi_squared / degrees) - (1 - k)) / std::sqrt(k), 4.27) << chi_squared << " of " << degrees;
  });
}

TEST(EnvironmentSampling, CellsAreChosenAsOftenAsTheySay)
{
  // Every multiple of 2^-24 as a random number, one axis at a time: counts must be the probabilities, exactly.
  const TestMap map(50, 20, [](int x, int y) { return y == 4 ? random_color(8, x, y) : splat3(1e-6f); });
  const EnvironmentTables tables = environment_tables_make(&map.view, splat3(1), 0);
  const EnvironmentView environment = tables.view();
  const float* cdf = environment.column_cdf + 4 * (environment.num_columns + 1);
  std::vector<int> counts(static_cast<std::size_t>(environment.num_columns));
  for (int i = 0; i < 1 << 24; ++i) {
    const CdfCell cell = cdf_cell(cdf, environment.num_columns, static_cast<float>(i) * 0x1p-24f);
    ++counts[static_cast<std::size_t>(cell.index)];
  }
  for (int c = 0; c < environment.num_columns; ++c) {
    EXPECT_EQ(static_cast<float>(counts[static_cast<std::size_t>(c)]) * 0x1p-24f, cdf[c + 1] - cdf[c]);
  }
}

// 200000 samples a map; |z| < 4.5, 1e-5 over all 10 maps and both integrals.
TEST(EnvironmentSampling, EstimatesTheIrradianceOfQuadrature)
{
  const Vec3f normal = normalize(Vec3f{0.3f, 0.8f, -0.5f});
  for_each_map([&](const EnvironmentView& environment, const MapCase& map_case) {
    for (const bool with_cosine : {false, true}) {
      const auto integrand = [&](Vec3f wi, Vec3f radiance) {
        const double cosine = with_cosine ? std::max(0.0, static_cast<double>(dot(wi, normal))) : 1.0;
        return static_cast<double>(luminance(radiance)) * cosine;
      };
      const bool large = map_case.width > 1000;
      if (large && with_cosine) continue;  // seconds of quadrature for nothing new
      const double truth = sphere_integral(large ? 2060 : 800, large ? 4400 : 1600,
                                           [&](Vec3f wi) { return integrand(wi, environment_eval(environment, wi)); });
      constexpr int kSamples = 200000;
      Uniform2 uniform(4);
      double sum = 0, sum_of_squares = 0;
      for (int i = 0; i < kSamples; ++i) {
        const EnvironmentSample s = environment_sample(environment, uniform());
        const double f = integrand(s.wi, s.radiance) / static_cast<double>(s.pdf_solid_angle);
        sum += f;
        sum_of_squares += f * f;
      }
      const double mean = sum / kSamples;
      const double deviation = std::sqrt(std::max(0.0, sum_of_squares / kSamples - mean * mean));
      // Quadrature itself is good to 2e-4; its midpoints are placed alike in all texels of the large map.
      EXPECT_NEAR(mean, truth, 4.5 * deviation / std::sqrt(kSamples) + 3e-4 * truth) << with_cosine;
      if (!with_cosine) {
        // What is left is the variation inside cells. A tent over its own nine cells has the most: (4/3)² − 1 along
        // both axes. Uniform directions would have a deviation of about √2048 means with the sun.
        EXPECT_LT(deviation, 1.2 * mean);
      }
    }
  });
}

TEST(EnvironmentSampling, DensityIsPositiveWhereverThereIsLight)
{
  // Next to the brightest sun a half can hold, the dimmest light.
  const TestMap map(64, 32, [](int x, int y) {
    if (x == 5 && y == 7) return splat3(65504);
    return (x + 3 * y) % 11 == 0 ? splat3(6e-8f) : Vec3f{};
  });
  const EnvironmentTables tables = environment_tables_make(&map.view, splat3(1), 0);
  const EnvironmentView environment = tables.view();
  Uniform2 uniform(6);
  int num_lit = 0;
  for (int i = 0; i < 300000; ++i) {
    const Vec2f u = uniform();
    const Vec3f wi = direction(2 * static_cast<double>(u.x) - 1, 2 * M_PI * static_cast<double>(u.y));
    if (!is_zero(environment_eval(environment, wi))) {
      ++num_lit;
      ASSERT_GT(environment_pdf(environment, wi), 0.0f);
    }
  }
  EXPECT_GT(num_lit, 1000);
}

/// Maps whose cells a midpoint rule resolves.
bool quadrature_resolves(const MapCase& map_case)
{
  return map_case.width <= 1000 && std::string(map_case.name).find("sun") == std::string::npos;
}

TEST(EnvironmentExcess, DensityIsWhatTheOtherDensityExceedsTheUniformOneBy)
{
  for (const MapCase& map_case : map_cases()) {
    SCOPED_TRACE(map_case.name);
    const TestMap map(map_case.width, map_case.height, map_case.color);
    const EnvironmentTables all = environment_tables_make(&map.view, {1, 0.5f, 2}, map_case.rotation);
    const EnvironmentTables tables =
        environment_tables_make(&map.view, {1, 0.5f, 2}, map_case.rotation, EnvironmentDensity::kExcess);
    const EnvironmentView radiance = all.view(), excess = tables.view();
    if (map_case.width == 1 && map_case.height == 1) {
      EXPECT_EQ(environment_sample(excess, {0.5f, 0.5f}).pdf_solid_angle, 0.0f);
      continue;
    }
    const auto difference = [&](Vec3f wi) {
      return std::max(static_cast<double>(environment_pdf(radiance, wi)) - 1 / (4 * M_PI), 0.0);
    };
    // Both densities are quantized to 2^-24 of a row or column, and the least cells get more than their share.
    if (quadrature_resolves(map_case)) {
      const double sum = sphere_integral(800, 1600, difference);
      Uniform2 uniform(11);
      for (int i = 0; i < 2000; ++i) {
        const Vec2f u = uniform();
        const Vec3f wi = direction(2 * static_cast<double>(u.x) - 1, 2 * M_PI * static_cast<double>(u.y));
        const double expected = difference(wi) / sum;
        ASSERT_NEAR(static_cast<double>(environment_pdf(excess, wi)), expected, 0.01 * expected + 1e-4);
      }
    }
    Uniform2 uniform(12);
    for (int i = 0; i < 2000; ++i) {
      const EnvironmentSample s = environment_sample(excess, uniform());
      ASSERT_GT(s.pdf_solid_angle, 0.0f);
      ASSERT_EQ(s.radiance, environment_eval(excess, s.wi));
      ASSERT_GT(difference(s.wi), -1e-6);
    }
  }
}

TEST(EnvironmentPoles, AreFiniteAndTheSeamIsContinuous)
{
  for_each_map([](const EnvironmentView& environment, const MapCase&) {
    for (const float y : {1.0f, -1.0f}) {
      for (const float x : {0.0f, -0.0f, 1e-4f, -1e-20f, 1e-38f}) {
        const EnvironmentSample s = environment_eval_pdf(environment, {x, y, -x});
        EXPECT_TRUE(is_finite(s.radiance));
        EXPECT_TRUE(is_finite(s.pdf_solid_angle));
      }
    }
    for (const Vec2f u : {Vec2f{0, 0}, Vec2f{0.99999994f, 0.99999994f}, Vec2f{0, 0.99999994f}, Vec2f{0.99999994f, 0}}) {
      const EnvironmentSample s = environment_sample(environment, u);
      EXPECT_TRUE(is_finite(s.wi) && is_finite(s.radiance) && is_finite(s.pdf_solid_angle));
      EXPECT_GT(s.pdf_solid_angle, 0.0f);
    }
    const double seam = M_PI / 2 - 2 * M_PI * static_cast<double>(environment.rotation_turns);  // φ of +Z, u = 0
    for (const double z : {-0.7, 0.0, 0.4}) {
      const Vec3f left = environment_eval(environment, direction(z, seam - 1e-6));
      const Vec3f right = environment_eval(environment, direction(z, seam + 1e-6));
      // Two steps of 1e-6 rad on the steepest map (60000 from one texel to the next, 2500 texels around).
      EXPECT_NEAR(left.x, right.x, 1e-3f * max(1.0f, left.x));
    }
  });
}

TEST(EnvironmentConstant, IsSampledUniformly)
{
  const EnvironmentTables tables = environment_tables_make(nullptr, {1, 2, 3}, 1.0f);
  const EnvironmentView environment = tables.view();
  EXPECT_EQ(tables.bytes(), 0u);
  Uniform2 uniform(9);
  double sum_z = 0, sum_z2 = 0, sum_x2 = 0;
  constexpr int kSamples = 100000;
  for (int i = 0; i < kSamples; ++i) {
    const EnvironmentSample s = environment_sample(environment, uniform());
    ASSERT_NEAR(length(s.wi), 1.0f, 1e-6f);
    ASSERT_EQ(s.radiance, (Vec3f{1, 2, 3}));
    ASSERT_FLOAT_EQ(s.pdf_solid_angle, static_cast<float>(1 / (4 * M_PI)));
    sum_z += static_cast<double>(s.wi.y);
    sum_z2 += static_cast<double>(s.wi.y * s.wi.y);
    sum_x2 += static_cast<double>(s.wi.x * s.wi.x);
  }
  // Standard deviations 0.577 and 0.298 a sample; five of them.
  EXPECT_NEAR(sum_z / kSamples, 0, 5 * 0.577 / std::sqrt(kSamples));
  EXPECT_NEAR(sum_z2 / kSamples, 1.0 / 3, 5 * 0.298 / std::sqrt(kSamples));
  EXPECT_NEAR(sum_x2 / kSamples, 1.0 / 3, 5 * 0.298 / std::sqrt(kSamples));
  EXPECT_EQ(environment_pdf(environment, {0, 1, 0}), 0.25f * kInvPi);
}

TEST(EnvironmentBlack, SamplesNothing)
{
  const TestMap map(8, 4, [](int, int) { return Vec3f{0, 0, 0}; });
  const EnvironmentTables tables = environment_tables_make(&map.view, splat3(1), 0);
  const EnvironmentSample s = environment_sample(tables.view(), {0.5f, 0.5f});
  EXPECT_EQ(s.pdf_solid_angle, 0.0f);
  EXPECT_TRUE(is_zero(environment_eval(tables.view(), {0, 0, -1})));
  EXPECT_EQ(environment_pdf(tables.view(), {0, 0, -1}), 0.0f);
}

TEST(EnvironmentBelowBlack, IsSampledAsLightIs)
{
  const TestMap map(8, 4, [](int, int) { return Vec3f{-1, 0, 0}; });
  const EnvironmentTables tables = environment_tables_make(&map.view, splat3(1), 0);
  const EnvironmentSample s = environment_sample(tables.view(), {0.5f, 0.5f});
  EXPECT_GT(s.pdf_solid_angle, 0.0f);
  EXPECT_EQ(s.radiance.x, -1.0f);
  EXPECT_EQ(environment_pdf(tables.view(), s.wi), s.pdf_solid_angle);
}

TEST(EnvironmentTables, AreTheSameForATextureBehindALookUp)
{
  const TestMap map(300, 150, [](int x, int y) { return random_color(10, x, y); });
  TextureView cached = map.view;
  std::fill(std::begin(cached.levels), std::end(cached.levels), nullptr);
  cached.lookup_handle = &map.view;
  cached.lookup = [](const void* handle, Vec2f uv, float width) {
    return texture_sample(*static_cast<const TextureView*>(handle), uv, width);
  };
  const EnvironmentTables expected = environment_tables_make(&map.view, splat3(1), 0);
  const EnvironmentTables found = environment_tables_make(&cached, splat3(1), 0);
  EXPECT_EQ(found.row_cdf, expected.row_cdf);
  EXPECT_EQ(found.column_cdf, expected.column_cdf);
}

}  // namespace
}  // namespace relief
