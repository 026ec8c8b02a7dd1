// Files that stand beside an output for a while: what is being written (atomic_file.h) and locks (output_lock.h). Each is
// held by flock as long as its process lives, however that ends, so that later runs can tell what nobody needs any more.
// On network file systems flock works where the server's lock service does; elsewhere nothing is cleaned or locked.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace relief {

/// This machine's name.
std::string host_name();

/// FNV-1a, 64 bits: enough to tell apart what nobody forges.
std::uint64_t hash_of(std::string_view bytes, std::uint64_t start = 0xcbf29ce484222325u);

/// A new name for a file that is being written, ".relief-….tmp": short, so that it fits beside any name; unique across
/// processes and machines.
std::string temporary_name_make();

/// The name of the lock of a file, ".relief-….lock": the same for all who would write it.
std::string lock_name_of(std::string_view file_name);

/// Takes the lock of an open file.
/// @param waits  until it is free
/// @return       0, or errno: EWOULDBLOCK if somebody has it
int file_lock(int descriptor, bool waits);

/// Whether a path still leads to the open file: another run may have removed it before it was locked.
bool is_file_at(int descriptor, const std::filesystem::path& path);

/// Says that a side file is this process's, for as long as the object lives.
class SideFileNote {
 public:
  explicit SideFileNote(std::filesystem::path path);
  ~SideFileNote();
  SideFileNote(const SideFileNote&) = delete;
  SideFileNote& operator=(const SideFileNote&) = delete;

 private:
  std::filesystem::path path_;
};

/// Removes this process's side files, before it ends without its destructors.
void side_files_remove();

/// Removes what runs of this machine and user that were killed left in a folder. Files that somebody holds stay, and so does
/// whatever is not certainly ours.
/// @param folder  empty: the current one; one that cannot be read is left alone
void side_files_clean(const std::filesystem::path& folder);

}  // namespace relief
