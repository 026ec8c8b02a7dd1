// What goes wrong in a command, told to people by a line and a hint and to programs by an exit code.
#pragma once

#include <string>
#include <vector>

#include <CLI/App.hpp>

#include "cli/exit_code.h"

namespace relief {

struct Failure {
  ExitCode code = kFailed;
  std::string text, hint;  ///< hint: empty if there is none
  bool is_of_memory = false;
};

/// Says what an exception means. For use in a handler; what is no std::exception is thrown again.
/// @param app        has tried to parse the arguments
/// @param arguments  without the program's name
Failure current_failure(const CLI::App& app, const std::vector<std::string>& arguments);

}  // namespace relief
