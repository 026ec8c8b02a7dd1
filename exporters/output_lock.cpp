#include "exporters/output_lock.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <string_view>
#include <system_error>
#include <thread>

#include <fcntl.h>
#include <unistd.h>

#include "exporters/atomic_file.h"
#include "exporters/errors.h"

namespace relief {

namespace {

/// What the holder wrote into its lock, fit to be printed.
std::string holder_of(int descriptor)
{
  std::array<char, 128> text{};
  const ssize_t size = ::pread(descriptor, text.data(), text.size(), 0);
  std::string holder(text.data(), static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
  holder.erase(std::find(holder.begin(), holder.end(), '\n'), holder.end());
  std::replace_if(
      holder.begin(), holder.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  // Between making and locking the file and writing into it there is a moment.
  return holder.empty() ? "another process" : holder;
}

/// How a lock that stands there already is opened: whatever it is, nothing happens to it, and nobody waits.
constexpr int kOldFlags = O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK;

/// Says in the lock who has it. That is for people and for side_files_clean: a full disk does not matter.
void sign(int descriptor)
{
  const std::string text = "process " + std::to_string(::getpid()) + " on " + host_name() + "\n";
  [[maybe_unused]] const bool is_signed =
      ::ftruncate(descriptor, 0) == 0 && ::pwrite(descriptor, text.data(), text.size(), 0) >= 0;
}

}  // namespace

OutputLock::OutputLock(const std::filesystem::path& output)
{
  if (output.empty()) return;
  const std::filesystem::path destination = output_destination(output);
  if (is_stream(destination)) return;
  path_ = destination.parent_path() / lock_name_of(destination.filename().string());
  // side_files_clean holds a lock for a moment to see whether anybody else does.
  constexpr int kMostTries = 20;
  for (int try_number = 1;; ++try_number) {
    // Only what was made here is written into: a file that stands there already may be another name of any file.
    descriptor_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    const bool is_new = descriptor_ >= 0;
    if (!is_new && errno == EEXIST) descriptor_ = ::open(path_.c_str(), O_RDWR | kOldFlags);
    // Another user's lock cannot be written to, but it can be asked.
    if (descriptor_ < 0 && errno == EACCES) descriptor_ = ::open(path_.c_str(), O_RDONLY | kOldFlags);
    if (descriptor_ < 0 && errno == ENOENT && try_number < kMostTries) continue;
    if (descriptor_ < 0) throw OutputError(output.string(), std::generic_category().message(errno));
    const int error = file_lock(descriptor_, false);
    if (error == EWOULDBLOCK && try_number >= kMostTries) {
      holder_ = holder_of(descriptor_);
      ::close(descriptor_);
      descriptor_ = -1;
      return;
    }
    if (error == EWOULDBLOCK) {
      ::close(descriptor_);
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
      continue;
    }
    if (error == 0 && !is_file_at(descriptor_, path_)) {
      // Its last holder removed it between our opening and locking it.
      ::close(descriptor_);
      continue;
    }
    if (is_new) sign(descriptor_);
    // One that a killed run has left makes room for one that says who has it now. Where that is not allowed, it serves as it is.
    if (!is_new && error == 0 && ::unlink(path_.c_str()) == 0) {
      ::close(descriptor_);
      continue;
    }
    note_.emplace(path_);
    return;
  }
}

OutputLock::~OutputLock()
{
  if (descriptor_ < 0) return;
  // Before it is let go: afterwards it may be another's.
  ::unlink(path_.c_str());
  ::close(descriptor_);
}

}  // namespace relief
