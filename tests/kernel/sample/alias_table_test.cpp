#include "kernel/sample/alias_table.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "integrator/alias_table.h"
#include "kernel/sample/sobol.h"

namespace relief {
namespace {

/// Exact probability of every index: buckets are intervals of u.
std::vector<double> probabilities(const std::vector<AliasEntry>& entries)
{
  std::vector<double> p(entries.size(), 0.0);
  const double bucket = 1.0 / static_cast<double>(entries.size());
  for (std::size_t i = 0; i < entries.size(); ++i) {
    p[i] += bucket * static_cast<double>(entries[i].threshold);
    p[entries[i].alias] += bucket * (1 - static_cast<double>(entries[i].threshold));
  }
  return p;
}

void expect_exact(const std::vector<float>& weights)
{
  const std::vector<AliasEntry> entries = alias_table_make(weights);
  ASSERT_EQ(entries.size(), weights.size());
  double total = 0;
  for (const float w : weights) total += static_cast<double>(w);
  const std::vector<double> p = probabilities(entries);
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const double expected = static_cast<double>(weights[i]) / total;
    EXPECT_NEAR(p[i], expected, 1e-7) << i;
    EXPECT_NEAR(static_cast<double>(entries[i].probability), expected, 1e-7 * expected + 1e-38) << i;
    if (weights[i] == 0.0f) {
      EXPECT_EQ(p[i], 0.0) << i;
    }
  }
}

TEST(AliasTable, ProbabilitiesAreProportionalToWeights)
{
  expect_exact({1});
  expect_exact({1, 1, 1, 1});
  expect_exact({0, 3, 0, 1e-6f, 5, 0});
  expect_exact({1e30f, 1e-30f, 1e30f});
  std::vector<float> many;
  for (std::uint32_t i = 0; i < 10007; ++i) many.push_back(i % 3 == 0 ? 0.0f : std::exp(8 * sample_1d(1, i, 0)));
  expect_exact(many);
}

TEST(AliasTable, SampleAgreesWithTheTableAndLeavesAUniformNumber)
{
  const std::vector<float> weights{2, 0, 1, 5};
  const std::vector<AliasEntry> entries = alias_table_make(weights);
  const AliasTableView view{entries.data(), 4};
  const int n = 1 << 20;
  std::vector<int> counts(4, 0);
  std::vector<double> rest(4, 0.0);
  for (int i = 0; i < n; ++i) {
    const AliasSample sample = alias_table_sample(view, (static_cast<float>(i) + 0.5f) / static_cast<float>(n));
    ASSERT_EQ(sample.probability, weights[sample.index] / 8);
    ASSERT_TRUE(sample.u >= 0.0f && sample.u < 1.0f);
    ++counts[sample.index];
    rest[sample.index] += static_cast<double>(sample.u);
  }
  // The lattice in u puts each count within one of its share for every piece of a bucket.
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(counts[i], static_cast<double>(weights[i]) / 8 * n, 8);
    if (counts[i] > 0) {
      EXPECT_NEAR(rest[i] / counts[i], 0.5, 1e-4);
    }
  }
}

TEST(AliasTable, NothingToChooseGivesProbabilityZero)
{
  EXPECT_TRUE(alias_table_make(std::vector<float>{0, 0}).empty());
  EXPECT_EQ(alias_table_sample({}, 0.5f).probability, 0.0f);
}

TEST(AliasTable, LargestNumberBelowOneStaysInside)
{
  std::vector<float> weights(1000003, 1.0f);
  const std::vector<AliasEntry> entries = alias_table_make(weights);
  const AliasSample sample = alias_table_sample({entries.data(), 1000003}, 0x1.fffffep-1f);
  EXPECT_LT(sample.index, 1000003u);
  EXPECT_LT(sample.u, 1.0f);
}

}  // namespace
}  // namespace relief
