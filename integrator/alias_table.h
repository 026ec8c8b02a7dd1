// Builds the tables that kernel/sample/alias_table.h chooses from.
#pragma once

#include <span>
#include <vector>

#include "kernel/sample/alias_table.h"

namespace relief {

/// Table for choosing i with probability weights[i] / sum.
/// @param weights  finite, >= 0, fewer than 2^24 (beyond, a float random number cannot tell the buckets apart)
/// @return         empty when all weights are zero; entries of zero weight are never chosen
/// @source Vose 1991, "A Linear Algorithm for Generating Random Numbers with a Given Distribution"
std::vector<AliasEntry> alias_table_make(std::span<const float> weights);

}  // namespace relief
