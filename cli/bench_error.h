// `relief bench error`: speed against error, of all ways to render a scene.
#pragma once

#include <CLI/App.hpp>

#include "cli/commands.h"

namespace relief {

/// Adds the sub-command `error` to `bench`.
void bench_error_register(CLI::App& bench, Run& run);

}  // namespace relief
