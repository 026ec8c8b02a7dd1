// What tests of the choice among lights have in common: random numbers, and moments of estimates of irradiance.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "kernel/light/light_sampler.h"

namespace relief {

struct Random {
  std::uint64_t state;
  double next()
  {
    state = hash_mix(state + 0x9e3779b97f4a7c15u);
    return static_cast<double>(state >> 11) * 0x1p-53;
  }
  float unit() { return std::min(static_cast<float>(next()), 0x1.fffffep-1f); }
  float between(double a, double b) { return static_cast<float>(a + (b - a) * next()); }
  Vec3f in_cube(double half) { return {between(-half, half), between(-half, half), between(-half, half)}; }
  Vec3f direction()
  {
    const double z = 2 * next() - 1, phi = 2 * std::numbers::pi * next(), r = std::sqrt(1 - z * z);
    return {static_cast<float>(r * std::cos(phi)), static_cast<float>(r * std::sin(phi)), static_cast<float>(z)};
  }
};

/// Irradiance at P, summed over the lights: each by its own sampling with many points.
inline double irradiance(const LightsView& view, Vec3f P, Vec3f N, std::uint32_t samples)
{
  double sum = 0;
  for (std::uint32_t i = 0; i < view.num_lights; ++i) {
    for (std::uint32_t k = 0; k < samples; ++k) {
      const LightSample sample = light_sample(view.lights[i], P, sample_2d(i, 2 * k, 0));
      if (sample.pdf > 0.0f) {
        sum += static_cast<double>(light_scalar(sample.radiance) * max(0.0f, dot(N, sample.wi)) / sample.pdf) / samples;
      }
    }
  }
  return sum;
}

struct Moments {
  double mean = 0, variance = 0;
};

/// Moments of one sample of lights_sample as an estimate of irradiance.
inline Moments sampler_moments(const LightsView& view, Vec3f P, Vec3f N, int samples)
{
  double sum = 0, squares = 0;
  for (int k = 0; k < samples; ++k) {
    const std::uint32_t hash = sample_pixel_hash(11, k, 0);
    const Sample2dX4 u = sample_2d_x4(hash, 0, 1);
    const LightSample sample = lights_sample(view, P, N, choice_point(u.first_bits[0], u.first_bits[1]));
    if (!(sample.pdf > 0.0f)) continue;
    const double value = static_cast<double>(light_scalar(sample.radiance) * max(0.0f, dot(N, sample.wi)) / sample.pdf);
    sum += value / samples;
    squares += value * value / samples;
  }
  return {sum, std::max(squares - sum * sum, 0.0)};
}

}  // namespace relief
