// Against the C library in double precision.
#include "kernel/math/lanes_functions.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "kernel/graph/image.h"

namespace relief {
namespace {

constexpr int kCount = 1'000'000;

/// Largest relative error of a function over eight lanes; where the truth is below `least`, of that.
template <typename Argument, typename F, typename Exact>
double worst_error(Argument&& argument, F&& f, Exact&& exact, double least = 0)
{
  std::mt19937 random(7);
  std::uniform_real_distribution<float> unit(-1, 1);
  double worst = 0;
  for (int i = 0; i < kCount / 8; ++i) {
    F8 x;
    for (int k = 0; k < 8; ++k) x[k] = argument(unit(random));
    const F8 found = f(x);
    for (int k = 0; k < 8; ++k) {
      const double truth = exact(static_cast<double>(x[k]));
      worst = std::max(worst, std::abs(static_cast<double>(found[k]) - truth) / std::max(std::abs(truth), least));
    }
  }
  return worst;
}

TEST(LanesFunctions, SinesAndCosines)
{
  for (const float range : {1.0f, 30.0f, kLargestAngle}) {
    const auto angle = [range](float x) { return range * x; };
    EXPECT_LT(worst_error(
                  angle, [](F8 x) { return sin_cos(x).sin; }, [](double x) { return std::sin(x); }, 1e-3),
              2e-7);
    EXPECT_LT(worst_error(
                  angle, [](F8 x) { return sin_cos(x).cos; }, [](double x) { return std::cos(x); }, 1e-3),
              2e-7);
  }
}

TEST(LanesFunctions, Exponentials)
{
  const auto argument = [](float x) { return 87.0f * x; };
  EXPECT_LT(worst_error(argument, exp8, [](double x) { return std::exp(x); }), 2e-7);
}

TEST(LanesFunctions, Logarithms)
{
  for (const float range : {0.1f, 80.0f}) {
    const auto argument = [range](float x) { return std::exp(range * x); };
    EXPECT_LT(worst_error(
                  argument, log8, [](double x) { return std::log(x); }, 1e-6),
              2e-7);
  }
}

TEST(LanesFunctions, CodesBetweenBytes)
{
  const auto argument = [](float x) { return std::abs(x); };
  const auto decoded = [](F8 x) {
    for (int k = 0; k < 8; ++k) x[k] = image_decode(x[k]);
    return x;
  };
  const auto exact = [](double x) { return x < 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4); };
  EXPECT_LT(worst_error(argument, decoded, exact, 1e-6), 1e-6);
}

}  // namespace
}  // namespace relief
