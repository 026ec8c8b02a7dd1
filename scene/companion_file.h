// Files that belong to the program and are not in it: a module, another program.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace relief {

/// Where such a file may be, the first one first: beside the program, where a copy of both finds it; where it is installed; or where
/// it was built, for the programs of tests.
/// @param built  path of the last
std::vector<std::filesystem::path> companion_places(const std::string& name, const std::string& built);

/// What is wrong where none of them is there.
std::string companion_missing(const std::string& name);

}  // namespace relief
