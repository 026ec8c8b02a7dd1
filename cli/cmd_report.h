// `relief report`: a page about a rendered frame.
#pragma once

#include <functional>

#include <CLI/App.hpp>

namespace relief {

/// Adds the sub-command `report` with its options.
/// @param run  set, if the sub-command is parsed, to the function that does the work; it returns the exit code and throws
///             InputError or OutputError
void cmd_report_register(CLI::App& app, std::function<int()>& run);

}  // namespace relief
