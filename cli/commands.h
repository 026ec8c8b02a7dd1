// The sub-commands. Each registers its options with the parser and, when it is the one that was given, sets what to run.
#pragma once

#include <functional>
#include <string>

#include <CLI/CLI.hpp>

namespace relief {

/// Work of the chosen sub-command; returns the exit code.
using Run = std::function<int()>;

/// @param command_line  as given, for the metadata of pictures
void cmd_render_register(CLI::App& app, Run& run, const std::string& command_line);
void cmd_info_register(CLI::App& app, Run& run);
void cmd_trace_register(CLI::App& app, Run& run);
void cmd_bench_register(CLI::App& app, Run& run);
void cmd_farm_register(CLI::App& app, Run& run);
/// Manual pages and completion, of all commands.
void cmd_help_files_register(CLI::App& app, Run& run);

}  // namespace relief
