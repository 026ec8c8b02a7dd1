// Choice among many in proportion to fixed weights, in constant time. integrator/alias_table.h builds the table.
#pragma once

#include "kernel/math/vec.h"

namespace relief {

/// One bucket: itself below the threshold, its alias above.
struct AliasEntry {
  float threshold = 1;      ///< [0, 1]
  std::uint32_t alias = 0;  ///< which one the rest of the bucket belongs to
  float probability = 0;    ///< of choosing this entry's own index
};

struct AliasTableView {
  const AliasEntry* entries = nullptr;
  std::uint32_t size = 0;  ///< 0: nothing to choose
};

struct AliasSample {
  std::uint32_t index = 0;
  float probability = 0;  ///< 0: nothing was chosen
  float u = 0;            ///< what is left of the random number, [0, 1): uniform, 24 − log2(size) bits of it
};

/// @param u  [0, 1)
/// @source Walker 1974; Vose 1991
RELIEF_KERNEL AliasSample alias_table_sample(AliasTableView table, float u)
{
  if (table.size == 0) return {};
  const float scaled = u * static_cast<float>(table.size);
  const std::uint32_t floor = static_cast<std::uint32_t>(scaled);
  // The product can round up to the size itself.
  const std::uint32_t bucket = floor < table.size ? floor : table.size - 1;
  const float within = clamp(scaled - static_cast<float>(bucket), 0.0f, 0x1.fffffep-1f);
  const AliasEntry& entry = table.entries[bucket];
  if (within < entry.threshold) return {bucket, entry.probability, min(within / entry.threshold, 0x1.fffffep-1f)};
  const float rest = (within - entry.threshold) / (1.0f - entry.threshold);
  return {entry.alias, table.entries[entry.alias].probability, min(rest, 0x1.fffffep-1f)};
}

}  // namespace relief
