// `relief denoise`: denoises a rendered file.
#pragma once

#include <functional>

#include <CLI/App.hpp>

namespace relief {

/// Registers the sub-command; `run` is set to its work when it is the one that was given.
void cmd_denoise_register(CLI::App& app, std::function<int()>& run);

}  // namespace relief
