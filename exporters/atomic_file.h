// Files that appear whole or not at all: written aside under a temporary name in the same folder, then renamed.
#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <string_view>

namespace relief {

/// A file being written. Nobody sees it under its own name before `commit`; without a commit it leaves nothing behind.
/// A symbolic link is followed; a device or pipe (such as /dev/stdout) is written directly, since it cannot be renamed.
/// Not synchronized to the disk: it protects against errors, interrupts and parallel writers, not against power cuts.
class AtomicFile {
 public:
  /// Opens the temporary file; its name is unique across processes and machines that share the folder.
  /// @param target  final path; its folder must exist
  /// @error OutputError if the temporary file cannot be made or the target is a folder
  explicit AtomicFile(std::filesystem::path target);

  /// Removes the temporary file unless it was committed.
  ~AtomicFile();

  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  /// Appends at the current position. @error OutputError, e.g. disk full
  void write(const void* bytes, std::size_t num_bytes);

  /// Moves the position, in bytes from the start. @error OutputError, e.g. for a pipe
  void seek(std::uint64_t position);

  /// Position in bytes from the start. @error OutputError
  std::uint64_t position();

  /// Closes the file and gives it its name, replacing an older file in one step.
  /// @error OutputError; the older file is then untouched. An earlier failure is reported again: a library in between may
  ///        have swallowed it
  void commit();

  /// Path as the caller gave it, for messages.
  const std::filesystem::path& path() const { return path_; }

 private:
  [[noreturn]] void fail(int error_number);

  std::filesystem::path path_, destination_, temporary_;
  std::FILE* file_ = nullptr;
  int first_error_ = 0;  ///< errno of the first failure; 0: none
};

/// Writes a whole file. @error OutputError
void atomic_write(const std::filesystem::path& target, std::string_view bytes);

}  // namespace relief
