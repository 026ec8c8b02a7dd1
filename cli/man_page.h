// Manual pages out of the tree of options that --help prints.
#pragma once

#include <string>
#include <vector>

#include <CLI/App.hpp>

namespace relief {

/// A page in the man macros of roff, plain ASCII, without warnings of groff or mandoc.
/// @param path  commands from the program on, the last is the page's: relief, bench, displacement
/// @param date  "2026-11-22"
std::string man_page(const std::vector<CLI::App*>& path, const std::string& version, const std::string& date);

/// Name of a page, "relief-bench-displacement"; its file has ".1" after it.
std::string man_page_name(const std::vector<CLI::App*>& path);

/// The program and every command below it that is not hidden, parents first.
std::vector<std::vector<CLI::App*>> man_page_paths(CLI::App& app);

}  // namespace relief
