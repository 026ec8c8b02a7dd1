#include "integrator/alias_table.h"

#include <cstddef>

namespace relief {

std::vector<AliasEntry> alias_table_make(std::span<const float> weights)
{
  double total = 0;
  for (const float weight : weights) total += static_cast<double>(weight);
  if (!(total > 0)) return {};

  std::vector<AliasEntry> entries(weights.size());
  std::vector<double> left(weights.size());  // of each entry's share, in buckets
  std::vector<std::uint32_t> small, large;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const double probability = static_cast<double>(weights[i]) / total;
    entries[i].probability = static_cast<float>(probability);
    left[i] = probability * static_cast<double>(weights.size());
    (left[i] < 1 ? small : large).push_back(static_cast<std::uint32_t>(i));
  }
  while (!small.empty() && !large.empty()) {
    const std::uint32_t poor = small.back(), rich = large.back();
    small.pop_back();
    entries[poor].threshold = static_cast<float>(left[poor]);
    entries[poor].alias = rich;
    left[rich] -= 1 - left[poor];
    if (left[rich] < 1) {
      large.pop_back();
      small.push_back(rich);
    }
  }
  // What rounding leaves in either list is a full bucket, unless it has no weight at all: that goes to the greatest.
  std::size_t greatest = 0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (weights[i] > weights[greatest]) greatest = i;
  }
  for (const std::uint32_t i : small) {
    entries[i].threshold = weights[i] > 0.0f ? 1.0f : 0.0f;
    entries[i].alias = static_cast<std::uint32_t>(greatest);
  }
  for (const std::uint32_t i : large) entries[i].threshold = 1.0f;
  return entries;
}

}  // namespace relief
