// The `relief` program: picks the sub-command, prints errors, chooses the exit code. Nothing else prints errors.
#include <cstdio>
#include <exception>
#include <new>
#include <string>

#include <fmt/format.h>

#include "cli/cmd_compare.h"
#include "cli/cmd_merge.h"
#include "cli/commands.h"
#include "exporters/errors.h"
#include "scene/diagnostics.h"

namespace {

enum ExitCode : int { kDone = 0, kFailed = 1, kUsage = 2, kInvalidScene = 3 };

int report(ExitCode code, const char* what, const char* hint)
{
  fmt::print(stderr, "relief: {}\n", what);
  if (hint != nullptr) fmt::print(stderr, "  {}\n", hint);
  return code;
}

}  // namespace

int main(int argc, char** argv)
{
  CLI::App app("relief " RELIEF_VERSION ": renders displacement-mapped glTF scenes", "relief");
  app.set_version_flag("--version", "relief " RELIEF_VERSION);
  app.require_subcommand(1);
  std::string command_line = "relief";
  for (int i = 1; i < argc; ++i) command_line += std::string(" ") + argv[i];
  relief::Run run;
  relief::cmd_render_register(app, run, command_line);
  relief::cmd_info_register(app, run);
  relief::cmd_trace_register(app, run);
  relief::cmd_compare_register(app, run);
  relief::cmd_merge_register(app, run);

  try {
    app.parse(argc, argv);
    return run();
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kDone : kUsage;
  } catch (const relief::SceneError& error) {
    return report(kInvalidScene, error.what(), "the scene format is described in docs/scene_format.md");
  } catch (const relief::InputError& error) {
    return report(kInvalidScene, error.what(), nullptr);
  } catch (const relief::OutputError& error) {
    return report(kFailed, error.what(), nullptr);
  } catch (const std::bad_alloc&) {
    return report(kFailed, "out of memory", "a lower --texture-memory or --resolution needs less");
  } catch (const std::exception& error) {
    return report(kFailed, error.what(), nullptr);
  }
}
