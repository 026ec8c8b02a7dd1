// The published march, beside every micro-triangle: over parallel normals its cells hold them, so that none is passed over.
#include <gtest/gtest.h>

#include <random>

#include "benchmarks/procedural/microtriangle_march.h"

namespace relief {
namespace {

using Vector = MarchVector<double>;

MarchedTriangle random_triangle(std::mt19937_64& random, int n)
{
  std::uniform_real_distribution<double> uniform(0, 1);
  MarchedTriangle triangle;
  triangle.P = {{{0, 0, 0}, {1, 0, 0}, {0.3, 0.9, 0}}};
  triangle.N = {{{0, 0, 1}, {0, 0, 1}, {0, 0, 1}}};
  triangle.n = n;
  triangle.low = 0;
  triangle.high = 0.3;
  triangle.h.resize(static_cast<std::size_t>((n + 1) * (n + 1)));
  for (float& h : triangle.h) h = static_cast<float>(0.3 * uniform(random));
  return triangle;
}

TEST(MicrotriangleMarch, MissesNoRayThatStartsWithinItsVolume)
{
  std::mt19937_64 random(9);
  std::uniform_real_distribution<double> uniform(-1, 1);
  int num_within = 0, num_hits = 0;
  for (int round = 0; round < 200; ++round) {
    const MarchedTriangle triangle = random_triangle(random, 1 << (round % 5));
    const MicrotriangleMarch<double> march(triangle);
    for (int k = 0; k < 200; ++k) {
      double b1 = 0.5 + 0.5 * uniform(random), b2 = 0.5 + 0.5 * uniform(random);
      if (b1 + b2 > 1) b1 = 1 - b1, b2 = 1 - b2;
      // Half of them above or below the volume, or on its border.
      const double height = k % 2 == 0 ? 0.15 * (1 + uniform(random)) : 0.6 * uniform(random);
      num_within += height > 0 && height < 0.3 ? 1 : 0;
      const Vector O = Vector{1, 0, 0} * b1 + Vector{0.3, 0.9, 0} * b2 + Vector{0, 0, height};
      const Vector D{uniform(random), uniform(random), uniform(random)};
      const MarchHit expected = march.brute_force(O, D), found = march.march(O, D);
      ASSERT_EQ(found.hit, expected.hit) << "round " << round << ", ray " << k;
      if (!found.hit) continue;
      ++num_hits;
      EXPECT_NEAR(found.t, expected.t, 1e-9 * (1 + expected.t));
    }
  }
  EXPECT_GT(num_within, 20'000);
  EXPECT_GT(num_hits, 5'000);
}

}  // namespace
}  // namespace relief
