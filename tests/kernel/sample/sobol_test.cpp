// Statistical tests here use fixed seeds and |z| < 4.5 (two-sided significance 7e-6 a test); the number of samples stands
// beside each.
#include "kernel/sample/sobol.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

namespace relief {
namespace {

constexpr double kMaxZ = 4.5;

std::uint32_t pixel(int i) { return sample_pixel_hash(7, i % 1920, i / 1920); }

/// Index of sample i of one of the four streams.
std::uint32_t in_stream(std::uint32_t stream, std::uint32_t i) { return sample_sequence_index(4 * i + stream, 14); }

/// z value of a χ² statistic.
/// @source Wilson and Hilferty 1931
double chi_squared_z(double chi_squared, double degrees)
{
  const double v = 2.0 / (9.0 * degrees);
  return (std::cbrt(chi_squared / degrees) - (1 - v)) / std::sqrt(v);
}

double chi_squared_uniform_z(const std::vector<int>& counts, double total)
{
  const double expected = total / static_cast<double>(counts.size());
  double sum = 0;
  for (const int count : counts) sum += (count - expected) * (count - expected) / expected;
  return chi_squared_z(sum, static_cast<double>(counts.size()) - 1);
}

/// z value of a sample correlation of n independent pairs.
double correlation_z(const std::vector<double>& a, const std::vector<double>& b)
{
  const double n = static_cast<double>(a.size());
  double ma = 0, mb = 0, aa = 0, bb = 0, ab = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    ma += a[i] / n;
    mb += b[i] / n;
  }
  for (std::size_t i = 0; i < a.size(); ++i) {
    aa += (a[i] - ma) * (a[i] - ma);
    bb += (b[i] - mb) * (b[i] - mb);
    ab += (a[i] - ma) * (b[i] - mb);
  }
  return ab / std::sqrt(aa * bb) * std::sqrt(n);
}

double smooth_integrand(Vec2f u)
{
  const double x = static_cast<double>(u.x), y = static_cast<double>(u.y);
  return std::exp(-x * x - 0.5 * y) * (1 + x * y);
}

/// Its integral, by Gauss–Legendre of three points on 64 × 64 cells.
double smooth_integral()
{
  const double nodes[3] = {0.5 - std::sqrt(0.15), 0.5, 0.5 + std::sqrt(0.15)};
  const double weights[3] = {5.0 / 18, 8.0 / 18, 5.0 / 18};
  const int n = 64;
  double sum = 0;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      for (int a = 0; a < 3; ++a) {
        for (int b = 0; b < 3; ++b) {
          const double x = (i + nodes[a]) / n, y = (j + nodes[b]) / n;
          sum += weights[a] * weights[b] * std::exp(-x * x - 0.5 * y) * (1 + x * y) / (n * n);
        }
      }
    }
  }
  return sum;
}

double stream_mean(std::uint32_t hash, std::uint32_t stream, std::uint32_t n, std::uint32_t dimension)
{
  double sum = 0;
  for (std::uint32_t i = 0; i < n; ++i) sum += smooth_integrand(sample_2d(hash, in_stream(stream, i), dimension));
  return sum / n;
}

TEST(Sobol, EveryAlignedBlockOfAStreamIsANet)
{
  for (int p = 0; p < 8; ++p) {
    for (const std::uint32_t stream : {0u, 3u}) {
      for (std::uint32_t log_n = 0; log_n <= 10; ++log_n) {
        const std::uint32_t n = 1u << log_n;
        for (const std::uint32_t block : {0u, 1u, 5u}) {
          std::vector<Vec2f> points;
          for (std::uint32_t i = 0; i < n; ++i) {
            points.push_back(sample_2d(pixel(p), in_stream(stream, block * n + i), 3u + static_cast<std::uint32_t>(p)));
          }
          for (std::uint32_t log_x = 0; log_x <= log_n; ++log_x) {
            const std::uint32_t nx = 1u << log_x, ny = n >> log_x;
            std::vector<int> count(n, 0);
            for (const Vec2f q : points) {
              const auto x = static_cast<std::uint32_t>(q.x * static_cast<float>(nx));
              const auto y = static_cast<std::uint32_t>(q.y * static_cast<float>(ny));
              ++count[y * nx + x];
            }
            ASSERT_EQ(std::count(count.begin(), count.end(), 1), static_cast<std::ptrdiff_t>(n))
                << "pixel " << p << " stream " << stream << " n " << n << " block " << block << " columns " << nx;
          }
        }
      }
    }
  }
}

TEST(Sobol, EveryAlignedBlockOfOneDimensionIsStratified)
{
  for (const std::uint32_t n : {1u, 4u, 64u, 1024u}) {
    std::vector<int> count(n, 0);
    for (std::uint32_t i = 0; i < n; ++i) {
      ++count[static_cast<std::size_t>(sample_1d(pixel(5), in_stream(1, 3 * n + i), 9) * static_cast<float>(n))];
    }
    EXPECT_EQ(std::count(count.begin(), count.end(), 1), static_cast<std::ptrdiff_t>(n));
  }
}

TEST(Sobol, PermutationIsNestedAndMixesEveryLowerBit)
{
  // Rate at which flipping input bit i flips output bit j, over seeds and inputs: 0 for j < i, 1 for j = i, near ½ above.
  // 20000 trials a pair: standard deviation 0.0035; the permutation is not random, so only gross bias is rejected.
  const int trials = 20000;
  std::uint64_t state = 1;
  int worst_low_bits = 0;
  std::vector<int> flips(32 * 32, 0);
  for (int k = 0; k < trials; ++k) {
    state = hash_mix(state + 0x9e3779b97f4a7c15u);
    const auto input = static_cast<std::uint32_t>(state);
    const auto seed = static_cast<std::uint32_t>(state >> 32);
    const std::uint32_t output = owen_permute_reversed(input, seed);
    for (int i = 0; i < 32; ++i) {
      const std::uint32_t changed = output ^ owen_permute_reversed(input ^ (1u << i), seed);
      worst_low_bits |= (changed & ((1u << i) - 1)) != 0;
      for (int j = 0; j < 32; ++j) flips[static_cast<std::size_t>(32 * i + j)] += (changed >> j) & 1u;
    }
  }
  EXPECT_EQ(worst_low_bits, 0);
  double worst = 0;
  for (int i = 0; i < 32; ++i) {
    EXPECT_EQ(flips[static_cast<std::size_t>(33 * i)], trials);
    for (int j = i + 1; j < 32; ++j) {
      worst = std::max(worst, std::abs(flips[static_cast<std::size_t>(32 * i + j)] / double(trials) - 0.5));
    }
  }
  EXPECT_LT(worst, 0.03);
  RecordProperty("worst_flip_bias", std::to_string(worst));
}

TEST(Sobol, SecondDimensionIsPascalsMatrix)
{
  for (std::uint32_t i = 0; i < 4096; ++i) {
    // Joe and Kuo's dimension 2: direction numbers of the polynomial x + 1, v(k) = v(k−1) ^ (v(k−1) >> 1).
    std::uint32_t expected = 0, v = 1u << 31;
    for (std::uint32_t bits = i; bits != 0; bits >>= 1) {
      if ((bits & 1u) != 0) expected ^= v;
      v ^= v >> 1;
    }
    ASSERT_EQ(reverse_bits(sobol_dimension1_reversed(i)), expected) << i;
  }
}

TEST(Sobol, PointsAreUniformOverPixels)
{
  const int n = 400000;
  for (const std::uint32_t sample : {0u, 1u, 6u, 77u}) {
    std::vector<int> pairs(64 * 64, 0), ones(1024, 0);
    for (int p = 0; p < n; ++p) {
      const Vec2f u = sample_2d(pixel(p), sample, 4);
      ++pairs[static_cast<std::size_t>(u.y * 64) * 64 + static_cast<std::size_t>(u.x * 64)];
      ++ones[static_cast<std::size_t>(sample_1d(pixel(p), sample, 5) * 1024)];
    }
    EXPECT_LT(std::abs(chi_squared_uniform_z(pairs, n)), kMaxZ) << "sample " << sample;
    EXPECT_LT(std::abs(chi_squared_uniform_z(ones, n)), kMaxZ) << "sample " << sample;
  }
}

TEST(Sobol, ValuesAreBelowOne)
{
  EXPECT_LT(unit_float(0xffffffffu), 1.0f);
  EXPECT_EQ(unit_float(0u), 0.0f);
}

TEST(Sobol, HalvesAndWholeOfAPlannedPowerOfTwoAreNets)
{
  const std::uint32_t n = 256;
  const std::uint32_t log2_stream = sample_log2_stream(n);
  EXPECT_EQ(log2_stream, 6u);
  for (const std::uint32_t step : {1u, 2u, 4u}) {
    for (std::uint32_t first = 0; first < step; ++first) {
      const std::uint32_t size = n / step;
      for (std::uint32_t columns = 1; columns <= size; columns *= 2) {
        const std::uint32_t rows = size / columns;
        std::vector<int> count(size, 0);
        for (std::uint32_t i = first; i < n; i += step) {
          const Vec2f u = sample_2d(pixel(7), sample_sequence_index(i, log2_stream), 3);
          const auto x = static_cast<std::uint32_t>(u.x * static_cast<float>(columns));
          const auto y = static_cast<std::uint32_t>(u.y * static_cast<float>(rows));
          ++count[y * columns + x];
        }
        EXPECT_EQ(std::count(count.begin(), count.end(), 1), static_cast<std::ptrdiff_t>(size)) << step << " " << first;
      }
    }
  }
}

TEST(Sobol, SequenceIndexIsAPermutationForAnyPlannedNumber)
{
  for (const std::uint32_t planned : {1u, 4u, 5u, 50u, 64u, 65u, 1000u}) {
    const std::uint32_t log2_stream = sample_log2_stream(planned);
    std::vector<int> count(std::size_t{4} << log2_stream, 0);
    for (std::uint32_t i = 0; i < count.size(); ++i) ++count[sample_sequence_index(i, log2_stream)];
    EXPECT_EQ(std::count(count.begin(), count.end(), 1), static_cast<std::ptrdiff_t>(count.size())) << planned;
    EXPECT_GE(count.size(), planned);
  }
}

TEST(Sobol, SamplesPastTheStreamsDoubleThem)
{
  for (const std::uint32_t planned : {1u, 4u, 16u, 50u, 64u}) {
    const std::uint32_t log2_stream = sample_log2_stream(planned);
    for (std::uint32_t n = 4u << log2_stream; n <= 4096; n *= 2) {
      std::vector<int> count(n, 0);
      for (std::uint32_t i = 0; i < n; ++i) {
        const std::uint32_t index = sample_sequence_index(i, log2_stream);
        ASSERT_LT(index, n) << planned << " " << i;
        ++count[index];
        ASSERT_EQ(sample_is_even(index, log2_stream), i % 2 == 0) << planned << " " << i;
      }
      EXPECT_EQ(std::count(count.begin(), count.end(), 1), static_cast<std::ptrdiff_t>(n)) << planned;
      if (n == 4u << log2_stream) continue;
      // Of what the last doubling added, a half is an aligned block of the sequence, and so a net.
      std::uint32_t least = ~0u, most = 0;
      for (std::uint32_t i = n / 2; i < n; i += 2) {
        least = std::min(least, sample_sequence_index(i, log2_stream));
        most = std::max(most, sample_sequence_index(i, log2_stream));
      }
      EXPECT_EQ(least, n / 2) << planned;
      EXPECT_EQ(most, n / 2 + n / 4 - 1) << planned;
    }
  }
}

TEST(Sobol, DimensionsAndNeighbouringPixelsAreUncorrelated)
{
  const int n = 200000;  // pixels
  const auto column = [&](int shift, std::uint32_t sample, std::uint32_t dimension, bool second) {
    std::vector<double> values;
    for (int p = 0; p < n; ++p) {
      const Vec2f u = sample_2d(pixel(p + shift), sample, dimension);
      values.push_back(static_cast<double>(second ? u.y : u.x));
    }
    return values;
  };
  const std::vector<double> reference = column(0, 0, 4, false);
  EXPECT_LT(std::abs(correlation_z(reference, column(0, 0, 4, true))), kMaxZ);
  for (const std::uint32_t dimension : {0u, 3u, 5u, 6u, 12u}) {
    EXPECT_LT(std::abs(correlation_z(reference, column(0, 0, dimension, false))), kMaxZ) << dimension;
    EXPECT_LT(std::abs(correlation_z(reference, column(0, 0, dimension, true))), kMaxZ) << dimension;
  }
  for (const int shift : {1, 1920}) EXPECT_LT(std::abs(correlation_z(reference, column(shift, 0, 4, false))), kMaxZ);
}

TEST(Sobol, DimensionsOfOnePixelAreJointlyUniform)
{
  // Within a pixel, two dimensions are shuffled stratified columns: a fixed relation between them would show in the
  // joint histogram of the first 16 samples, summed over pixels. Marginals are exact, which only lowers χ², so the upper
  // side alone is tested. 40000 pixels × 16 samples on 16 × 16 cells.
  const int n = 40000;
  for (const std::uint32_t other : {5u, 8u}) {
    std::vector<int> counts(256, 0);
    for (int p = 0; p < n; ++p) {
      for (std::uint32_t i = 0; i < 16; ++i) {
        const float x = sample_2d(pixel(p), in_stream(0, i), 4).x;
        const float y = sample_2d(pixel(p), in_stream(0, i), other).x;
        ++counts[static_cast<std::size_t>(y * 16) * 16 + static_cast<std::size_t>(x * 16)];
      }
    }
    EXPECT_LT(chi_squared_uniform_z(counts, 16.0 * n), kMaxZ) << other;
  }
}

TEST(Sobol, ConvergesFasterThanIndependentSamples)
{
  const double truth = smooth_integral();
  const int pixels = 1000;
  const auto rms = [&](std::uint32_t n) {
    double sum = 0;
    for (int p = 0; p < pixels; ++p) sum += std::pow(stream_mean(pixel(p), 0, n, 4) - truth, 2);
    return std::sqrt(sum / pixels);
  };
  const double at_16 = rms(16), at_1024 = rms(1024);
  const double rate = std::log2(at_16 / at_1024) / 6;
  RecordProperty("rms_16", std::to_string(at_16));
  RecordProperty("rms_1024", std::to_string(at_1024));
  RecordProperty("rate", std::to_string(rate));
  // Independent samples: ½. Scrambled nets on smooth integrands: 3/2 (Owen 1997).
  EXPECT_GT(rate, 1.35);
}

TEST(Sobol, SameBitsAtCompileTimeAndRunTime)
{
  constexpr std::uint32_t hash = sample_pixel_hash(42, 17, 23);
  constexpr Vec2f expected = sample_2d(hash, 99, 31);
  volatile int x = 17;
  volatile std::uint32_t sample = 99;
  EXPECT_EQ(sample_2d(sample_pixel_hash(42, x, 23), sample, 31), expected);
  EXPECT_NE(sample_pixel_hash(42, 17, 23), sample_pixel_hash(43, 17, 23));
  EXPECT_NE(sample_pixel_hash(42, 17, 23), sample_pixel_hash(42, 23, 17));
}

TEST(Sobol, FourDimensionsAtOnceAreThoseOneByOne)
{
  for (std::uint32_t i = 0; i < 20000; ++i) {
    const std::uint32_t hash = pixel(static_cast<int>(i)), sample = i * 2654435761u, dimension = i % 700;
    const Sample2dX4 u = sample_2d_x4(hash, sample, dimension);
    for (std::uint32_t k = 0; k < 4; ++k) ASSERT_EQ(u.at[k], sample_2d(hash, sample, dimension + k)) << i << " " << k;
  }
}

}  // namespace
}  // namespace relief
