// Keeps two runs from making the same file at the same time.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "exporters/side_file.h"

namespace relief {

/// The right to make a file, as long as the object lives; a process that is killed loses it. Waits some milliseconds at most.
/// The lock is a file beside the output (side_file.h), which goes away with it.
class OutputLock {
 public:
  /// Tries to get the right.
  /// @param output  devices, pipes and an empty path need none; where the file system knows no locks, everybody gets it
  /// @error OutputError if the folder cannot be written to
  explicit OutputLock(const std::filesystem::path& output);
  ~OutputLock();
  OutputLock(const OutputLock&) = delete;
  OutputLock& operator=(const OutputLock&) = delete;

  /// Who has the right instead, such as "process 12 on desk"; empty: this run.
  const std::string& holder() const { return holder_; }

 private:
  std::filesystem::path path_;
  std::optional<SideFileNote> note_;
  int descriptor_ = -1;
  std::string holder_;
};

}  // namespace relief
