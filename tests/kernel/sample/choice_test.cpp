#include "kernel/sample/choice.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace relief {
namespace {

ChoicePoint point(std::uint32_t hash, std::uint32_t i)
{
  const Sample2dX4 u = sample_2d_x4(hash, i, 3);
  return choice_point(u.first_bits[0], u.first_bits[1]);
}

/// Chooses one of `parts` of equal width and keeps what is left of x.
int choose(ChoicePoint& u, int parts)
{
  const int chosen = std::min(static_cast<int>(u.x * parts), parts - 1);
  u.x = choice_rest(u.x - static_cast<double>(chosen) / parts, 1.0 / parts);
  return chosen;
}

TEST(Choice, PointIsTheSequencesWithMoreDigits)
{
  for (std::uint32_t i = 0; i < 10000; ++i) {
    const std::uint32_t hash = sample_pixel_hash(5, static_cast<int>(i), 2);
    const Vec2f expected = sample_2d(hash, i, 3);
    const ChoicePoint u = point(hash, i);
    EXPECT_EQ(u.y, expected.y);
    EXPECT_GE(u.x, static_cast<double>(expected.x));
    EXPECT_LT(u.x, static_cast<double>(expected.x) + 0x1p-24);
  }
}

TEST(Choice, PlacesOnWhatIsChosenAreANet)
{
  // 2^10 points, one of eight by three choices in a row: each of the eight has 2^7 points, one in every elementary interval.
  constexpr int kLog2Points = 10, kLog2Left = 7;
  for (int p = 0; p < 20; ++p) {
    const std::uint32_t hash = sample_pixel_hash(9, p, 0);
    std::vector<std::vector<Vec2f>> places(8);
    for (std::uint32_t i = 0; i < 1u << kLog2Points; ++i) {
      ChoicePoint u = point(hash, i);
      const int first = choose(u, 2), second = choose(u, 4);
      places[static_cast<std::size_t>(4 * first + second)].push_back(choice_place(u));
    }
    for (const std::vector<Vec2f>& of_one : places) {
      ASSERT_EQ(of_one.size(), 1u << kLog2Left);
      for (int a = 0; a <= kLog2Left; ++a) {
        std::vector<int> counts(1u << kLog2Left, 0);
        for (const Vec2f u : of_one) {
          const auto column = static_cast<std::size_t>(u.x * static_cast<float>(1 << a));
          const auto row = static_cast<std::size_t>(u.y * static_cast<float>(1 << (kLog2Left - a)));
          ++counts[(column << (kLog2Left - a)) + row];
        }
        EXPECT_EQ(std::count(counts.begin(), counts.end(), 1), 1 << kLog2Left) << "intervals 2^-" << a << " wide";
      }
    }
  }
}

TEST(Choice, ThirtyTwoLevelsLeaveAPlace)
{
  // Five choices of one in 64 and one of four use all bits that the sequence has. What is left falls evenly into 1024 bins
  // (χ², 200000 points, |z| < 5 by the normal approximation), and hardly two places are the same.
  constexpr int kBins = 1024, kPoints = 200000;
  std::vector<int> counts(kBins, 0);
  std::vector<float> places;
  for (int p = 0; p < kPoints; ++p) {
    ChoicePoint u = point(sample_pixel_hash(3, p, 1), 0);
    for (int level = 0; level < 5; ++level) choose(u, 64);
    choose(u, 4);
    const float x = choice_place(u).x;
    ASSERT_TRUE(x >= 0.0f && x < 1.0f);
    ++counts[static_cast<std::size_t>(x * kBins)];
    places.push_back(x);
  }
  const double expected = static_cast<double>(kPoints) / kBins;
  double chi_squared = 0;
  for (const int count : counts) chi_squared += (count - expected) * (count - expected) / expected;
  EXPECT_LT(std::abs(chi_squared - (kBins - 1)), 5 * std::sqrt(2.0 * kBins));
  std::sort(places.begin(), places.end());
  const auto distinct = std::unique(places.begin(), places.end()) - places.begin();
  EXPECT_GT(distinct, kPoints * 9 / 10);
}

TEST(Choice, RestStaysInsideWhateverTheRounding)
{
  for (const double width : {1.0, 0.3, 1e-7, 1e-300}) {
    EXPECT_EQ(choice_rest(-1e-20, width), 0.0);
    EXPECT_LT(choice_rest(width * 1.0000001, width), 1.0);
    EXPECT_LT(choice_rest(static_cast<float>(std::max(width, 1e-30)), static_cast<float>(std::max(width, 1e-30))),
              1.0f);
  }
  EXPECT_LT(choice_place({1 - 0x1p-53, 0.0f}).x, 1.0f);
}

}  // namespace
}  // namespace relief
