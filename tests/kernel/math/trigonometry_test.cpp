// Against the C library in double precision.
#include "kernel/math/trigonometry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace relief {
namespace {

constexpr double kTwoPi = 2 * std::numbers::pi;

TEST(Trigonometry, SineAndCosineOfAnOctant)
{
  double worst = 0, worst_relative = 0;
  const int n = 2'000'000;
  for (int i = -n; i <= n; ++i) {
    const float x = 0.25f * kPi * static_cast<float>(i) / static_cast<float>(n);
    const double exact = static_cast<double>(x);
    const SinCos found = sin_cos_octant(x);
    const double sine = static_cast<double>(found.sin) - std::sin(exact);
    worst = std::max({worst, std::abs(sine), std::abs(static_cast<double>(found.cos) - std::cos(exact))});
    if (i != 0) worst_relative = std::max(worst_relative, std::abs(sine / std::sin(exact)));
  }
  EXPECT_LT(worst, 1e-7);
  EXPECT_LT(worst_relative, 2e-7);
}

TEST(Trigonometry, SineAndCosineOfTurns)
{
  double worst = 0;
  for (int i = -3'000'000; i <= 3'000'000; ++i) {
    const float turn = static_cast<float>(i) * 1e-6f;
    const SinCos found = sin_cos_turn(turn);
    const double angle = kTwoPi * static_cast<double>(turn);
    worst = std::max({worst, std::abs(static_cast<double>(found.sin) - std::sin(angle)),
                      std::abs(static_cast<double>(found.cos) - std::cos(angle))});
  }
  EXPECT_LT(worst, 2e-7);
  for (const int quarter : {-5, -4, -1, 0, 1, 2, 3, 4, 7}) {
    const SinCos found = sin_cos_turn(0.25f * static_cast<float>(quarter));
    EXPECT_EQ(found.sin, static_cast<float>(std::lround(std::sin(kTwoPi * 0.25 * quarter)))) << quarter;
    EXPECT_EQ(found.cos, static_cast<float>(std::lround(std::cos(kTwoPi * 0.25 * quarter)))) << quarter;
  }
}

TEST(Trigonometry, AnglesOfVectors)
{
  double worst = 0;
  for (int i = 0; i <= 1'000'000; ++i) {
    const double angle = std::numbers::pi * i / 1e6;
    for (const double length : {1e-12, 1.0, 3e15}) {
      const float x = static_cast<float>(length * std::cos(angle)), y = static_cast<float>(length * std::sin(angle));
      const double exact = std::atan2(static_cast<double>(y), static_cast<double>(x));
      const double error = std::abs(static_cast<double>(angle_of(y, x)) - exact);
      if (exact > 0) worst = std::max(worst, error / exact);
    }
  }
  EXPECT_LT(worst, 4e-7);
  EXPECT_EQ(angle_of(0.0f, 1.0f), 0.0f);
  EXPECT_EQ(angle_of(0.0f, -1.0f), kPi);
  EXPECT_EQ(angle_of(1.0f, 0.0f), 0.5f * kPi);
  EXPECT_EQ(angle_of(0.0f, 0.0f), 0.0f);
  EXPECT_FLOAT_EQ(angle_of(1e-30f, 1.0f), 1e-30f);
}

}  // namespace
}  // namespace relief
