// The `relief` program: picks the sub-command, prints errors, chooses the exit code. Nothing else prints errors, but `relief serve`
// to whom it serves.
#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <new>
#include <string>
#include <vector>

// All of CLI11, whose other half the program needs once: every other file includes its App.hpp alone, which takes half the time.
#include <CLI/CLI.hpp>

#include "cli/arguments.h"
#include "cli/cmd_compare.h"
#include "cli/cmd_denoise.h"
#include "cli/cmd_merge.h"
#include "cli/cmd_report.h"
#include "cli/commands.h"
#include "cli/failure.h"
#include "cli/interrupt.h"
#include "cli/standard_streams.h"
#include "cli/version.h"
#include "scene/diagnostics.h"
#include "scene/memory.h"
#include "scene/reading_root.h"

namespace {

/// Prints an error and its hint. Nothing can be done about a message that cannot be written.
int report(const relief::Failure& failure)
{
  std::string text = "relief: " + relief::printable_text(failure.text) + "\n";
  if (!failure.hint.empty()) text += "  " + relief::printable_text(failure.hint) + "\n";
  std::fputs(text.c_str(), stderr);
  return failure.code;
}

/// Memory may be short where no exception can pass: a library's threads, functions that must not fail. Those end the program;
/// what they say of it should be no riddle.
[[noreturn]] void end_without_memory()
{
  try {
    if (const std::exception_ptr error = std::current_exception()) std::rethrow_exception(error);
  } catch (const std::bad_alloc&) {
    std::fputs("relief: out of memory\n", stderr);
    std::_Exit(relief::kFailed);
  } catch (const std::exception& error) {
    if (relief::is_out_of_memory(error.what())) {
      std::fprintf(stderr, "relief: out of memory: %s\n", error.what());
      std::_Exit(relief::kFailed);
    }
    std::fprintf(stderr, "relief: %s\n", error.what());
  } catch (...) {
  }
  std::abort();
}

/// What was typed, without the program's name; `help` is another word for --help.
std::vector<std::string> arguments_of(int argc, char** argv)
{
  std::vector<std::string> arguments(argv + std::min(argc, 1), argv + argc);
  if (!arguments.empty() && arguments.front() == "help") {
    arguments.erase(arguments.begin());
    arguments.emplace_back("--help");
  }
  return arguments;
}

int run_command(const relief::Run& run)
{
  relief::interrupt_watch();
  const int code = run();
  relief::standard_output_flush();
  return code;
}

}  // namespace

int main(int argc, char** argv)
{
  relief::standard_streams_reserve();
  std::set_terminate(end_without_memory);
  // Beyond the limit of a file's size a write then fails, like any other, instead of ending the program.
  std::signal(SIGXFSZ, SIG_IGN);
  CLI::App app("relief " RELIEF_VERSION ": renders displacement-mapped glTF scenes", "relief");
  app.set_version_flag("--version", relief::version_text);
  app.add_option_function<std::string>(
         "--root",
         [](const std::string& folder) {
           if (!relief::reading_root_set(folder)) throw CLI::ValidationError("--root", "expected a folder, found '" + folder + "'");
         },
         "Folder below which files must be that scenes name, for scenes of strangers; given before the command")
      ->type_name("FOLDER");
  app.require_subcommand(0, 1);
  std::string command_line = "relief";
  for (int i = 1; i < argc; ++i) command_line += " " + relief::shell_quoted(argv[i]);
  relief::Run run;
  relief::cmd_render_register(app, run, command_line);
  relief::cmd_serve_register(app, run);
  relief::cmd_info_register(app, run);
  relief::cmd_trace_register(app, run);
  relief::cmd_compare_register(app, run);
  relief::cmd_merge_register(app, run);
  relief::cmd_denoise_register(app, run);
  relief::cmd_report_register(app, run);
  relief::cmd_bench_register(app, run);
  relief::cmd_farm_register(app, run);
  relief::cmd_help_files_register(app, run);

  const std::vector<std::string> arguments = arguments_of(argc, argv);
  try {
    try {
      // CLI11 takes them from the back.
      app.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
    } catch (const CLI::Success& help_or_version) {
      app.exit(help_or_version);
      relief::standard_output_flush();
      return relief::kDone;
    }
    if (!run) throw CLI::RequiredError("a command");
    return run_command(run);
  } catch (...) {
    return report(relief::current_failure(app, arguments));
  }
}
