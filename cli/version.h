// What `relief --version` says.
#pragma once

#include <string>

namespace relief {

/// The commit that was built, with "-dirty" if files differ from it; of a file that scripts/cmake/commit.cmake writes.
extern const char* const kCommit;

/// "relief VERSION" on the first line, which the Blender add-on reads; commit, instruction sets and libraries on others.
std::string version_text();

}  // namespace relief
