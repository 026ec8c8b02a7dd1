// The option --max-memory, which all commands have that read large files.
#pragma once

#include <CLI/App.hpp>

namespace relief {

/// Adds --max-memory, which sets the process's limit.
void add_max_memory(CLI::App& command);

}  // namespace relief
