// What tells whether a file is still the one that was read.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace relief {

/// A file as it was at one moment. Taken before the file is read: what is saved while it is read then differs afterwards.
struct FileStamp {
  std::string path;
  std::uint64_t device = 0, inode = 0, bytes = 0;
  std::int64_t modified_ns = 0, changed_ns = 0;  ///< of the content, and of anything else, such as the name; since 1970

  bool operator==(const FileStamp&) const = default;
};

/// Looks at a file; symbolic links are followed.
/// @return all zero but for the path if there is none
FileStamp file_stamp(const std::filesystem::path& path);

/// Paths of the files that are not what they were, each once.
std::vector<std::string> files_changed(const std::vector<FileStamp>& stamps);

}  // namespace relief
