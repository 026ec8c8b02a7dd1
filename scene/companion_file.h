// Files that belong to the program and are not in it: a module, another program.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace relief {

/// Where such a file may be, the first one first: beside the program, where a copy of both finds it; where it is installed; and for
/// programs in a folder where CMake has built, such as tests, beside the one built there.
std::vector<std::filesystem::path> companion_places(const std::string& name);

/// What is wrong where none of them is there.
std::string companion_missing(const std::string& name);

}  // namespace relief
