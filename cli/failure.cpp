#include "cli/failure.h"

#include <exception>

#include "cli/error_text.h"
#include "cli/suggestion.h"
#include "exporters/errors.h"
#include "scene/diagnostics.h"

namespace relief {

namespace {

/// An error that may come of a lack of memory, perhaps told by a library's words.
Failure perhaps_of_memory(ExitCode code, const std::exception& error)
{
  if (!is_of_memory(error)) return {code, error.what(), {}};
  return {kFailed, error_text(error),
          "--max-memory, --texture-memory, --resolution and a shell's ulimit -v set what is needed and what there is",
          true};
}

}  // namespace

Failure current_failure(const CLI::App& app, const std::vector<std::string>& arguments)
{
  try {
    throw;
  } catch (const CLI::ParseError& error) {
    const auto commands = app.get_subcommands();
    std::string hint = suggestion(app, arguments);
    if (!hint.empty()) hint += "; ";
    return {kUsage, error.what(),
            hint + "see relief " + (commands.empty() ? "" : commands.front()->get_name() + " ") + "--help"};
  } catch (const SceneError& error) {
    return {kInvalidScene, error.what(),
            error.json_path.empty() ? "" : "the scene format is described in docs/scene_format.md"};
  } catch (const InputError& error) {
    return perhaps_of_memory(kInvalidScene, error);
  } catch (const std::exception& error) {
    return perhaps_of_memory(kFailed, error);
  }
}

}  // namespace relief
