// Files that appear whole or not at all: written aside under a temporary name in the same folder, then renamed.
#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "exporters/side_file.h"

namespace relief {

/// The file that a name stands for: the end of a chain of symbolic links, whether there is a file or not. Names of open
/// files, such as /dev/stdout and /dev/fd/3, are not followed further.
/// @error OutputError if the links lead in a circle
std::filesystem::path output_destination(const std::filesystem::path& path);

/// Whether a destination is written as it is and not replaced: a device, a pipe, or an open file of this process.
bool is_stream(const std::filesystem::path& destination);

/// A file being written. Nobody sees it under its own name before `commit`; without a commit it leaves nothing behind.
/// A symbolic link is followed, also to a file that is not there yet; an older file's owner and permissions are kept. What
/// is_stream says is written directly and in one go, so that a pipe takes formats that are not written from front to end.
/// The bytes are on the disk before the name is, and the name before `commit` returns: a power cut leaves the old file or the
/// new one.
class AtomicFile {
 public:
  /// Opens the temporary file; its name is unique across processes and machines that share the folder. What killed runs have
  /// left in the folder is removed, once in the life of the process.
  /// @param target  final path; its folder must exist
  /// @error OutputError if the temporary file cannot be made, or the target is a folder or may not be written to
  explicit AtomicFile(std::filesystem::path target);

  /// Removes the temporary file unless it was committed.
  ~AtomicFile();

  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  /// Appends at the current position. @error OutputError, e.g. disk full
  void write(const void* bytes, std::size_t num_bytes);

  /// Moves the position, in bytes from the start. @error OutputError
  void seek(std::uint64_t position);

  /// Position in bytes from the start. @error OutputError
  std::uint64_t position();

  /// Closes the file and gives it its name, replacing an older file in one step. If that alone is not possible any more, it gets
  /// another name beside it, NAME.kept-N.SUFFIX.
  /// @error OutputError, which tells that name; the older file is then untouched. An earlier failure is reported again: a library in between may
  ///        have swallowed it
  void commit();

  /// Path as the caller gave it, for messages.
  const std::filesystem::path& path() const { return path_; }

 private:
  [[noreturn]] void fail(int error_number);
  void open_stream();
  void open_temporary();
  void commit_stream();
  void commit_temporary();
  [[noreturn]] void keep_aside(int error_number);
  void synchronize(int descriptor);
  void synchronize_folder();
  void close_descriptor();

  std::filesystem::path path_, destination_, temporary_;
  std::optional<SideFileNote> note_;  ///< of the temporary file
  std::FILE* file_ = nullptr;  ///< the temporary file; null for a stream
  int descriptor_ = -1;        ///< of the stream; or holds the temporary file's lock until it has its name
  std::string stream_bytes_;   ///< written to the stream by commit
  std::size_t stream_position_ = 0;
  int first_error_ = 0;  ///< errno of the first failure; 0: none
};

/// Writes a whole file. @error OutputError
void atomic_write(const std::filesystem::path& target, std::string_view bytes);

}  // namespace relief
