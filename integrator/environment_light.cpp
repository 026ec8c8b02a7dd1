#include "integrator/environment_light.h"

#include <algorithm>

namespace relief {

EnvironmentIrradiance environment_irradiance(const EnvironmentTables& tables, Vec3f channels)
{
  const EnvironmentView environment = tables.view();
  EnvironmentIrradiance irradiance;
  if (!environment.has_map) {
    irradiance.mean = irradiance.constant = kPi * light_scalar(environment.color, channels);
    return irradiance;
  }
  // Moments ∫ L, ∫ L ω, ∫ L ω ωᵀ.
  constexpr std::uint32_t kSamples = 4096;
  double total = 0, linear[3] = {}, squares[3] = {}, products[3] = {};
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    const EnvironmentSample sample = environment_sample(environment, sample_2d(0, 2 * i, 0));
    const float bright = luminance(abs(sample.radiance));
    if (!(sample.pdf_solid_angle > 0.0f) || !(bright > tables.base_luminance)) continue;
    const float sampled = light_scalar(sample.radiance, channels) * (1.0f - tables.base_luminance / bright);
    const double L = static_cast<double>(sampled) / static_cast<double>(sample.pdf_solid_angle) / kSamples;
    const double w[3] = {static_cast<double>(sample.wi.x), static_cast<double>(sample.wi.y),
                         static_cast<double>(sample.wi.z)};
    total += L;
    for (std::size_t k = 0; k < 3; ++k) {
      linear[k] += L * w[k];
      squares[k] += L * w[k] * w[k];
      products[k] += L * w[k] * w[(k + 1) % 3];
    }
  }
  const auto vec = [](const double(&v)[3], double factor) {
    return Vec3f{static_cast<float>(v[0] * factor), static_cast<float>(v[1] * factor),
                 static_cast<float>(v[2] * factor)};
  };
  // Estimates need an order of magnitude only, so a map brighter than this may lose its shape.
  constexpr double kGreatest = 1e30;
  if (!(total < kGreatest)) {
    irradiance.mean = irradiance.constant = static_cast<float>(kGreatest);
    return irradiance;
  }
  irradiance.mean = static_cast<float>(total / 4);
  irradiance.constant = static_cast<float>(total * 3 / 32);
  irradiance.linear = vec(linear, 1.0 / 2);
  irradiance.squares = vec(squares, 15.0 / 32);
  irradiance.products = vec(products, 15.0 / 16);
  return irradiance;
}

void environment_integrate(LightSet& set)
{
  const EnvironmentView environment = set.environment.view();
  constexpr std::uint32_t kSamples = 4096;
  double sum = 0;
  double squares = 0;
  Vec3f color;
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    const EnvironmentSample sample = environment_sample_all(environment, sample_2d(0, 2 * i, 0));
    const double radiance = static_cast<double>(light_scalar(sample.radiance));
    sum += radiance / static_cast<double>(sample.pdf_solid_angle) / kSamples;
    color += abs(sample.radiance) / (sample.pdf_solid_angle * (4 * kPi * kSamples));
    squares += radiance * radiance / static_cast<double>(sample.pdf_solid_angle) / kSamples;
  }
  set.environment_flux_density = std::min(sum / 4, 1e30);
  set.environment_color = is_finite(color) ? color : Vec3f{};
  set.environment_solid_angle = squares > 0 ? sum * sum / squares : 0.0;
}

}  // namespace relief
