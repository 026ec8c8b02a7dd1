#include "exporters/flip.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/exporters/test_pictures.h"

namespace relief {

namespace {

// A second implementation, in double precision and straight from the paper's formulae: two-dimensional kernels instead of
// separated ones, absolute XYZ from the standard's rounded matrix and the white of its row sums.
namespace oracle {

constexpr double kPixelsPerDegree = 67.02;

struct Color {
  double x, y, z;
};

Color xyz_from_linear(const Color& c)
{
  return {.4123908 * c.x + .3575843 * c.y + .1804808 * c.z, .2126390 * c.x + .7151687 * c.y + .0721923 * c.z,
          .0193308 * c.x + .1191948 * c.y + .9505322 * c.z};
}

Color linear_from_xyz(const Color& c)
{
  return {3.2409699 * c.x - 1.5373832 * c.y - .4986108 * c.z, -.9692436 * c.x + 1.8759675 * c.y + .0415551 * c.z,
          .0556301 * c.x - .2039770 * c.y + 1.0569715 * c.z};
}

const Color kWhite = xyz_from_linear({1, 1, 1});

double lab_f(double t) { return t > 216.0 / 24389 ? std::cbrt(t) : (24389.0 / 27 * t + 16) / 116; }

Color hunt(const Color& linear)
{
  const Color xyz = xyz_from_linear(linear);
  const double fx = lab_f(xyz.x / kWhite.x), fy = lab_f(xyz.y / kWhite.y), fz = lab_f(xyz.z / kWhite.z);
  const double L = 116 * fy - 16;
  return {L, .01 * L * 500 * (fx - fy), .01 * L * 200 * (fy - fz)};
}

double hyab(const Color& a, const Color& b)
{
  return std::abs(a.x - b.x) + std::sqrt((a.y - b.y) * (a.y - b.y) + (a.z - b.z) * (a.z - b.z));
}

double color_error(const Color& linear_a, const Color& linear_b)
{
  const double largest = std::pow(hyab(hunt({0, 1, 0}), hunt({0, 0, 1})), .7);
  const double e = std::pow(hyab(hunt(linear_a), hunt(linear_b)), .7);
  return e < .4 * largest ? .95 / (.4 * largest) * e : .95 + (e - .4 * largest) / (.6 * largest) * .05;
}

struct Image {
  int width, height;
  std::vector<Color> pixels;
  const Color& at(int x, int y) const
  {
    return pixels[static_cast<std::size_t>(std::clamp(y, 0, height - 1) * width + std::clamp(x, 0, width - 1))];
  }
};

Image image_of(const Picture& p)
{
  Image image{p.width, p.height, {}};
  for (std::size_t i = 0; i < p.channels[0].values.size(); ++i) {
    const Color xyz = xyz_from_linear({std::clamp(double{p.channels[0].values[i]}, 0.0, 1.0),
                                       std::clamp(double{p.channels[1].values[i]}, 0.0, 1.0),
                                       std::clamp(double{p.channels[2].values[i]}, 0.0, 1.0)});
    const double y = xyz.y / kWhite.y;
    image.pixels.push_back({116 * y - 16, 500 * (xyz.x / kWhite.x - y), 200 * (y - xyz.z / kWhite.z)});
  }
  return image;
}

double csf(double x2, double a1, double b1, double a2, double b2)
{
  return a1 * std::sqrt(M_PI / b1) * std::exp(-M_PI * M_PI * x2 / b1) +
         a2 * std::sqrt(M_PI / b2) * std::exp(-M_PI * M_PI * x2 / b2);
}

Color filtered(const Image& image, int x, int y)
{
  const int radius = static_cast<int>(std::ceil(3 * std::sqrt(.04 / (2 * M_PI * M_PI)) * kPixelsPerDegree));
  Color sum{0, 0, 0}, weight{0, 0, 0};
  for (int j = -radius; j <= radius; ++j) {
    for (int i = -radius; i <= radius; ++i) {
      const double x2 = (i * i + j * j) / (kPixelsPerDegree * kPixelsPerDegree);
      const Color w{csf(x2, 1, .0047, 0, 1e-5), csf(x2, 1, .0053, 0, 1e-5), csf(x2, 34.1, .04, 13.5, .025)};
      const Color& c = image.at(x + i, y + j);
      sum = {sum.x + w.x * c.x, sum.y + w.y * c.y, sum.z + w.z * c.z};
      weight = {weight.x + w.x, weight.y + w.y, weight.z + w.z};
    }
  }
  const Color opponent{sum.x / weight.x, sum.y / weight.y, sum.z / weight.z};
  const double Y = (opponent.x + 16) / 116;
  const Color rgb =
      linear_from_xyz({(opponent.y / 500 + Y) * kWhite.x, Y * kWhite.y, (Y - opponent.z / 200) * kWhite.z});
  return {std::clamp(rgb.x, 0.0, 1.0), std::clamp(rgb.y, 0.0, 1.0), std::clamp(rgb.z, 0.0, 1.0)};
}

/// @param derivative  1: edges, 2: points
double feature(const Image& image, int x, int y, int derivative)
{
  const double sigma = .5 * .082 * kPixelsPerDegree;
  const int radius = static_cast<int>(std::ceil(3 * sigma));
  const auto weight_at = [&](int i, int j) {
    const double g = std::exp(-(i * i + j * j) / (2 * sigma * sigma));
    return derivative == 1 ? -i * g : (i * i / (sigma * sigma) - 1) * g;
  };
  double positive = 0, negative = 0;
  for (int j = -radius; j <= radius; ++j) {
    for (int i = -radius; i <= radius; ++i) {
      (weight_at(i, j) > 0 ? positive : negative) += std::abs(weight_at(i, j));
    }
  }
  double across = 0, along = 0;
  for (int j = -radius; j <= radius; ++j) {
    for (int i = -radius; i <= radius; ++i) {
      const double Y = (image.at(x + i, y + j).x + 16) / 116;
      across += Y * weight_at(i, j) / (weight_at(i, j) > 0 ? positive : negative);
      along += Y * weight_at(j, i) / (weight_at(j, i) > 0 ? positive : negative);
    }
  }
  return std::sqrt(across * across + along * along);
}

double flip(const Image& a, const Image& b, int x, int y)
{
  const double color = color_error(filtered(a, x, y), filtered(b, x, y));
  const double difference = std::max(std::abs(feature(a, x, y, 1) - feature(b, x, y, 1)),
                                     std::abs(feature(a, x, y, 2) - feature(b, x, y, 2)));
  return std::pow(color, 1 - std::sqrt(difference / std::sqrt(2.0)));
}

}  // namespace oracle

std::vector<float> map_of(const Picture& a, const Picture& b, const FlipOptions& options = {})
{
  return flip_map(picture_layer(a, ""), picture_layer(b, ""), options);
}

}  // namespace

TEST(Flip, AgreesWithTheFormulaeInDoublePrecision)
{
  // Blocks of noise: flat places, edges and points, some values beyond what a display shows.
  Picture a = random_picture(33, 26, 1, 1.2f), b = random_picture(33, 26, 2, 1.2f);
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t i = 0; i < 33 * 13; ++i) {
      a.channels[c].values[i] = i % 33 < 12 ? .8f : .1f;
      b.channels[c].values[i] = i % 33 < 14 ? .7f : .12f;
    }
  }
  const std::vector<float> map = map_of(a, b);
  const oracle::Image image_a = oracle::image_of(a), image_b = oracle::image_of(b);
  double worst = 0;
  for (int y = 0; y < 26; ++y) {
    for (int x = 0; x < 33; ++x) {
      const double error = double{map[static_cast<std::size_t>(y * 33 + x)]} - oracle::flip(image_a, image_b, x, y);
      worst = std::max(worst, std::abs(error));
    }
  }
  // Powers below 1 make rounding errors of small differences visible in the fourth digit.
  EXPECT_LT(worst, 5e-4);
}

TEST(Flip, OfEqualPicturesIsZeroAndOfGreenAndBlueOne)
{
  const Picture noise = random_picture(20, 20, 3);
  for (const float error : map_of(noise, noise)) {
    EXPECT_EQ(error, 0.f);
  }
  for (const float error : map_of(constant_picture(20, 20, 0, 1, 0), constant_picture(20, 20, 0, 0, 1))) {
    EXPECT_NEAR(error, 1.f, 1e-5f);
  }
}

TEST(Flip, OfConstantPicturesIsTheClosedForm)
{
  // No features, and a filter does not change a constant: what remains is the colour error.
  const oracle::Color colors[] = {{0, 0, 0}, {1, 1, 1}, {.5, .2, .1}, {.01, .02, .5}, {.5, .5, .5}, {.52, .5, .5}};
  for (const oracle::Color& a : colors) {
    for (const oracle::Color& b : colors) {
      const auto picture = [](const oracle::Color& c) {
        return constant_picture(15, 11, static_cast<float>(c.x), static_cast<float>(c.y), static_cast<float>(c.z));
      };
      for (const float error : map_of(picture(a), picture(b))) {
        EXPECT_NEAR(double{error}, oracle::color_error(a, b), 2e-4);
      }
    }
  }
}

TEST(Flip, StaysInRangeAndIsSymmetric)
{
  const Picture a = random_picture(40, 30, 4, 3.f), b = random_picture(40, 30, 5, 3.f);
  const std::vector<float> forth = map_of(a, b), back = map_of(b, a);
  for (std::size_t i = 0; i < forth.size(); ++i) {
    EXPECT_GE(forth[i], 0.f);
    EXPECT_LE(forth[i], 1.f);
  }
  EXPECT_EQ(forth, back);
}

TEST(Flip, GrowsWithTheNoise)
{
  const Picture base = constant_picture(40, 40, .4f, .4f, .4f);
  double last = 0;
  for (const float amount : {.02f, .05f, .1f, .2f, .4f}) {
    Picture noisy = base;
    const Picture noise = random_picture(40, 40, 6);
    for (std::size_t c = 0; c < 3; ++c) {
      for (std::size_t i = 0; i < noise.channels[c].values.size(); ++i) {
        noisy.channels[c].values[i] += amount * (noise.channels[c].values[i] - .5f);
      }
    }
    const double error = flip_mean(map_of(noisy, base));
    EXPECT_GT(error, last) << amount;
    last = error;
  }
}

TEST(Flip, FineNoiseMattersLessFromFurtherAway)
{
  const Picture base = constant_picture(60, 60, .4f, .4f, .4f);
  Picture checkered = base;
  for (Channel& channel : checkered.channels) {
    for (std::size_t i = 0; i < channel.values.size(); ++i) {
      channel.values[i] += (i % 60 + i / 60) % 2 == 0 ? .1f : -.1f;
    }
  }
  FlipOptions far;
  far.pixels_per_degree = 140;
  FlipOptions near;
  near.pixels_per_degree = 20;
  EXPECT_LT(flip_mean(map_of(checkered, base, far)), .5 * flip_mean(map_of(checkered, base, near)));
}

TEST(Flip, ExposureDecidesWhatTheDisplayShows)
{
  const Picture a = constant_picture(12, 12, 4, 4, 4), b = constant_picture(12, 12, 8, 8, 8);
  EXPECT_EQ(flip_mean(map_of(a, b)), 0);  // both white
  FlipOptions options;
  options.exposure = -4;
  EXPECT_NEAR(flip_mean(map_of(a, b, options)), oracle::color_error({.25, .25, .25}, {.5, .5, .5}), 2e-4);
}

TEST(Flip, TreatsNanAsBlackAndTakesPicturesSmallerThanItsFilters)
{
  Picture nan = constant_picture(2, 1, std::nanf(""), std::nanf(""), std::nanf(""));
  EXPECT_EQ(flip_mean(map_of(nan, constant_picture(2, 1, 0, 0, 0))), 0);
  EXPECT_GT(flip_mean(map_of(nan, constant_picture(2, 1, 1, 1, 1))), .9);
}

}  // namespace relief
