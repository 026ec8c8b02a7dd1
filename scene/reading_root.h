// The folder below which files must be that scenes name.
#pragma once

#include <filesystem>

namespace relief {

/// From now on scenes of this process may name no file that is not in this folder or below it, wherever links lead. Called before any scene
/// is read. What the command line names is the user's word, and is read wherever it is.
/// @return false: there is no such folder
bool reading_root_set(const std::filesystem::path& folder);

/// The folder, without links; empty: scenes may name any file.
const std::filesystem::path& reading_root();

/// Whether a scene may have a file read.
/// @param path  exists
bool reading_is_allowed(const std::filesystem::path& path);

}  // namespace relief
