// The film as adaptive sampling sees it: what noise lets expect of the samples to come.
#include <algorithm>
#include <cstdint>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "integrator/film.h"

namespace relief::test {
namespace {

constexpr int kSize = 96;
constexpr std::uint32_t kStep = 16, kFirst = 48, kMost = 4096;

constexpr double kMean = 0.5;

/// A picture of one radiance, whose samples are independent and, as light is, never below zero; their spread grows from left
/// to right.
class NoisyPicture {
 public:
  NoisyPicture(double least_spread, double most_spread, float threshold)
      : rule_{threshold, NoiseMaths::k43, 1.0f}, least_(least_spread), most_(most_spread)
  {
    for (int tile = 0; tile < film_.num_tiles(); ++tile) active_.push_back(tile);
  }

  /// Takes samples of all that does not rest; judges what may be judged.
  void sample(std::uint32_t until)
  {
    const FilmAccumulatorView view = film_.accumulator();
    for (; done_ < until && !active_.empty(); ++done_) {
      for (std::uint32_t pixel = 0; pixel < film_.num_pixels(); ++pixel) {
        if (film_pixel_rests(view, pixel)) continue;
        const double at = static_cast<double>(pixel % kSize) / (kSize - 1);
        const double spread = (least_ + at * (most_ - least_)) / kMean, shape = 1 / (spread * spread);
        const auto sample = static_cast<float>(std::gamma_distribution<double>(shape, kMean / shape)(random_));
        film_add_sample(view, pixel, done_, {sample, sample, sample}, {});
      }
      for (const int tile : active_) film_.add_tile_samples(tile, 1);
      if (done_ + 1 >= kFirst && (done_ + 1) % kStep == 0) active_ = film_.judge(rule_, done_ + 1);
    }
  }
  double mean_samples() const { return film_.mean_samples(); }
  bool rests() const { return active_.empty(); }
  double samples_to_come() const
  {
    const std::uint32_t next = std::max(kFirst, done_ / kStep * kStep + kStep);
    return film_.samples_to_come(rule_, {next, kStep, kMost}, done_);
  }

 private:
  Film film_{kSize, kSize, 0, 6, false, true};
  NoiseRule rule_;
  std::mt19937 random_{7};
  double least_, most_;
  std::vector<int> active_;
  std::uint32_t done_ = 0;
};

TEST(Film, SamplesToComeAreTold)
{
  // All rest when they are first judged; a few times as many; pixels of all kinds.
  const struct {
    double least_spread, most_spread, error;
  } kCases[] = {{0.01, 0.02, 0.001}, {0.3, 0.3, 0.25}, {0.1, 0.6, 0.25}, {0.5, 0.5, 0.25}};
  for (const auto& [least, most, error] : kCases) {
    NoisyPicture picture(least, most, 0.02f);
    struct Told {
      std::uint32_t done;
      double sum;
    };
    std::vector<Told> told;
    for (std::uint32_t done : {8u, 16u, 32u, 64u, 128u, 256u}) {
      if (picture.rests()) break;
      picture.sample(done);
      told.push_back({done, picture.mean_samples() + picture.samples_to_come()});
    }
    picture.sample(kMost);
    ASSERT_TRUE(picture.rests());
    const double all = picture.mean_samples();
    for (const auto& [done, sum] : told)
      EXPECT_NEAR(sum / all, 1.0, error) << done << " of " << all << ", " << least << '-' << most;
    EXPECT_EQ(picture.samples_to_come(), 0);
  }
}

TEST(Film, SamplesToComeEndWithTheMost)
{
  NoisyPicture picture(0.5, 0.5, 1e-6f);
  picture.sample(8);
  EXPECT_EQ(picture.samples_to_come(), kMost - 8);
}

}  // namespace
}  // namespace relief::test
