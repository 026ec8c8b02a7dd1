// The `relief` program: picks the sub-command, prints errors, chooses the exit code. Nothing else prints errors.
#include <cerrno>
#include <cstdio>
#include <exception>
#include <new>
#include <string>
#include <string_view>
#include <system_error>

#include "cli/cmd_compare.h"
#include "cli/cmd_merge.h"
#include "cli/commands.h"
#include "exporters/errors.h"
#include "scene/diagnostics.h"

namespace {

enum ExitCode : int { kDone = 0, kFailed = 1, kUsage = 2, kInvalidScene = 3 };

/// Prints an error and a hint (empty: none). Nothing can be done about a message that cannot be written.
int report(ExitCode code, const std::string& what, const std::string& hint = {})
{
  std::string text = "relief: " + what + "\n";
  if (!hint.empty()) text += "  " + hint + "\n";
  std::fputs(text.c_str(), stderr);
  return code;
}

/// An argument as a shell would have to be given it again.
std::string quoted(std::string_view argument)
{
  constexpr std::string_view kPlain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=.,:/#@%";
  // A # begins a comment only where a word begins.
  if (!argument.empty() && argument.front() != '#' && argument.find_first_not_of(kPlain) == std::string_view::npos) {
    return std::string(argument);
  }
  std::string text = "'";
  for (const char c : argument) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

int run_command(const relief::Run& run)
{
  const int code = run();
  // What the streams still hold is written here, so this is where a full disk shows.
  if (std::fflush(stdout) != 0) throw relief::OutputError("standard output", std::generic_category().message(errno));
  return code;
}

}  // namespace

int main(int argc, char** argv)
{
  CLI::App app("relief " RELIEF_VERSION ": renders displacement-mapped glTF scenes", "relief");
  app.set_version_flag("--version", "relief " RELIEF_VERSION);
  app.require_subcommand(0, 1);
  std::string command_line = "relief";
  for (int i = 1; i < argc; ++i) command_line += " " + quoted(argv[i]);
  relief::Run run;
  relief::cmd_render_register(app, run, command_line);
  relief::cmd_info_register(app, run);
  relief::cmd_trace_register(app, run);
  relief::cmd_compare_register(app, run);
  relief::cmd_merge_register(app, run);
  relief::cmd_bench_register(app, run);

  try {
    app.parse(argc, argv);
    if (!run) throw CLI::RequiredError("a command (render, info, trace, compare, merge or bench)");
    return run_command(run);
  } catch (const CLI::ParseError& error) {
    // Help and version come as exceptions too.
    if (error.get_exit_code() == 0) return app.exit(error);
    const auto commands = app.get_subcommands();
    return report(kUsage, error.what(),
                  "see relief " + (commands.empty() ? "" : commands.front()->get_name() + " ") + "--help");
  } catch (const relief::SceneError& error) {
    return report(kInvalidScene, error.what(),
                  error.json_path.empty() ? "" : "the scene format is described in docs/scene_format.md");
  } catch (const relief::InputError& error) {
    return report(kInvalidScene, error.what());
  } catch (const relief::OutputError& error) {
    return report(kFailed, error.what());
  } catch (const std::bad_alloc&) {
    return report(kFailed, "out of memory", "a lower --texture-memory or --resolution needs less");
  } catch (const std::exception& error) {
    return report(kFailed, error.what());
  }
}
