#include "kernel/volume/medium.h"

#include <gtest/gtest.h>

namespace relief {
namespace {

TEST(VolumeSigmaA, IsFiniteForBlackAndZeroForWhiteOrInfinity)
{
  EXPECT_TRUE(is_finite(volume_sigma_a({0, 0, 0}, 1.0f)));
  EXPECT_TRUE(is_zero(volume_sigma_a({1, 1, 1}, 0.01f)));
  EXPECT_TRUE(is_zero(volume_sigma_a({0.5f, 0.5f, 0.5f}, kInfinity)));
}

TEST(VolumeSigmaA, LeavesTheColorAfterTheDistance)
{
  const Vec3f sigma_a = volume_sigma_a({0.25f, 0.5f, 1.0f}, 0.1f);
  EXPECT_NEAR(std::exp(-0.1f * sigma_a.x), 0.25f, 1e-6f);
  EXPECT_NEAR(std::exp(-0.1f * sigma_a.y), 0.5f, 1e-6f);
  EXPECT_EQ(sigma_a.z, 0.0f);
}

}  // namespace
}  // namespace relief
