#include "exporters/z_test.h"

#include <gtest/gtest.h>
#include <half.h>

#include <cmath>
#include <limits>

#include "tests/exporters/test_pictures.h"

namespace relief {

namespace {

/// A mean with noise, and the variance of that noise.
struct Estimate {
  Picture mean, variance;
};

/// @param bias      added to every value
/// @param is_grey   the three channels are equal, noise included
/// @param as_half   values are rounded to halves, as the file would
Estimate estimate_make(int width,
                       int height,
                       std::uint32_t seed,
                       double relative_noise,
                       double bias = 0,
                       bool is_grey = false,
                       bool as_half = false)
{
  Estimate estimate{constant_picture(width, height, 0, 0, 0), constant_picture(width, height, 0, 0, 0)};
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t i = 0; i < estimate.mean.channels[c].values.size(); ++i) {
      const double truth = .2 + static_cast<double>(i % 7) * .3;
      const double sigma = relative_noise * truth * (1 + static_cast<double>(i % 3));
      float value = static_cast<float>(truth + bias + sigma * normal(random));
      if (is_grey && c > 0) value = estimate.mean.channels[0].values[i];
      if (as_half) value = half(value);
      estimate.mean.channels[c].values[i] = value;
      estimate.variance.channels[c].values[i] = static_cast<float>(sigma * sigma);
    }
    if (as_half) estimate.mean.channels[c].type = ChannelType::kHalf;
  }
  return estimate;
}

ZTestResult test_of(const Estimate& a, const Estimate& b, const ZTestOptions& options = {})
{
  return z_test(picture_layer(a.mean, ""), picture_layer(a.variance, ""), picture_layer(b.mean, ""),
                picture_layer(b.variance, ""), options);
}

/// Shares of trials under the null hypothesis whose p lies below 0.05.
struct Rates {
  double pixel = 0, block = 0, mean = 0, chi2 = 0, all = 0;
};

Rates rates_under_null(int num_trials, double relative_noise, bool is_grey, bool as_half)
{
  ZTestOptions options;
  options.significance = .05;
  Rates rates;
  const double share = 1.0 / num_trials;
  for (int trial = 0; trial < num_trials; ++trial) {
    const std::uint32_t seed = static_cast<std::uint32_t>(trial);
    const ZTestResult result =
        test_of(estimate_make(24, 20, 2 * seed, relative_noise, 0, is_grey, as_half),
                estimate_make(24, 20, 2 * seed + 1, relative_noise, 0, is_grey, as_half), options);
    rates.pixel += result.pixel_p < .05 ? share : 0;
    rates.block += result.block_p < .05 ? share : 0;
    rates.mean += result.mean_p < .05 ? share : 0;
    rates.chi2 += result.chi2_p < .05 ? share : 0;
    rates.all += result.passed ? 0 : share;
  }
  return rates;
}

}  // namespace

TEST(ZTest, RejectsCorrectPicturesAtTheStatedRate)
{
  // 4000 trials, α = 0.05: 4 standard deviations of the rate are 0.0138. The combined rate may be smaller, since the four
  // tests see the same data.
  const Rates rates = rates_under_null(4000, .1, false, false);
  EXPECT_NEAR(rates.pixel, .05, .0138);
  EXPECT_NEAR(rates.block, .05, .0138);
  EXPECT_NEAR(rates.mean, .05, .0138);
  EXPECT_NEAR(rates.chi2, .05, .0138);
  EXPECT_LT(rates.all, .05 + .0138);
  EXPECT_GT(rates.all, .03);
}

TEST(ZTest, EqualChannelsDoNotRaiseTheRate)
{
  const Rates rates = rates_under_null(2000, .1, true, false);
  // 4 standard deviations for 2000 trials: 0.0195. Three equal channels count once but are corrected thrice.
  EXPECT_LT(rates.all, .05 + .0195);
  EXPECT_GT(rates.all, .005);
}

TEST(ZTest, RoundingToHalvesIsNoise)
{
  // The noise is a tenth of a half's spacing: without an allowance nearly every trial would fail.
  const Rates rates = rates_under_null(1000, 1e-5, false, true);
  EXPECT_LT(rates.all, .05 + .0276);
}

TEST(ZTest, FindsASmallBiasThatNoPixelShows)
{
  // A tenth of a difference's typical standard deviation; 64² pixels make it 6 or 7 of the mean's.
  const Estimate a = estimate_make(64, 64, 1, .1, .04), b = estimate_make(64, 64, 2, .1);
  const ZTestResult result = test_of(a, b);
  EXPECT_FALSE(result.passed);
  EXPECT_GT(result.pixel_p, .01);
  EXPECT_LT(result.mean_p, 1e-5);
  EXPECT_GT(result.largest_mean.z, 5);
}

TEST(ZTest, FindsASingleWrongPixelAndSaysWhere)
{
  Estimate a = estimate_make(64, 64, 3, .1);
  const Estimate b = estimate_make(64, 64, 4, .1);
  a.mean.channels[2].values[10 * 64 + 33] -= 5.f;
  const ZTestResult result = test_of(a, b);
  EXPECT_FALSE(result.passed);
  EXPECT_EQ(result.largest_pixel.x, 33);
  EXPECT_EQ(result.largest_pixel.y, 10);
  EXPECT_EQ(result.largest_pixel.channel, "B");
  EXPECT_LT(result.largest_pixel.z, 0);
}

TEST(ZTest, FindsAWrongRegion)
{
  Estimate a = estimate_make(128, 128, 5, .1);
  const Estimate b = estimate_make(128, 128, 6, .1);
  for (std::size_t y = 40; y < 48; ++y) {
    for (std::size_t x = 80; x < 88; ++x) {
      a.mean.channels[1].values[y * 128 + x] += 1.3f * std::sqrt(a.variance.channels[1].values[y * 128 + x]);
    }
  }
  const ZTestResult result = test_of(a, b);
  EXPECT_FALSE(result.passed);
  EXPECT_LT(result.block_p, .0025);
  EXPECT_EQ(result.largest_block.x, 80);
  EXPECT_EQ(result.largest_block.y, 40);
}

TEST(ZTest, FindsVariancesThatAreTooSmall)
{
  // Noise twice as strong as claimed, in every block: the sum of squares sees it first.
  Estimate a = estimate_make(64, 64, 7, .1), b = estimate_make(64, 64, 8, .1);
  for (Estimate* estimate : {&a, &b}) {
    for (Channel& channel : estimate->variance.channels) {
      for (float& v : channel.values) {
        v *= .25f;
      }
    }
  }
  EXPECT_LT(test_of(a, b).chi2_p, 1e-6);
}

TEST(ZTest, WithoutVarianceEqualPassesAndUnequalFails)
{
  Estimate a{constant_picture(16, 16, .5f, .25f, 0), constant_picture(16, 16, 0, 0, 0)};
  Estimate b = a;
  EXPECT_TRUE(test_of(a, b).passed);
  EXPECT_EQ(test_of(a, b).p, 1);
  b.mean.channels[0].values[3] *= 1 + 4e-7f;  // a few ulps: another order of summation
  EXPECT_TRUE(test_of(a, b).passed);
  b.mean.channels[0].values[3] *= 1 + 1e-4f;
  const ZTestResult result = test_of(a, b);
  EXPECT_FALSE(result.passed);
  EXPECT_EQ(result.num_certain, 1u);
  EXPECT_TRUE(std::isinf(result.largest_pixel.z));
  ZTestOptions options;
  options.variance_floor = 1e-6;
  EXPECT_TRUE(test_of(a, b, options).passed);
}

TEST(ZTest, AllowsAStatedShareOfOutliers)
{
  Estimate a = estimate_make(64, 64, 9, .1);
  const Estimate b = estimate_make(64, 64, 10, .1);
  for (std::size_t i = 0; i < 10; ++i) {
    const std::size_t at = i * 397;
    a.mean.channels[i % 3].values[at] += (i % 2 == 0 ? 8.f : -8.f) * std::sqrt(a.variance.channels[i % 3].values[at]);
  }
  ZTestOptions options;
  EXPECT_FALSE(test_of(a, b, options).passed);
  options.allowed_outliers = .0025;  // 30 of 12,288
  EXPECT_GT(test_of(a, b, options).pixel_p, .01);
}

TEST(ZTest, FailsForNan)
{
  Estimate a = estimate_make(8, 8, 11, .1);
  a.mean.channels[0].values[0] = std::numeric_limits<float>::quiet_NaN();
  const ZTestResult result = test_of(a, estimate_make(8, 8, 12, .1));
  EXPECT_FALSE(result.passed);
  EXPECT_EQ(result.num_nonfinite, 1u);
}

TEST(Distributions, MatchClosedForms)
{
  EXPECT_NEAR(normal_two_sided_p(1.959963984540054), .05, 1e-14);
  EXPECT_NEAR(normal_two_sided_p(-10) / 1.523970604832105e-23, 1, 1e-10);
  EXPECT_NEAR(sidak_p(.01, 3), 1 - .99 * .99 * .99, 1e-15);
  EXPECT_NEAR(sidak_p(1e-20, 1e6) / 1e-14, 1, 1e-9);
  EXPECT_EQ(sidak_p(1, 5), 1);
  for (const double x : {.01, .5, 1.0, 2.0, 3.9, 4.1, 10.0, 50.0}) {
    EXPECT_NEAR(chi2_upper_p(x, 1) / std::erfc(std::sqrt(x / 2)), 1, 1e-11) << x;
    EXPECT_NEAR(chi2_upper_p(x, 2) / std::exp(-x / 2), 1, 1e-12) << x;
    EXPECT_NEAR(chi2_upper_p(x, 4) / (std::exp(-x / 2) * (1 + x / 2)), 1, 1e-12) << x;
  }
  EXPECT_EQ(chi2_upper_p(0, 3), 1);
  EXPECT_EQ(chi2_upper_p(std::numeric_limits<double>::infinity(), 3), 0);
}

TEST(Distributions, ChiSquareApproachesANormalForManyDegreesOfFreedom)
{
  // Wilson and Hilferty's cube root is good to better than 1e-4 here.
  for (const double dof : {1e3, 1e5, 1e6}) {
    for (const double z : {-3.0, -1.0, 0.0, 1.0, 3.0}) {
      const double root = 1 - 2 / (9 * dof) + z * std::sqrt(2 / (9 * dof));
      EXPECT_NEAR(chi2_upper_p(dof * root * root * root, dof), .5 * std::erfc(z / std::sqrt(2.0)), 1e-4) << dof;
    }
  }
}

}  // namespace relief
