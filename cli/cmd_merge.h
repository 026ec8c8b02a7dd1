// `relief merge`: joins renders of the same frame with different seeds.
#pragma once

#include <CLI/App.hpp>
#include <functional>

namespace relief {

/// Adds the sub-command `merge` with its options.
/// @param run  set, if the sub-command is parsed, to the function that does the work; it returns the exit code and throws
///             InputError or OutputError
void cmd_merge_register(CLI::App& app, std::function<int()>& run);

}  // namespace relief
