// Distances along rays in media: each sampler makes its density's distribution, by inverting the latter's integral numerically.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "kernel/volume/distance.h"

namespace relief {
namespace {

/// Integral over [0, end] by Simpson's rule, in double precision.
double integral(const std::function<double(double)>& f, double end)
{
  constexpr int kSteps = 20000;
  const double h = end / kSteps;
  double sum = f(0) + f(end);
  for (int i = 1; i < kSteps; ++i) sum += (i % 2 == 1 ? 4 : 2) * f(h * i);
  return sum * h / 3;
}

TEST(FreeDistance, WithinALengthIsDistributedAsItsDensitySays)
{
  for (const float sigma : {0.0f, 1e-6f, 0.02f, 1.0f, 7.0f}) {
    for (const float length : {0.01f, 1.0f, 20.0f}) {
      const Vec3f sigma_t{sigma, 0, 0}, alone{1, 0, 0};
      const auto pdf = [&](double t) {
        return static_cast<double>(free_distance_pdf_within(sigma_t, alone, length, static_cast<float>(t)));
      };
      EXPECT_NEAR(integral(pdf, static_cast<double>(length)), 1.0, 1e-4) << sigma << ' ' << length;
      for (const float u : {0.1f, 0.5f, 0.9f}) {
        const float t = free_distance_sample_within(sigma, length, u);
        EXPECT_NEAR(integral(pdf, static_cast<double>(t)), static_cast<double>(u), 1e-4) << sigma << ' ' << length;
      }
    }
  }
}

TEST(FreeDistance, OfSeveralChannelsHasTheDensityOfTheirSum)
{
  const Vec3f sigma_t{0.5f, 2, 0}, chances{0.25f, 0.5f, 0.25f};
  const auto pdf = [&](double t) {
    return static_cast<double>(free_distance_pdf_within(sigma_t, chances, 3, static_cast<float>(t)));
  };
  EXPECT_NEAR(integral(pdf, 3), 1.0, 1e-4);
}

TEST(FreeDistance, IsExponential)
{
  EXPECT_NEAR(free_distance_sample(2, 1 - std::exp(-3.0f)), 1.5f, 1e-5f);
  EXPECT_EQ(free_distance_sample(0, 0.5f), kInfinity);
}

TEST(Equiangular, IsDistributedAsItsDensitySays)
{
  const Vec3f O{0, 0, 0}, D{1, 0, 0};
  for (const Vec3f point : {Vec3f{2, 0.5f, 0}, Vec3f{-1, 0, 3}, Vec3f{9, 0.2f, 0.1f}}) {
    const Equiangular e = equiangular_make(O, D, 6, point);
    const auto pdf = [&](double t) { return static_cast<double>(equiangular_pdf(e, static_cast<float>(t))); };
    EXPECT_NEAR(integral(pdf, 6), 1.0, 1e-4);
    for (const float u : {0.05f, 0.5f, 0.95f}) {
      const float t = equiangular_sample(e, u);
      EXPECT_NEAR(integral(pdf, static_cast<double>(t)), static_cast<double>(u), 1e-4);
    }
  }
}

TEST(Equiangular, IsNoneOfAPointOnTheRay)
{
  EXPECT_EQ(equiangular_make({0, 0, 0}, {1, 0, 0}, 6, {2, 0, 0}).distance, 0.0f);
}

TEST(Equiangular, ReachesAsFarAsAnInfiniteRay)
{
  const Equiangular e = equiangular_make({0, 0, 0}, {1, 0, 0}, kInfinity, {2, 1, 0});
  const auto pdf = [&](double t) { return static_cast<double>(equiangular_pdf(e, static_cast<float>(t))); };
  // What lies beyond has an angle of 1/998.
  EXPECT_NEAR(integral(pdf, 1000), 1.0, 1e-3);
}

TEST(MediumTransmittance, IsBeersLawAlsoWithoutEnd)
{
  const Vec3f left = medium_transmittance({0.5f, 0, 3}, 2);
  EXPECT_NEAR(left.x, std::exp(-1.0), 1e-6);
  EXPECT_EQ(left.y, 1.0f);
  EXPECT_NEAR(left.z, std::exp(-6.0), 1e-6);
  const Vec3f far = medium_transmittance({0.5f, 0, 3}, kInfinity);
  EXPECT_EQ(far.x, 0.0f);
  EXPECT_EQ(far.y, 1.0f);
}

TEST(MediumTransmittance, IntegralIsItsIntegral)
{
  for (const float sigma : {0.0f, 1e-9f, 1e-3f, 2.0f}) {
    const auto f = [&](double t) { return std::exp(-static_cast<double>(sigma) * t); };
    EXPECT_NEAR(medium_transmittance_integral({sigma, 0, 0}, 3).x, integral(f, 3), 1e-5);
  }
}

}  // namespace
}  // namespace relief
