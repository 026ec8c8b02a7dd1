// `relief compare`: how far one picture is from another, and whether that is acceptable.
#pragma once

#include <CLI/App.hpp>
#include <functional>

namespace relief {

/// Adds the sub-command `compare` with its options.
/// @param run  set, if the sub-command is parsed, to the function that does the work; it returns the exit code (1 when a bound
///             is not met or the z-test fails) and throws InputError or OutputError
void cmd_compare_register(CLI::App& app, std::function<int()>& run);

}  // namespace relief
