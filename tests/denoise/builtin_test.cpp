// The built-in denoiser on pictures whose truth is known in closed form.
#include "denoise/builtin.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <random>

#include "tests/denoise/test_picture.h"

namespace relief::test {
namespace {

double one(int, int) { return 1; }

bool all_finite(const std::vector<float>& values)
{
  return std::all_of(values.begin(), values.end(), [](float v) { return std::isfinite(v); });
}

/// Mean over all pixels and channels.
double mean_of(const std::vector<float>& color)
{
  double sum = 0;
  for (const float v : color) sum += static_cast<double>(v);
  return sum / static_cast<double>(color.size());
}

// 361 pixels of a window of which a regression takes in most: its mean has less than a hundredth of their variance.
TEST(BuiltinDenoiser, FlatNoiseFallsToAHundredth)
{
  const TestPicture picture = test_picture(128, 96, {}, one);
  const DenoiseResult result = denoise_builtin(picture.input());
  EXPECT_LT(picture.rmse(result.color), 0.01);
  EXPECT_GT(picture.rmse(result.color), 0.1 / 30) << "more pixels than there are within reach";
}

// 36,864 independent values: their mean has a standard deviation of 5.2e-4. Four of them.
TEST(BuiltinDenoiser, KeepsTheMean)
{
  const TestPicture picture = test_picture(128, 96, {}, [](int x, int) { return 1 + 0.5 * std::sin(0.1 * x); });
  const DenoiseResult result = denoise_builtin(picture.input());
  EXPECT_NEAR(mean_of(result.color), mean_of(picture.noisy()), 4 * 5.2e-4);
}

TEST(BuiltinDenoiser, EdgesOfTheAlbedoStay)
{
  const auto albedo = [](int x) { return x < 64 ? 0.2 : 0.8; };
  const TestPicture picture = test_picture(
      128, 96, {}, [&](int x, int) { return albedo(x); },
      [&](int x, int, float* features) {
        for (int c = 0; c < 3; ++c) features[c] = static_cast<float>(albedo(x));
      });
  const DenoiseResult result = denoise_builtin(picture.input());
  EXPECT_LT(picture.rmse(result.color), 0.02);
  EXPECT_LT(picture.rmse(result.color, 62, 66), 0.02) << "at the edge";
}

// No noise in fact, although the variance says so: whatever the weights, a linear function of the features is its own
// regression. The ridge takes a ten-thousandth.
TEST(BuiltinDenoiser, LinearFunctionsOfFeaturesAreReproduced)
{
  const auto truth = [](int x, int y) { return 0.2 + 0.01 * x + 0.004 * y; };
  TestPicture picture = test_picture(96, 80, {0, 0, 0, 1}, truth, [&](int x, int y, float* features) {
    features[0] = 0.01f * static_cast<float>(x);
    features[3] = 0.01f * static_cast<float>(y);
  });
  std::fill(picture.variance.begin(), picture.variance.end(), 0.01f);
  const DenoiseResult result = denoise_builtin(picture.input());
  EXPECT_LT(picture.rmse(result.color), 2e-5);
}

TEST(BuiltinDenoiser, WithoutVarianceThePictureIsReturnedUnchanged)
{
  const TestPicture picture =
      test_picture(50, 41, {0, 0, 0, 1}, [](int x, int y) { return (x * 7 + y * 13) % 11 * 0.3; });
  const DenoiseResult result = denoise_builtin(picture.input());
  EXPECT_EQ(result.color, picture.noisy());
  EXPECT_EQ(result.rmse, 0);
}

TEST(BuiltinDenoiser, PixelsOfOneSampleStay)
{
  TestPicture picture = test_picture(40, 40, {}, one);
  std::fill_n(picture.samples.begin(), 10 * 40, 1.0f);
  const DenoiseResult result = denoise_builtin(picture.input());
  const std::vector<float> noisy = picture.noisy();
  EXPECT_TRUE(std::equal(noisy.begin(), noisy.begin() + 3 * 10 * 40, result.color.begin()));
  EXPECT_TRUE(all_finite(result.color));
  EXPECT_EQ(result.error[0], result.color[0]) << "nothing is known of it";
  EXPECT_TRUE(std::isnan(result.rmse));
}

TEST(BuiltinDenoiser, FirefliesLeaveNoBlobs)
{
  const TestPicture clean = test_picture(128, 96, {}, one);
  TestPicture picture = clean;
  for (const int at : {0, 64, 3000, 3001, 5000, 9000, 12287}) {
    // In the odd-numbered samples of some, in the even-numbered of others.
    const auto pixel = static_cast<std::size_t>(at);
    for (std::size_t c = 0; c < 3; ++c) {
      picture.beauty[c * picture.num_pixels() + pixel] += 1e6f;
      if (at % 2 == 0) picture.half[c * picture.num_pixels() + pixel] += 2e6f;
      picture.variance[c * picture.num_pixels() + pixel] = 1e12f;
    }
  }
  const DenoiseResult result = denoise_builtin(picture.input()), expected = denoise_builtin(clean.input());
  EXPECT_LT(picture.rmse(result.color), 1.1 * picture.rmse(expected.color));
  EXPECT_LT(*std::max_element(result.color.begin(), result.color.end()), 1.1f);
}

// Bright in both halves: no firefly, but a highlight of one pixel's size.
TEST(BuiltinDenoiser, HighlightsStay)
{
  const TestPicture picture =
      test_picture(64, 64, {0.02, 0, 0, 1}, [](int x, int y) { return x % 16 == 8 && y % 16 == 8 ? 500.0 : 1.0; });
  const DenoiseResult result = denoise_builtin(picture.input());
  EXPECT_NEAR(result.color[3 * picture.pixel(24, 40)], 500, 0.2);
  EXPECT_LT(picture.rmse(result.color), 0.02);
}

TEST(BuiltinDenoiser, WhatIsNoNumberDoesNotSpread)
{
  TestPicture picture = test_picture(70, 60, {}, one);
  picture.beauty[1000] = std::numeric_limits<float>::quiet_NaN();
  picture.half[2000] = std::numeric_limits<float>::infinity();
  picture.variance[3000] = std::numeric_limits<float>::quiet_NaN();
  picture.features[500] = std::numeric_limits<float>::infinity();
  picture.features_half[600] = std::numeric_limits<float>::quiet_NaN();
  picture.samples[700] = std::numeric_limits<float>::infinity();
  // Numbers, but the odd-numbered samples' mean is none: infinite in two channels, and no luminance.
  for (const float sign : {1.0f, -1.0f}) {
    const std::size_t at = 1500 + (sign < 0 ? picture.num_pixels() : 0);
    picture.beauty[at] = sign * 3e38f;
    picture.half[at] = sign * -3e38f;
  }
  const DenoiseResult result = denoise_builtin(picture.input());
  EXPECT_TRUE(all_finite(result.color));
  EXPECT_TRUE(all_finite(result.error));
}

TEST(BuiltinDenoiser, GivesUpWhenToldTo)
{
  const TestPicture picture = test_picture(40, 30, {}, one);
  std::atomic<bool> stop{true};
  DenoiseInput input = picture.input();
  input.stop = &stop;
  EXPECT_THROW(denoise_builtin(input), DenoiseStopped);
  stop = false;
  EXPECT_EQ(denoise_builtin(input).color, denoise_builtin(picture.input()).color);
}

TEST(BuiltinDenoiser, AnySize)
{
  for (const auto& [width, height] : {std::pair(1, 1), {1, 40}, {40, 1}, {3, 2}, {33, 31}}) {
    const TestPicture picture = test_picture(width, height, {}, one);
    const DenoiseResult result = denoise_builtin(picture.input());
    ASSERT_EQ(result.color.size(), 3 * picture.num_pixels());
    ASSERT_EQ(result.error.size(), 3 * picture.num_pixels());
    EXPECT_TRUE(all_finite(result.color)) << width << "x" << height;
    EXPECT_TRUE(all_finite(result.error)) << width << "x" << height;
    EXPECT_LT(picture.rmse(result.color), 0.3);
  }
}

// A lens or motion: features that are as noisy as they are different. Without halves of their own they would be detail.
TEST(BuiltinDenoiser, NoiseOfFeaturesIsNotBroughtIntoThePicture)
{
  const TestPicture picture =
      test_picture(128, 96, {0.1, 0, 0.05, 1}, one, [](int x, int, float* features) { features[0] = x < 64 ? 0 : 1; });
  const DenoiseResult result = denoise_builtin(picture.input());
  EXPECT_LT(picture.rmse(result.color), 0.015);
}

TEST(BuiltinDenoiser, SameBitsWithAnyNumberOfThreads)
{
  const TestPicture picture = test_picture(100, 130, {}, [](int x, int y) { return 1 + 0.3 * ((x / 9 + y / 7) % 2); });
  const DenoiseResult many = denoise_builtin(picture.input());
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
  const DenoiseResult alone = denoise_builtin(picture.input());
  EXPECT_EQ(many.color, alone.color);
  EXPECT_EQ(many.error, alone.error);
}

TEST(BuiltinDenoiser, InstructionSetsAgree)
{
  const TestPicture picture = test_picture(64, 64, {}, [](int x, int y) { return 1 + 0.3 * ((x / 9 + y / 7) % 2); });
  const DenoiseResult best = denoise_builtin(picture.input());
  setenv("RELIEF_ISA", "baseline", 1);
  const DenoiseResult baseline = denoise_builtin(picture.input());
  unsetenv("RELIEF_ISA");
  for (std::size_t i = 0; i < best.color.size(); ++i) ASSERT_NEAR(best.color[i], baseline.color[i], 1e-3f) << i;
}

/// Detail that no feature knows and no neighbour shares: one of two values, by chance.
double speckle(int x, int y)
{
  // A few rounds of a hash of the pixel.
  unsigned h = static_cast<unsigned>(x) * 0x9e3779b9u ^ static_cast<unsigned>(y) * 0x85ebca6bu;
  for (int i = 0; i < 3; ++i) h = (h ^ h >> 15) * 0x2c1b3c6du;
  return (h >> 16 & 1u) == 0 ? 0.85 : 1.15;
}

// Halves of one point set differ by more than the picture is off, here twice as much. Taken for its noise, that would be more
// than the detail, and worth blurring.
TEST(BuiltinDenoiser, DetailIsNotTakenForWhatHalvesLackOfEachOther)
{
  const TestPicture picture = test_picture(128, 96, {0.1, -0.6, 0, 8}, speckle);
  const DenoiseResult result = denoise_builtin(picture.input());
  EXPECT_LT(picture.rmse(result.color), picture.rmse(picture.noisy()));
  EXPECT_NEAR(result.rmse / picture.rmse(result.color), 1, 0.1);
}

// As large as the noise: a little may be gained, and it is known how much is not.
TEST(BuiltinDenoiser, DetailThatNothingTellsFromNoiseIsHalfDenoised)
{
  const TestPicture picture = test_picture(128, 96, {0.15, 0, 0, 9}, speckle);
  const DenoiseResult result = denoise_builtin(picture.input());
  // The best linear estimate halves the squared error.
  EXPECT_NEAR(picture.rmse(result.color) / picture.rmse(picture.noisy()), std::sqrt(0.5), 0.06);
  EXPECT_NEAR(result.rmse / picture.rmse(result.color), 1, 0.1);
}

/// Four samples a pixel before a grey wall, of which some hit a lamp of less than a pixel's size.
/// @param is_emitter  whether features tell, as a render's albedo does
TestPicture lamps(bool is_emitter, unsigned seed)
{
  constexpr float kRadiance = 20;
  TestPicture picture = test_picture(128, 96, {0.05, 0, 0, seed}, one);
  std::mt19937 engine(seed + 100);
  std::uniform_real_distribution<double> uniform;
  const std::size_t n = picture.num_pixels();
  for (std::size_t pixel = 0; pixel < n; ++pixel) {
    // In the upper third.
    const double coverage = pixel < n / 3 && uniform(engine) < 0.1 ? uniform(engine) : 0.0;
    float even = 0, odd = 0;
    for (int sample = 0; sample < 4; ++sample) (sample % 2 == 0 ? even : odd) += uniform(engine) < coverage ? 0.5f : 0;
    const float mean = 0.5f * (even + odd);
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t at = c * n + pixel;
      picture.truth[at] += static_cast<double>(kRadiance) * coverage;
      picture.beauty[at] += kRadiance * mean;
      picture.half[at] += kRadiance * even;
      picture.variance[at] += kRadiance * kRadiance * mean * (1 - mean) / 3;
      picture.features[at] = 0.5f + (is_emitter ? kRadiance * mean : 0);
      picture.features_half[at] = 0.5f + (is_emitter ? kRadiance * even : 0);
    }
    picture.samples[pixel] = 4;
  }
  return picture;
}

/// Of pixels of some rows that are wall alone.
double rmse_of_wall(const TestPicture& picture, const std::vector<float>& color, int first_row, int end_row)
{
  double sum = 0, count = 0;
  for (std::size_t pixel = picture.pixel(0, first_row); pixel < picture.pixel(0, end_row); ++pixel) {
    if (picture.truth[pixel] > 1) continue;
    sum += std::pow(static_cast<double>(color[3 * pixel]) - 1, 2.0);
    ++count;
  }
  return std::sqrt(sum / count);
}

// Filtered like other features, emission makes blobs: .35 on the wall between the lamps.
TEST(BuiltinDenoiser, SmallLampsStayAndTheWallBesideThemIsDenoised)
{
  const TestPicture picture = lamps(true, 10);
  const DenoiseResult result = denoise_builtin(picture.input());
  EXPECT_LT(rmse_of_wall(picture, result.color, 0, 32), 0.1) << "between the lamps";
  EXPECT_LT(rmse_of_wall(picture, result.color, 45, 96), 0.01) << "away from them";
  EXPECT_LT(picture.rmse(result.color), picture.rmse(picture.noisy()));
  EXPECT_NEAR(result.rmse / picture.rmse(result.color), 1, 0.2);
}

// Lamps that only the colours know are like noise of rare samples; blurred they would be half as far off again.
TEST(BuiltinDenoiser, SpotsThatNoFeatureKnowsDoNotBecomeBlobs)
{
  const TestPicture picture = lamps(false, 11);
  const DenoiseResult result = denoise_builtin(picture.input());
  EXPECT_LT(picture.rmse(result.color), 1.05 * picture.rmse(picture.noisy()));
  EXPECT_NEAR(result.rmse / picture.rmse(result.color), 1, 0.2);
}

struct ErrorCase {
  const char* name;
  TestNoise noise;
  double (*truth)(int, int);
  double tolerance = 0.2;
};

/// What the features do not know: each in a way of its own that a filter blurs.
const ErrorCase kErrorCases[] = {
    {"flat", {0.1, 0, 0, 1}, one},
    {"waves", {0.1, 0, 0, 2}, [](int x, int y) { return 1 + 0.3 * std::sin(0.3 * x) * std::cos(0.2 * y); }},
    // An edge between the four directions in which errors are followed: a third of its error, of three pixels' width, is missed.
    {"shadow", {0.1, 0, 0, 3}, [](int x, int y) { return x + y / 3 < 90 ? 0.3 : 1.0; }, 0.3},
    {"upright shadow", {0.1, 0, 0, 3}, [](int x, int) { return x < 90 ? 0.3 : 1.0; }},
    {"faint shadow", {0.2, 0, 0, 4}, [](int x, int y) { return x + y / 3 < 90 ? 0.8 : 1.0; }},
    {"squares", {0.1, 0, 0, 5}, [](int x, int y) { return 1 + 0.2 * ((x / 12 + y / 12) % 2); }},
    {"little noise", {0.01, 0, 0, 6}, [](int x, int y) { return 1 + 0.3 * std::sin(0.3 * x) * std::cos(0.2 * y); }},
    {"halves that complete each other", {0.1, -0.3, 0, 7}, [](int x, int) { return 1 + 0.3 * std::sin(0.3 * x); }},
};

// Each picture has 147,456 values, in windows of 361 pixels.
TEST(BuiltinDenoiser, TheErrorIsKnownWithinAFifth)
{
  for (const ErrorCase& error_case : kErrorCases) {
    const TestPicture picture = test_picture(256, 192, error_case.noise, error_case.truth);
    const DenoiseResult result = denoise_builtin(picture.input());
    const double truth = picture.rmse(result.color);
    EXPECT_LT(truth, picture.rmse(picture.noisy())) << error_case.name;
    RecordProperty(error_case.name, std::to_string(result.rmse / truth));
    EXPECT_NEAR(result.rmse / truth, 1, error_case.tolerance) << error_case.name << ": " << truth;
    double squares = 0;
    for (const float error : result.error) squares += static_cast<double>(error) * static_cast<double>(error);
    EXPECT_NEAR(std::sqrt(squares / static_cast<double>(result.error.size())), result.rmse, 1e-3 * result.rmse);
  }
}

// The rim of a lamp: its emission is albedo to a denoiser, and whatever sample meets it makes both noisy at once.
TEST(BuiltinDenoiser, TheErrorIsKnownWhereFeaturesHaveTheNoiseOfColors)
{
  TestPicture picture = test_picture(192, 128, {}, [](int x, int y) { return 1 + 0.1 * ((x * 5 + y * 3) % 7); });
  std::copy(picture.beauty.begin(), picture.beauty.end(), picture.features.begin());
  std::copy(picture.half.begin(), picture.half.end(), picture.features_half.begin());
  const DenoiseResult result = denoise_builtin(picture.input());
  EXPECT_NEAR(result.rmse / picture.rmse(result.color), 1, 0.25) << picture.rmse(result.color);
}

// The layer says where the error is: twice the noise on one side, twice the error.
TEST(BuiltinDenoiser, TheErrorIsWhereTheNoiseIs)
{
  TestPicture picture = test_picture(192, 96, {}, one);
  const TestPicture noisier = test_picture(192, 96, {0.4, 0, 0, 2}, one);
  const auto take = [&](std::vector<float>& to, const std::vector<float>& from) {
    for (std::size_t i = 0; i < to.size(); ++i) {
      if (i % 192 >= 96) to[i] = from[i];
    }
  };
  take(picture.beauty, noisier.beauty);
  take(picture.half, noisier.half);
  take(picture.variance, noisier.variance);
  const DenoiseResult result = denoise_builtin(picture.input());
  const auto claimed = [&](int x0, int x1) {
    double squares = 0;
    for (int y = 0; y < 96; ++y) {
      for (int x = x0; x < x1; ++x) {
        for (std::size_t c = 0; c < 3; ++c) squares += std::pow(result.error[3 * picture.pixel(x, y) + c], 2.0);
      }
    }
    return std::sqrt(squares / (96.0 * (x1 - x0) * 3));
  };
  EXPECT_NEAR(claimed(10, 80) / picture.rmse(result.color, 10, 80), 1, 0.3);
  EXPECT_NEAR(claimed(112, 182) / picture.rmse(result.color, 112, 182), 1, 0.3);
}

}  // namespace
}  // namespace relief::test
