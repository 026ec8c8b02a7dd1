#include <cstdio>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "cli/arguments.h"
#include "cli/commands.h"
#include "cli/failure.h"
#include "cli/interrupt.h"
#include "cli/render_session.h"
#include "cli/requests.h"
#include "cli/standard_streams.h"
#include "scene/memory.h"

namespace relief {

namespace {

/// Renders as `relief render` does, without its --help, which would print what is no JSON.
Failure render_request(const Request& request, RenderSession& session)
{
  std::vector<std::string> arguments = {"render"};
  arguments.insert(arguments.end(), request.words.begin(), request.words.end());
  std::string command_line = "relief";
  for (const std::string& word : arguments) command_line += " " + shell_quoted(word);
  CLI::App app;
  app.set_help_flag();
  Run run;
  cmd_render_register(app, run, command_line, &session);
  memory_limit_reset();
  session.request = request.id;
  try {
    app.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
    return {static_cast<ExitCode>(run()), {}, {}};
  } catch (...) {
    return current_failure(app, arguments);
  }
}

/// @return false if nobody reads the answers any more
bool answer(const Request& request, const Failure& outcome)
{
  nlohmann::json object = {{"event", "end"}, {"id", request.id}, {"exit_code", static_cast<int>(outcome.code)}};
  if (!outcome.text.empty()) object["error"] = outcome.text;
  if (!outcome.hint.empty()) object["hint"] = outcome.hint;
  return print_json(object);
}

int serve()
{
  broken_pipes_ignore();
  Requests requests;
  const Farewell farewell([&] { requests.tell_interrupted(); });
  RenderSession session;
  while (const std::optional<Request> request = requests.next()) {
    Failure outcome{kInterrupted, {}, {}};
    if (!interrupt_flag()) outcome = render_request(*request, session);
    if (outcome.is_of_memory) {
      // What is kept must not cost a request its room.
      session.kept = std::make_unique<KeptFrames>();
      outcome = render_request(*request, session);
    }
    const KeepsForSaving answering;
    if (!answer(*request, outcome)) return kFailed;
    requests.finish();
  }
  return interrupt_by_signal() ? kInterrupted : kDone;
}

}  // namespace

void cmd_serve_register(CLI::App& app, Run& run)
{
  CLI::App* command =
      app.add_subcommand("serve", "Renders what requests on standard input ask for, and keeps what they share");
  command->callback([&run] { run = serve; });
}

}  // namespace relief
