// Cone maps as published, by what they promise: how wide they are against each other, and what a ray may find within them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "benchmarks/heightfield/trace.h"

namespace relief {
namespace {

HeightTexture hills(int size)
{
  HeightTexture t{size, {}};
  std::mt19937 random(3);
  for (int j = 0; j < size; ++j) {
    for (int i = 0; i < size; ++i) {
      const double x = 6.283185307 * i / size, y = 6.283185307 * j / size;
      const double noise = static_cast<double>(random() >> 8) / (1 << 24);
      t.h.push_back(static_cast<float>(0.45 + 0.3 * std::sin(2 * x) * std::cos(3 * y + 1) + 0.15 * noise));
    }
  }
  return t;
}

TextureRay random_ray(std::mt19937& random)
{
  std::uniform_real_distribution<double> unit(0, 1);
  const double phi = 6.283185307 * unit(random), steepness = 0.2 + 3 * unit(random);
  return {unit(random), unit(random), std::cos(phi), std::sin(phi), -steepness};
}

TEST(ConeMaps, QuickOnesAreNeverWider)
{
  const HeightTexture t = hills(32);
  const ConeMap conservative = cone_map_conservative(t), quick = cone_map_quick(t);
  const ConeMap relaxed = cone_map_relaxed(t), quick_relaxed = cone_map_quick_relaxed(t);
  for (std::size_t k = 0; k < t.h.size(); ++k) {
    ASSERT_LE(quick[k], conservative[k]);
    ASSERT_LE(quick_relaxed[k], relaxed[k]);
    ASSERT_LE(conservative[k], relaxed[k]);
  }
}

TEST(ConeMaps, HaveNoTexelWithin)
{
  const HeightTexture t = hills(32);
  const ConeMap cones = cone_map_conservative(t);
  for (int j = 0; j < 32; ++j) {
    for (int i = 0; i < 32; ++i) {
      const double cone = static_cast<double>(cones[static_cast<std::size_t>(32 * j + i)]);
      for (int y = -40; y <= 40; ++y) {
        for (int x = -40; x <= 40; ++x) {
          const double above = static_cast<double>(t.texel(i + x, j + y)) - t.texel(i, j);
          ASSERT_LE(above * cone, std::hypot(x, y) / 32 * (1 + 1e-6) + 1e-12);
        }
      }
    }
  }
}

/// A ray that starts above the apex and falls away from it does not come out of the surface again within the cone.
TEST(ConeMaps, RelaxedOnesAreEnteredOnce)
{
  const HeightTexture t = hills(32);
  const ConeMap relaxed = cone_map_relaxed(t), conservative = cone_map_conservative(t);
  std::mt19937 random(4);
  int num_entered = 0, num_wider = 0;
  for (int round = 0; round < 100000; ++round) {
    const int i = static_cast<int>(random() % 32), j = static_cast<int>(random() % 32);
    const int dx = static_cast<int>(random() % 3) - 1, dy = static_cast<int>(random() % 3) - 1;
    if (dx == 0 && dy == 0) continue;
    const auto at = static_cast<std::size_t>(32 * j + i);
    const double cone = static_cast<double>(relaxed[at]), own = static_cast<double>(t.texel(i, j));
    num_wider += relaxed[at] > conservative[at] ? 1 : 0;
    const double start = own + (1 - own) * static_cast<double>(random() % 1000 + 1) / 1000;
    const double falls = 4 * static_cast<double>(random() % 1000) / 1000;
    bool inside = false;
    // Along the row, column or diagonal, texel by texel.
    for (int k = 1; k < 32; ++k) {
      const double r = k * std::hypot(dx, dy) / 32, z = start - falls * r;
      if (z <= own + r / cone) break;
      const bool now = static_cast<double>(t.texel(i + k * dx, j + k * dy)) > z;
      ASSERT_TRUE(now || !inside) << i << " " << j << " " << dx << " " << dy;
      inside = now;
      num_entered += now ? 1 : 0;
    }
  }
  EXPECT_GT(num_wider, 1000);
  EXPECT_GT(num_entered, 100);
}

TEST(ConeMaps, AreCorrectedOverThreeByThree)
{
  const HeightTexture t = hills(16);
  const ConeMap map = cone_map_conservative(t), corrected = cone_map_corrected(t, map);
  for (int j = 0; j < 16; ++j) {
    for (int i = 0; i < 16; ++i) {
      float least = 1;
      for (int k = 0; k < 9; ++k) {
        least = std::min(least, map[static_cast<std::size_t>((j + k / 3 + 15) % 16 * 16 + (i + k % 3 + 15) % 16)]);
      }
      ASSERT_EQ(corrected[static_cast<std::size_t>(16 * j + i)], least);
    }
  }
}

TEST(ConeTraces, EveryCellIsWhatManyStepsFind)
{
  const HeightTexture t = hills(32);
  std::mt19937 random(5);
  for (int round = 0; round < 500; ++round) {
    const TextureRay ray = random_ray(random);
    const double expected = exact_trace(t, ray).t, found = linear_trace(t, ray, 200000).t;
    // Steps may pass over a tip.
    if (found > expected) continue;
    ASSERT_NEAR(found, expected, 1e-4);
  }
}

TEST(ConeTraces, MaximumMipmapsAreExact)
{
  const HeightTexture t = hills(64);
  const MaximumPyramid pyramid(t);
  std::mt19937 random(6);
  for (int round = 0; round < 5000; ++round) {
    const TextureRay ray = random_ray(random);
    const TextureHit hit = pyramid.trace(ray, true, 100000);
    ASSERT_TRUE(hit.converged);
    ASSERT_NEAR(hit.t, exact_trace(t, ray).t, 1e-6);
  }
}

TEST(ConeTraces, CorrectedConservativeConesMissLessThanPlainOnes)
{
  const HeightTexture t = hills(64);
  const ConeMap plain = cone_map_conservative(t), corrected = cone_map_corrected(t, plain);
  std::mt19937 random(7);
  int wrong[3] = {};
  for (int round = 0; round < 20000; ++round) {
    const TextureRay ray = random_ray(random);
    const double expected = exact_trace(t, ray).t;
    const TextureHit hits[3] = {cone_trace(t, plain, ray, ConeStepping::kOriginal, ConeRefinement::kSecant, 1000),
                                cone_trace(t, corrected, ray, ConeStepping::kCellMax, ConeRefinement::kSecant, 1000),
                                cone_trace(t, corrected, ray, ConeStepping::kCellMax, ConeRefinement::kNone, 0)};
    for (int k = 0; k < 2; ++k) wrong[k] += std::abs(hits[k].t - expected) > 1.0 / 64 ? 1 : 0;
    if (round > 200) continue;
    EXPECT_FALSE(hits[2].converged);
  }
  std::cout << "[ figures  ] off by more than a texel of 20000 rays: " << wrong[0] << " plain, " << wrong[1]
            << " corrected\n";
  EXPECT_LT(wrong[1], wrong[0]);
}

}  // namespace
}  // namespace relief
