// Walks through more boxes than a walk has stretches for: neighbours become one, and what all of the way amounts to stays.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "kernel/volume/medium_walk.h"

namespace relief {
namespace {

struct Sums {
  double depth[3] = {}, residual = 0, shows = 0;

  void add(const RateBox& box, double length)
  {
    depth[0] += double{box.sigma_t.x} * length;
    depth[1] += double{box.sigma_t.y} * length;
    depth[2] += double{box.sigma_t.z} * length;
    residual += double{box.residual} * length;
    shows += double{box.shows} * length;
  }
};

TEST(MediumWalk, JoinedStretchesAmountToTheSame)
{
  std::mt19937 random(1);
  const auto number = [&] { return static_cast<float>(random() % 1000 + 1) / 100.0f; };
  for (const int count : {1, 63, 64, 65, 128, 1000, 5000}) {
    MediumWalk walk;
    Sums wanted;
    float end = 0;
    for (int i = 0; i < count; ++i) {
      const float begin = end;
      end += number();
      const WalkStretch stretch{end, {{number(), number(), number()}, number(), number()}, {}, 0};
      wanted.add(stretch.box, double{end} - begin);
      walk_add(walk, stretch);
    }
    ASSERT_LE(walk.num_stretches, kMostStretches);
    ASSERT_GE(walk.num_stretches, std::min(count, kMostStretches / 2));
    Sums sums;
    float begin = 0;
    for (int i = 0; i < walk.num_stretches; ++i) {
      ASSERT_GT(walk.stretches[i].end, begin);
      sums.add(walk.stretches[i].box, double{walk.stretches[i].end} - begin);
      begin = walk.stretches[i].end;
    }
    EXPECT_EQ(begin, end) << count;
    // Each of at most seven joins rounds.
    const auto expect_same = [&](double a, double b) { EXPECT_NEAR(a, b, 1e-5 * b) << count; };
    for (int c = 0; c < 3; ++c) expect_same(sums.depth[c], wanted.depth[c]);
    expect_same(sums.residual, wanted.residual);
    expect_same(sums.shows, wanted.shows);
  }
}

TEST(MediumWalk, StretchesThatAreAlikeAreOne)
{
  MediumWalk walk;
  for (int i = 1; i <= 1000; ++i) walk_add(walk, {static_cast<float>(i), {{1, 2, 3}, 0.5f, 3.0f}, {}, 0});
  ASSERT_EQ(walk.num_stretches, 1);
  EXPECT_EQ(walk.stretches[0].end, 1000.0f);
}

}  // namespace
}  // namespace relief
