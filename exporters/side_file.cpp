#include "exporters/side_file.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <mutex>
#include <random>
#include <set>
#include <system_error>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

namespace relief {

namespace {

std::mutex g_noted_mutex;
std::multiset<std::filesystem::path> g_noted;

constexpr std::string_view kPrefix = ".relief-", kTemporarySuffix = ".tmp", kLockSuffix = ".lock";
constexpr std::size_t kHostDigits = 8, kNumberDigits = 16;

std::string hexadecimal(std::uint64_t value, std::size_t num_digits)
{
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text(num_digits, '0');
  for (std::size_t i = num_digits; i-- > 0; value >>= 4) text[i] = kDigits[value & 15u];
  return text;
}

std::string host_tag() { return hexadecimal(hash_of(host_name()), kHostDigits); }

bool is_hexadecimal(std::string_view text)
{
  return text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

/// Whether temporary_name_make made the name, on this machine.
bool is_temporary_of_this_host(std::string_view name)
{
  const std::string start = std::string(kPrefix) + host_tag() + "-";
  return name.size() == start.size() + kNumberDigits + kTemporarySuffix.size() && name.starts_with(start) &&
         name.ends_with(kTemporarySuffix) && is_hexadecimal(name.substr(start.size(), kNumberDigits));
}

bool is_lock(std::string_view name)
{
  return name.size() == kPrefix.size() + kNumberDigits + kLockSuffix.size() && name.starts_with(kPrefix) &&
         name.ends_with(kLockSuffix) && is_hexadecimal(name.substr(kPrefix.size(), kNumberDigits));
}

/// Whether a lock's text says that a process of this machine made it. One that was killed before it wrote says nothing: its
/// lock is anybody's, since a living one would make another.
bool is_lock_of_this_host(int descriptor)
{
  std::array<char, 512> text{};
  const ssize_t size = ::pread(descriptor, text.data(), text.size(), 0);
  const std::string end = " on " + host_name() + "\n";
  return size == 0 || (size > 0 && std::string_view(text.data(), static_cast<std::size_t>(size)).ends_with(end));
}

void remove_if_abandoned(const std::filesystem::path& path, bool is_a_lock)
{
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
  if (descriptor < 0) return;
  struct stat status {};
  const bool is_ours =
      ::fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode) != 0 && status.st_uid == ::geteuid();
  if (is_ours && file_lock(descriptor, false) == 0 && is_file_at(descriptor, path) &&
      (!is_a_lock || is_lock_of_this_host(descriptor))) {
    ::unlink(path.c_str());
  }
  ::close(descriptor);
}

}  // namespace

std::string host_name()
{
  std::array<char, 256> name{};
  return ::gethostname(name.data(), name.size() - 1) == 0 ? std::string(name.data()) : std::string("localhost");
}

std::uint64_t hash_of(std::string_view bytes, std::uint64_t start)
{
  for (const char byte : bytes) start = (start ^ static_cast<unsigned char>(byte)) * 0x100000001b3u;
  return start;
}

std::string temporary_name_make()
{
  // The operating system's entropy, not a process number: renders on several machines may share the folder.
  std::random_device entropy;
  const std::uint64_t number = std::uint64_t{entropy()} << 32 | entropy();
  return std::string(kPrefix) + host_tag() + "-" + hexadecimal(number, kNumberDigits) + std::string(kTemporarySuffix);
}

std::string lock_name_of(std::string_view file_name)
{
  return std::string(kPrefix) + hexadecimal(hash_of(file_name), kNumberDigits) + std::string(kLockSuffix);
}

int file_lock(int descriptor, bool waits)
{
  while (::flock(descriptor, LOCK_EX | (waits ? 0 : LOCK_NB)) != 0) {
    if (errno != EINTR) return errno;
  }
  return 0;
}

bool is_file_at(int descriptor, const std::filesystem::path& path)
{
  struct stat open_file {
  }, named{};
  return ::fstat(descriptor, &open_file) == 0 && ::lstat(path.c_str(), &named) == 0 &&
         open_file.st_dev == named.st_dev && open_file.st_ino == named.st_ino;
}

SideFileNote::SideFileNote(std::filesystem::path path) : path_(std::move(path))
{
  const std::lock_guard guard(g_noted_mutex);
  g_noted.insert(path_);
}

SideFileNote::~SideFileNote()
{
  const std::lock_guard guard(g_noted_mutex);
  g_noted.extract(path_);
}

void side_files_remove()
{
  const std::lock_guard guard(g_noted_mutex);
  for (const std::filesystem::path& path : g_noted) ::unlink(path.c_str());
}

void side_files_clean(const std::filesystem::path& folder)
{
  std::error_code error;
  std::vector<std::filesystem::path> found;
  for (std::filesystem::directory_iterator entry(folder.empty() ? "." : folder, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (is_temporary_of_this_host(name) || is_lock(name)) found.push_back(entry->path());
  }
  for (const std::filesystem::path& path : found) remove_if_abandoned(path, path.extension() == kLockSuffix);
}

}  // namespace relief
