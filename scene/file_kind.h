// What a file is that should have been something else, for messages.
#pragma once

#include <string_view>

namespace relief {

/// In words, by a file's first bytes; empty: not one of those that people take for scenes or that stand in for files.
std::string_view file_kind(std::string_view begin);

}  // namespace relief
