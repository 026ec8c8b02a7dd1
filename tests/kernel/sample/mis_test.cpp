#include "kernel/sample/mis.h"

#include <gtest/gtest.h>

#include <cmath>

namespace relief {
namespace {

TEST(Mis, WeightsOfTheTwoTechniquesSumToOne)
{
  for (const float a : {1e-30f, 1e-6f, 0.5f, 1.0f, 3e8f, 1e30f}) {
    for (const float b : {1e-30f, 2e-5f, 0.5f, 7.0f, 1e30f}) {
      EXPECT_NEAR(mis_power(a, b) + mis_power(b, a), 1.0f, 1e-6f) << a << " " << b;
      EXPECT_NEAR(mis_balance(a, b) + mis_balance(b, a), 1.0f, 1e-6f) << a << " " << b;
    }
  }
}

TEST(Mis, PowerHeuristicIsTheRatioOfSquares)
{
  EXPECT_FLOAT_EQ(mis_power(3.0f, 4.0f), 9.0f / 25.0f);
  EXPECT_FLOAT_EQ(mis_power(4.0f, 3.0f), 16.0f / 25.0f);
}

TEST(Mis, ExtremeDensitiesGiveFiniteWeights)
{
  const float infinity = INFINITY;
  EXPECT_EQ(mis_power(1.0f, 0.0f), 1.0f);
  EXPECT_EQ(mis_power(infinity, 1.0f), 1.0f);
  EXPECT_EQ(mis_power(1.0f, infinity), 0.0f);
  EXPECT_EQ(mis_power(1e38f, 1e-38f), 1.0f);
  EXPECT_EQ(mis_power(1e-38f, 1e38f), 0.0f);
}

}  // namespace
}  // namespace relief
