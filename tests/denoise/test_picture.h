// Pictures whose truth is known, with noise as a render has it.
#pragma once

#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "denoise/image.h"

namespace relief::test {

/// Pixels in planes of their own, channel by channel.
struct TestPicture {
  int width, height;
  std::vector<double> truth;                            ///< 3 planes
  std::vector<float> beauty, half, variance;            ///< 3 planes each
  std::vector<float> samples, features, features_half;  ///< 1, 7 and 7 planes

  std::size_t num_pixels() const { return static_cast<std::size_t>(width) * static_cast<std::size_t>(height); }
  std::size_t pixel(int x, int y) const
  {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
  }

  DenoiseInput input() const
  {
    DenoiseInput in;
    in.width = width;
    in.height = height;
    const auto plane = [&](const std::vector<float>& planes, std::size_t i) {
      return PlaneView{planes.data() + i * num_pixels(), 1, width};
    };
    for (std::size_t c = 0; c < 3; ++c) {
      in.beauty[c] = plane(beauty, c);
      in.half[c] = plane(half, c);
      in.variance[c] = plane(variance, c);
    }
    in.samples = plane(samples, 0);
    for (std::size_t i = 0; i < kNumFeatures; ++i) {
      in.features[i] = plane(features, i);
      in.features_half[i] = plane(features_half, i);
    }
    return in;
  }

  /// Root mean square error of pixels in pixel order, all or from x0 to x1.
  double rmse(const std::vector<float>& color, int x0 = 0, int x1 = 1 << 30) const
  {
    double sum = 0, count = 0;
    for (int y = 0; y < height; ++y) {
      for (int x = x0; x < std::min(x1, width); ++x) {
        for (std::size_t c = 0; c < 3; ++c) {
          const double off = static_cast<double>(color[3 * pixel(x, y) + c]) - truth[c * num_pixels() + pixel(x, y)];
          sum += off * off;
          ++count;
        }
      }
    }
    return std::sqrt(sum / count);
  }

  /// The picture itself, in pixel order.
  std::vector<float> noisy() const
  {
    std::vector<float> color(3 * num_pixels());
    for (std::size_t i = 0; i < num_pixels(); ++i) {
      for (std::size_t c = 0; c < 3; ++c) color[3 * i + c] = beauty[c * num_pixels() + i];
    }
    return color;
  }
};

struct TestNoise {
  double sigma = 0.1;        ///< of the pixel's mean
  double correlation = 0;    ///< of the halves
  double feature_sigma = 0;  ///< of the features' means
  unsigned seed = 1;
};

/// @param color     of a pixel, the same in R, G and B
/// @param features  fills in the pixel's seven
inline TestPicture test_picture(int width,
                                int height,
                                const TestNoise& noise,
                                const std::function<double(int, int)>& color,
                                const std::function<void(int, int, float*)>& features = {})
{
  TestPicture picture{width, height, {}, {}, {}, {}, {}, {}, {}};
  const std::size_t n = picture.num_pixels();
  picture.truth.resize(3 * n);
  for (std::vector<float>* planes : {&picture.beauty, &picture.half, &picture.variance}) planes->resize(3 * n);
  picture.samples.assign(n, 16);
  picture.features.assign(kNumFeatures * n, 0);
  picture.features_half = picture.features;
  std::mt19937 engine(noise.seed);
  std::normal_distribution<double> normal;
  // Mean and half the difference of two halves with that correlation are independent.
  const double half_difference = noise.sigma * std::sqrt((1 - noise.correlation) / (1 + noise.correlation));
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::size_t pixel = picture.pixel(x, y);
      for (std::size_t c = 0; c < 3; ++c) {
        const double truth = color(x, y), mean = truth + noise.sigma * normal(engine);
        picture.truth[c * n + pixel] = truth;
        picture.beauty[c * n + pixel] = static_cast<float>(mean);
        picture.half[c * n + pixel] = static_cast<float>(mean + half_difference * normal(engine));
        picture.variance[c * n + pixel] = static_cast<float>(noise.sigma * noise.sigma);
      }
      float of_pixel[kNumFeatures] = {};
      if (features) features(x, y, of_pixel);
      for (std::size_t i = 0; i < kNumFeatures; ++i) {
        const double mean = static_cast<double>(of_pixel[i]) + noise.feature_sigma * normal(engine);
        picture.features[i * n + pixel] = static_cast<float>(mean);
        picture.features_half[i * n + pixel] = static_cast<float>(mean + noise.feature_sigma * normal(engine));
      }
    }
  }
  return picture;
}

}  // namespace relief::test
