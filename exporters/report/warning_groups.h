// Warnings of one kind together.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace relief {

/// Warnings that differ in names and numbers alone.
struct WarningGroup {
  std::string kind;                ///< what they have in common, with … for the rest
  std::vector<std::string> texts;  ///< in the order in which they came
};

/// What a warning says but for what is particular to it: quoted texts, and words with a digit or a slash, become "…".
std::string warning_kind(std::string_view text);

/// The largest groups first.
std::vector<WarningGroup> warning_groups(const std::vector<std::string>& texts);

}  // namespace relief
