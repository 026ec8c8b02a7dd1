// Walks through grids, and through more boxes than a walk has stretches for: neighbours become one, and what all of the way amounts to
// stays.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

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
      const RateBox box{{number(), number(), number()}, number(), number()};
      wanted.add(box, double{end} - begin);
      walk_add(walk, end, box);
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
  for (int i = 1; i <= 1000; ++i) walk_add(walk, static_cast<float>(i), {{1, 2, 3}, 0.5f, 3.0f});
  ASSERT_EQ(walk.num_stretches, 1);
  EXPECT_EQ(walk.stretches[0].end, 1000.0f);
}

// Rays in all directions, along axes and borders, too, from inside and outside: in the middle of each stretch is what the box there has.
TEST(MediumWalk, GoesThroughTheBoxesThatItIsIn)
{
  constexpr int kSize = 7;
  std::vector<RateBox> boxes(kSize * kSize * kSize);
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    const auto value = static_cast<float>(i + 1);
    boxes[i] = {{value, 2 * value, 3 * value}, 4 * value, 5 * value};
  }
  RateGrid grid;
  grid.low = {-3, 1, -20};
  grid.cell = {0.5f, 2.0f, 6.0f};
  grid.size = kSize;
  grid.boxes = boxes.data();
  const RateBox even{{0.25f, 0.5f, 0.75f}, 0.0f, 1.0f};
  std::mt19937 random(2);
  std::uniform_real_distribution<float> unit(0.0f, 1.0f);
  int num_checked = 0;
  for (int ray = 0; ray < 20000; ++ray) {
    MediumWalk walk;
    float O[3], D[3];
    const float low[3] = {grid.low.x, grid.low.y, grid.low.z}, cell[3] = {grid.cell.x, grid.cell.y, grid.cell.z};
    for (int i = 0; i < 3; ++i) {
      const float boxes_along = unit(random) * 11.0f - 2.0f;
      O[i] = low[i] + cell[i] * (ray % 5 == 0 ? std::floor(boxes_along) : boxes_along);
      D[i] = ray % 3 == 0 && unit(random) < 0.5f ? 0.0f : unit(random) * 2.0f - 1.0f;
    }
    if (D[0] == 0.0f && D[1] == 0.0f && D[2] == 0.0f) D[ray % 2] = 1.0f;
    walk.O = {O[0], O[1], O[2]};
    walk.D = normalize(Vec3f{D[0], D[1], D[2]});
    walk.length = ray % 4 == 0 ? kInfinity : unit(random) * 60.0f;
    rate_boxes_visit_in_grid(walk, grid, even, [&walk](float end, const RateBox& box) {
      walk_add(walk, end, box);
      return true;
    });
    ASSERT_GT(walk.num_stretches, 0);
    EXPECT_EQ(walk.stretches[walk.num_stretches - 1].end, walk.length);
    double start = 0;
    for (int k = 0; k < walk.num_stretches; ++k) {
      const WalkStretch& stretch = walk.stretches[k];
      ASSERT_GT(double{stretch.end}, start);
      const double t = stretch.end < kInfinity ? 0.5 * (start + double{stretch.end}) : start + 1000.0;
      start = double{stretch.end};
      const double way[3] = {double{walk.D.x} * t, double{walk.D.y} * t, double{walk.D.z} * t};
      int index = 0, stride = 1;
      bool is_inside = true, is_on_border = false;
      for (int i = 0; i < 3; ++i, stride *= kSize) {
        const double at = (double{O[i]} + way[i] - double{low[i]}) / double{cell[i]};
        is_on_border |= std::abs(at - std::round(at)) < 1e-4;
        is_inside &= at >= 0 && at < kSize;
        index += stride * static_cast<int>(std::floor(at));
      }
      if (is_on_border) continue;
      ++num_checked;
      const float value = is_inside ? static_cast<float>(index + 1) : 0.0f;
      ASSERT_EQ(stretch.box.sigma_t, (Vec3f{value, 2 * value, 3 * value} + even.sigma_t)) << ray << ' ' << k;
      ASSERT_EQ(stretch.box.residual, 4 * value);
      ASSERT_EQ(stretch.box.shows, 5 * value + 1.0f);
    }
  }
  EXPECT_GT(num_checked, 50000);
}

}  // namespace
}  // namespace relief
