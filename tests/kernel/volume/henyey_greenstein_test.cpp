#include <gtest/gtest.h>

#include "kernel/sample/sobol.h"
#include "kernel/volume/henyey_greenstein.h"
#include "kernel/volume/medium.h"
#include "tests/support/chi2.h"

namespace relief {
namespace {

constexpr float kAnisotropies[] = {-0.95f, -0.3f, 0, 5e-4f, 0.02f, 0.6f, 0.9f};
const Vec3f kWay = normalize(Vec3f{0.3f, -0.8f, 0.5f});

Vec2f numbers(std::uint32_t i) { return sample_2d(7, i, 0); }

// Significance 1 % for all anisotropies together (Šidák).
TEST(HenyeyGreenstein, IsSampledAsItsDensitySays)
{
  const double threshold = sidak_threshold(0.01, static_cast<int>(std::size(kAnisotropies)));
  for (const float g : kAnisotropies) {
    Chi2Histogram histogram(16, 24);
    std::uint64_t state = 1;
    const auto random = [&state] {
      state = hash_mix(state + 0x9e3779b97f4a7c15u);
      return static_cast<float>(state >> 40) * 0x1p-24f;
    };
    for (int i = 0; i < 300000; ++i) {
      const float x = random();
      const Vec3f wi = henyey_greenstein_sample(kWay, g, {x, random()});
      histogram.add(static_cast<double>(wi.x), static_cast<double>(wi.y), static_cast<double>(wi.z));
    }
    const Chi2Result result = histogram.test([&](double x, double y, double z) {
      const Vec3f wi{static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
      return static_cast<double>(henyey_greenstein_pdf(dot(kWay, wi), g));
    });
    EXPECT_TRUE(result.failure.empty()) << result.failure;
    EXPECT_GT(result.p_value, threshold) << "g = " << g;
  }
}

TEST(HenyeyGreenstein, InverseIsThePointOfASample)
{
  for (const float g : kAnisotropies) {
    for (std::uint32_t i = 0; i < 256; ++i) {
      const Vec2f u = numbers(i);
      const Vec2f back = henyey_greenstein_inverse(kWay, g, henyey_greenstein_sample(kWay, g, u));
      EXPECT_NEAR(back.x, u.x, 2e-3f) << g;
      EXPECT_NEAR(std::remainder(back.y - u.y, 1.0f), 0.0f, 2e-2f) << g;
    }
  }
}

TEST(HenyeyGreenstein, MeanCosineIsTheAnisotropy)
{
  for (const float g : kAnisotropies) {
    double sum = 0;
    constexpr std::uint32_t kCount = 1u << 14;
    for (std::uint32_t i = 0; i < kCount; ++i) {
      sum += static_cast<double>(dot(kWay, henyey_greenstein_sample(kWay, g, numbers(i))));
    }
    EXPECT_NEAR(sum / kCount, static_cast<double>(g), 1e-3);
  }
}

TEST(Media, SumAndSampleAllTheirPhaseFunctions)
{
  Medium a, b;
  a.sigma_t = {2, 2, 2};
  a.phases[a.num_phases++] = {{1, 0.5f, 0}, 0.7f};
  a.phases[a.num_phases++] = {{0, 0.5f, 1}, -0.4f};
  b.sigma_t = {0.5f, 0, 0};
  b.phases[b.num_phases++] = {{0.5f, 0, 0}, 0.0f};
  MediaSum sum;
  media_add(sum, a);
  media_add(sum, b);
  EXPECT_EQ(sum.sigma_t, (Vec3f{2.5f, 2, 2}));
  EXPECT_EQ(sum.sigma_s, (Vec3f{1.5f, 1, 1}));
  Chi2Histogram histogram(16, 24);
  constexpr std::uint32_t kCount = 1u << 18;
  std::uint64_t state = 1;
  const auto random = [&state] {
    state = hash_mix(state + 0x9e3779b97f4a7c15u);
    return static_cast<float>(state >> 40) * 0x1p-24f;
  };
  Vec3f scattered;
  for (std::uint32_t i = 0; i < kCount; ++i) {
    const float x = random();
    const Vec3f wi = media_sample(sum, kWay, {x, random()});
    const PhaseEval eval = media_eval(sum, kWay, wi);
    scattered += eval.f / eval.pdf / static_cast<float>(kCount);
    histogram.add(static_cast<double>(wi.x), static_cast<double>(wi.y), static_cast<double>(wi.z));
  }
  const Chi2Result result = histogram.test([&](double x, double y, double z) {
    const Vec3f wi{static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
    return static_cast<double>(media_eval(sum, kWay, wi).pdf);
  });
  EXPECT_GT(result.p_value, 0.01);
  EXPECT_NEAR(scattered.x, 1.5f, 0.02f);
  EXPECT_NEAR(scattered.y, 1.0f, 0.02f);
  EXPECT_NEAR(scattered.z, 1.0f, 0.02f);
}

}  // namespace
}  // namespace relief
