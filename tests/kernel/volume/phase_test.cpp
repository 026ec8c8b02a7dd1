#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>

#include "kernel/sample/sobol.h"
#include "kernel/volume/phase.h"
#include "tests/support/chi2.h"

namespace relief {
namespace {

struct Case {
  std::string name;
  Phase phase;
};

Phase draine(float g, float alpha) { return {{1, 1, 1}, g, alpha, PhaseKind::kDraine}; }
Phase particles(float backscatter, float index) { return fournier_forand_phase({1, 1, 1}, backscatter, index); }

const Case kCases[] = {{"Rayleigh", draine(0, 1)},
                       {"Draine .5 .5", draine(0.5f, 0.5f)},
                       {"Draine -.7 .8", draine(-0.7f, 0.8f)},
                       {"Draine .002 250", draine(0.002f, 250)},
                       {"Draine .4 250", draine(0.4f, 250)},
                       {"Draine .9 20", draine(0.9f, 20)},
                       {"particles .1 1.33", particles(0.1f, 1.33f)},
                       {"particles .02 1.1", particles(0.02f, 1.1f)},
                       {"particles .4 1.5", particles(0.4f, 1.5f)},
                       {"particles .2 2.4", particles(0.2f, 2.4f)},
                       // δ of 90 degrees is 1 there.
                       {"particles .2 1.8165", particles(0.2f, 1.0f + 0.81649658f)}};

/// Integral over cosines of a function, the peak ahead resolved: by the square of half an angle's sine, logarithmically.
template <typename Function>
double integrate(double from_sin2, double to_sin2, const Function& f)
{
  constexpr int kSteps = 400000;
  const double low = std::log(from_sin2), high = std::log(to_sin2), step = (high - low) / kSteps;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double sin2 = std::exp(low + (i + 0.5) * step);
    sum += f(1.0 - 2.0 * sin2) * sin2;
  }
  return sum * step * 4.0 * std::numbers::pi;
}

double pdf(const Phase& phase, double cosine)
{
  return static_cast<double>(phase_pdf(phase, static_cast<float>(cosine)));
}

TEST(PhaseFunctions, ScatterAllOfTheLight)
{
  for (const auto& [name, phase] : kCases) {
    // Up to 3 % of what particles scatter go less than a twentieth of a degree aside, where floats of cosines end.
    const double sin2 = phase.kind == PhaseKind::kFournierForand ? 1e-5 : 1e-9;
    const double ahead =
        phase.kind == PhaseKind::kFournierForand
            ? fournier_forand_share(sin2, static_cast<double>(phase.g), static_cast<double>(phase.shape))
            : 0.0;
    EXPECT_NEAR(ahead + integrate(sin2, 1, [&, p = phase](double c) { return pdf(p, c); }), 1.0, 2e-4) << name;
  }
}

TEST(PhaseFunctions, DrainesIsThatOfHisPaper)
{
  for (const double g : {-0.6, 0.0, 0.3, 0.85}) {
    for (const double alpha : {0.0, 0.5, 1.0, 40.0}) {
      const Phase phase = draine(static_cast<float>(g), static_cast<float>(alpha));
      double mean = 0;
      for (const double c : {-1.0, -0.4, 0.2, 0.9, 1.0}) {
        const double expected = 1 / (4 * std::numbers::pi) * (1 - g * g) / (1 + alpha * (1 + 2 * g * g) / 3) *
                                (1 + alpha * c * c) / std::pow(1 + g * g - 2 * g * c, 1.5);
        EXPECT_NEAR(pdf(phase, c) / expected, 1.0, 1e-5) << g << " " << alpha << " " << c;
      }
      mean = integrate(1e-9, 1, [&](double c) { return pdf(phase, c) * c; });
      const double expected = g * (1 + alpha * (3 + 2 * g * g) / 5) / (1 + alpha * (1 + 2 * g * g) / 3);  // Eq. 8
      EXPECT_NEAR(mean, expected, 1e-4) << g << " " << alpha;
    }
  }
  EXPECT_NEAR(pdf(draine(0, 1), 0.5), 3 / (16 * std::numbers::pi) * 1.25, 1e-7);
}

TEST(PhaseFunctions, ParticlesSendBackTheirShare)
{
  for (const float share : {0.02f, 0.1f, 0.3f}) {
    for (const float index : {1.05f, 1.33f, 1.9f}) {
      const Phase phase = particles(share, index);
      EXPECT_NEAR(integrate(0.5, 1, [&](double c) { return pdf(phase, c); }), static_cast<double>(share), 1e-4)
          << index;
    }
  }
}

TEST(PhaseFunctions, ParticlesAreThoseOfThePaper)
{
  // Mobley, Sundman and Boss 2002, "Phase function effects on oceanic light fields", Eq. 7: with ν = (3 − μ) / 2.
  for (const double index : {1.1, 1.33}) {
    const Phase phase = particles(0.05f, static_cast<float>(index));
    const double v = static_cast<double>(phase.shape);
    for (const double angle : {0.02, 0.3, 1.0, 2.0, 3.0}) {
      const auto delta = [&](double half) {
        return 4 / (3 * (index - 1) * (index - 1)) * std::sin(half) * std::sin(half);
      };
      const double d = delta(angle / 2), back = delta(std::numbers::pi / 2), s = std::sin(angle / 2);
      const double expected =
          1 / (4 * std::numbers::pi * (1 - d) * (1 - d) * std::pow(d, v)) *
              (v * (1 - d) - (1 - std::pow(d, v)) + (d * (1 - std::pow(d, v)) - v * (1 - d)) / (s * s)) +
          (1 - std::pow(back, v)) / (16 * std::numbers::pi * (back - 1) * std::pow(back, v)) *
              (3 * std::cos(angle) * std::cos(angle) - 1);
      EXPECT_NEAR(pdf(phase, std::cos(angle)) / expected, 1.0, 1e-3) << index << " " << angle;
    }
  }
}

TEST(PhaseFunctions, AShareOfTheLightGoesNearerToStraightOnThanASample)
{
  for (const auto& [name, phase] : kCases) {
    for (const float u : {0.03f, 0.2f, 0.5f, 0.8f, 0.97f}) {
      const Vec3f way{0, 0, 1};
      const double cosine = static_cast<double>(phase_sample(phase, way, {u, 0.3f}).z);
      if (cosine > 0.99999) continue;  // where floats of cosines end
      const double rest = integrate(0.5 * (1.0 - cosine), 1, [&, p = phase](double c) { return pdf(p, c); });
      EXPECT_NEAR(1.0 - rest, static_cast<double>(u), 2e-3) << name;
    }
  }
}

// Significance 1 % for all together (Šidák).
TEST(PhaseFunctions, AreSampledAsTheirDensitySays)
{
  const double threshold = sidak_threshold(0.01, static_cast<int>(std::size(kCases)));
  const Vec3f way = normalize(Vec3f{0.3f, -0.8f, 0.5f});
  std::uint64_t state = 1;
  const auto random = [&state] {
    state = hash_mix(state + 0x9e3779b97f4a7c15u);
    return static_cast<float>(state >> 40) * 0x1p-24f;
  };
  for (const auto& [name, phase] : kCases) {
    if (phase.kind == PhaseKind::kFournierForand) continue;  // whose peaks no bin's density says: see above
    Chi2Histogram histogram(16, 24);
    for (int i = 0; i < 100000; ++i) {
      const float x = random();
      const Vec3f wi = phase_sample(phase, way, {x, random()});
      histogram.add(static_cast<double>(wi.x), static_cast<double>(wi.y), static_cast<double>(wi.z));
    }
    const Chi2Result result = histogram.test([&, &phase = phase](double x, double y, double z) {
      const Vec3f wi{static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
      return static_cast<double>(phase_pdf(phase, dot(way, wi)));
    });
    EXPECT_TRUE(result.failure.empty()) << name << ": " << result.failure;
    EXPECT_GT(result.p_value, threshold) << name;
  }
}

TEST(MieFit, IsContinuousWhereItsEquationsMeet)
{
  for (const float d : {0.1f, 1.5f, 5.0f}) {
    const MieFit below = mie_fit(d * 0.9999f), above = mie_fit(d * 1.0001f);
    const auto mean = [](const MieFit& fit) {
      const double g = static_cast<double>(fit.g_draine), alpha = static_cast<double>(fit.alpha);
      const double draines = g * (1 + alpha * (3 + 2 * g * g) / 5) / (1 + alpha * (1 + 2 * g * g) / 3);
      const double w = static_cast<double>(fit.share);
      return (1 - w) * static_cast<double>(fit.g_henyey_greenstein) + w * draines;
    };
    EXPECT_NEAR(mean(below), mean(above), 0.03) << d;
    EXPECT_GT(below.share, 0.0f);
    EXPECT_LT(below.share, 1.0f);
  }
}

}  // namespace
}  // namespace relief
