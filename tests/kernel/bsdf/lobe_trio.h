// What the tests of single lobes share: a lobe as three functions of directions, its albedo, the integral of its density,
// and its χ² test.
#pragma once

#include <functional>
#include <string>

#include "tests/kernel/bsdf/bsdf_fixture.h"
#include "tests/support/chi2.h"

namespace relief {

/// A lobe as the tests see it. `f` is the largest channel.
struct LobeTrio {
  std::string name;
  std::function<float(Vec3f wo, Vec3f wi, float* pdf)> eval;
  std::function<Vec3f(Vec3f wo, Vec2f u)> sample;
  bool is_below = false;        ///< wi.z < 0
  bool is_reciprocal = true;    ///< f(wo, wi) = f(wi, wo)
  double largest_albedo = 1;    ///< what the model reaches, in a furnace
  double pdf_tolerance = 5e-3;  ///< of integrals by midpoints
};

inline bool is_on_side(const LobeTrio& lobe, Vec3f wi) { return lobe.is_below ? wi.z < 0.0f : wi.z > 0.0f; }

/// ∫ f |cos| and ∫ pdf over the lobe's side.
struct LobeIntegrals {
  double albedo = 0, pdf = 0;
};

/// Midpoints in (x, azimuth) with z = 3x² − 2x³, which puts more points near the horizon and the pole; for lobes that
/// are not sharp.
inline LobeIntegrals lobe_integrals(const LobeTrio& lobe, Vec3f wo, int num_z = 400, int num_phi = 360)
{
  LobeIntegrals sum;
  const double cell = 2.0 * 3.14159265358979 / num_phi / num_z;
  for (int i = 0; i < num_z; ++i) {
    const double x = (i + 0.5) / num_z;
    const double z = x * x * (3.0 - 2.0 * x);
    const double weight = 6.0 * x * (1.0 - x) * cell;
    for (int j = 0; j < num_phi; ++j) {
      const double phi = 2.0 * 3.14159265358979 * (j + 0.5) / num_phi;
      float pdf = 0;
      const Vec3f wi = direction(static_cast<float>(lobe.is_below ? -z : z), static_cast<float>(phi));
      const double f = static_cast<double>(lobe.eval(wo, wi, &pdf));
      sum.albedo += f * z * weight;
      sum.pdf += static_cast<double>(pdf) * weight;
    }
  }
  return sum;
}

/// Share of samples on the lobe's side, and albedo by them.
inline LobeIntegrals lobe_sampled(const LobeTrio& lobe, Vec3f wo, std::uint32_t num_samples = 1u << 16)
{
  LobeIntegrals sum;
  for (std::uint32_t n = 0; n < num_samples; ++n) {
    const Vec3f wi = lobe.sample(wo, sequence_point(n).u);
    if (!is_on_side(lobe, wi)) continue;
    float pdf = 0;
    const double f = static_cast<double>(lobe.eval(wo, wi, &pdf));
    if (!(pdf > 0.0f)) continue;
    sum.albedo += f * std::fabs(static_cast<double>(wi.z)) / static_cast<double>(pdf);
    sum.pdf += 1.0;
  }
  sum.albedo /= num_samples;
  sum.pdf /= num_samples;
  return sum;
}

inline Chi2Result lobe_chi2(const LobeTrio& lobe, Vec3f wo, std::uint64_t seed, int num_samples = 1000000)
{
  Chi2Histogram histogram(16, 24);
  TestRandom random(seed);
  for (int n = 0; n < num_samples; ++n) {
    const float u = random.next();
    const Vec3f wi = lobe.sample(wo, {u, random.next()});
    if (is_on_side(lobe, wi)) {
      histogram.add(wi.x, wi.y, wi.z);
    } else {
      histogram.add_absorbed();
    }
  }
  return histogram.test([&](double x, double y, double z) {
    const Vec3f wi{static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
    if (!is_on_side(lobe, wi)) return 0.0;
    float pdf = 0;
    lobe.eval(wo, wi, &pdf);
    return static_cast<double>(pdf);
  });
}

}  // namespace relief
