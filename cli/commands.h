// The sub-commands. Each registers its options with the parser and, when it is the one that was given, sets what to run.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <CLI/App.hpp>

#include "cli/run_files.h"

namespace relief {

/// Work of the chosen sub-command; returns the exit code.
using Run = std::function<int()>;

struct RenderSession;  // cli/render_session.h

/// @param command_line  as given, for the metadata of pictures
/// @param session       of the process, must outlive the parser; null: this is its only render
void cmd_render_register(CLI::App& app, Run& run, const std::string& command_line, RenderSession* session = nullptr);
/// All files of the run that words of a command line of `render` ask for, those that its scenes name too.
/// @param words   with the command's name, without --frames
/// @param frames  that it is for; empty: the rest pose
/// @error CLI::ParseError, also if an output is an input; SceneError
RunFiles render_files(const std::vector<std::string>& words, const std::vector<int>& frames);
void cmd_serve_register(CLI::App& app, Run& run);
void cmd_info_register(CLI::App& app, Run& run);
void cmd_trace_register(CLI::App& app, Run& run);
void cmd_bench_register(CLI::App& app, Run& run);
void cmd_farm_register(CLI::App& app, Run& run);
/// Manual pages and completion, of all commands.
void cmd_help_files_register(CLI::App& app, Run& run);

}  // namespace relief
