#include "exporters/atomic_file.h"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <mutex>
#include <set>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "exporters/errors.h"

namespace relief {

namespace {

namespace fs = std::filesystem;

/// Whether a path names an open file of a process, as /proc/self/fd/1 does. What such a link says is no path to follow: a pipe
/// has none, and a file that is open for appending must not be replaced.
bool names_open_file(const fs::path& path)
{
  std::error_code ignored;
  const fs::path folder = fs::canonical(path.parent_path(), ignored);
  return !ignored && folder.filename() == "fd" && folder.native().starts_with("/proc/");
}

/// Number of the open file of this process that a path names, or −1.
int own_descriptor(const fs::path& path)
{
  std::error_code ignored;
  if (!names_open_file(path) || !fs::equivalent(path.parent_path(), "/proc/self/fd", ignored)) return -1;
  const std::string name = path.filename().string();
  int number = -1;
  const auto result = std::from_chars(name.data(), name.data() + name.size(), number);
  return result.ec == std::errc() && result.ptr == name.data() + name.size() ? number : -1;
}

void clean_once(const fs::path& folder)
{
  static std::mutex mutex;
  static std::set<fs::path> cleaned;
  {
    const std::lock_guard guard(mutex);
    if (!cleaned.insert(folder).second) return;
  }
  side_files_clean(folder);
}

/// Gives a new file the owner and the permissions of the one that it will replace, as far as the system allows.
void copy_access(int descriptor, const struct stat& old)
{
  struct stat now {};
  if (::fstat(descriptor, &now) == 0 && (now.st_uid != old.st_uid || now.st_gid != old.st_gid) &&
      ::fchown(descriptor, old.st_uid, old.st_gid) != 0) {
    [[maybe_unused]] const int group_alone = ::fchown(descriptor, static_cast<uid_t>(-1), old.st_gid);
  }
  // Afterwards: a change of owner may take permissions away.
  ::fchmod(descriptor, old.st_mode & 0777u);
}

/// Whether this user may give a file's name to another file: in a folder with the sticky bit, as /tmp, that is for the owners
/// alone.
bool may_be_replaced(const fs::path& file, const struct stat& status)
{
  struct stat folder {};
  const fs::path parent = file.has_parent_path() ? file.parent_path() : fs::path(".");
  if (::stat(parent.c_str(), &folder) != 0 || (folder.st_mode & S_ISVTX) == 0) return true;
  const uid_t user = ::geteuid();
  return user == 0 || user == status.st_uid || user == folder.st_uid;
}

}  // namespace

fs::path output_destination(const fs::path& path)
{
  // As many as Linux follows.
  constexpr int kMostLinks = 40;
  fs::path destination = path;
  std::error_code ignored;
  for (int i = 0; i <= kMostLinks; ++i) {
    if (!fs::is_symlink(destination, ignored) || names_open_file(destination)) return destination;
    const fs::path next = fs::read_symlink(destination, ignored);
    if (ignored) return destination;
    destination = next.is_absolute() ? next : destination.parent_path() / next;
  }
  throw OutputError(path.string(), std::generic_category().message(ELOOP));
}

bool is_stream(const fs::path& destination)
{
  std::error_code ignored;
  const fs::file_status status = fs::status(destination, ignored);
  if (!fs::exists(status) || fs::is_directory(status)) return false;
  return !fs::is_regular_file(status) || names_open_file(destination);
}

AtomicFile::AtomicFile(fs::path target) : path_(std::move(target)), destination_(output_destination(path_))
{
  std::error_code ignored;
  if (fs::is_directory(destination_, ignored)) fail(EISDIR);
  if (is_stream(destination_)) {
    open_stream();
  } else {
    open_temporary();
  }
}

AtomicFile::~AtomicFile()
{
  if (file_ != nullptr) std::fclose(file_);
  // The lock is let go last: until then nobody else takes the file for an abandoned one.
  if (!temporary_.empty()) ::unlink(temporary_.c_str());
  close_descriptor();
}

void AtomicFile::fail(int error_number)
{
  if (first_error_ == 0) first_error_ = error_number;
  throw OutputError(path_.string(), std::generic_category().message(error_number));
}

void AtomicFile::close_descriptor()
{
  if (descriptor_ >= 0) ::close(descriptor_);
  descriptor_ = -1;
}

void AtomicFile::open_stream()
{
  // Opened by its name, a file that standard output goes to would be emptied, and its end be forgotten.
  const int own = own_descriptor(destination_);
  descriptor_ =
      own >= 0 ? ::fcntl(own, F_DUPFD_CLOEXEC, 0) : ::open(destination_.c_str(), O_WRONLY | O_CLOEXEC | O_NOCTTY);
  if (descriptor_ < 0) fail(errno);
}

void AtomicFile::open_temporary()
{
  struct stat old {};
  const bool replaces = ::stat(destination_.c_str(), &old) == 0;
  // Renaming would ask the folder alone; who writes to a file needs the file's permission.
  if (replaces && ::faccessat(AT_FDCWD, destination_.c_str(), W_OK, AT_EACCESS) != 0) fail(errno);
  if (replaces && !may_be_replaced(destination_, old)) fail(EPERM);
  // The folder of an empty path is no folder.
  if (destination_.filename().empty()) fail(ENOENT);
  const long name_limit =
      ::pathconf(destination_.has_parent_path() ? destination_.parent_path().c_str() : ".", _PC_NAME_MAX);
  if (name_limit > 0 && destination_.filename().native().size() > static_cast<std::size_t>(name_limit)) {
    fail(ENAMETOOLONG);
  }
  clean_once(destination_.parent_path());
  while (true) {
    const fs::path temporary = destination_.parent_path() / temporary_name_make();
    const int opened =
        ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, replaces ? S_IRUSR | S_IWUSR : 0666);
    if (opened < 0 && errno == EEXIST) continue;
    if (opened < 0) fail(errno);
    // Without locks nobody cleans either.
    const bool is_locked = file_lock(opened, true) == 0;
    if (is_locked && !is_file_at(opened, temporary)) {
      // Somebody cleaned it away before it was locked.
      ::close(opened);
      continue;
    }
    temporary_ = temporary;
    note_.emplace(temporary_);
    if (replaces) copy_access(opened, old);
    descriptor_ = ::fcntl(opened, F_DUPFD_CLOEXEC, 0);
    file_ = ::fdopen(opened, "wb");
    if (file_ == nullptr || descriptor_ < 0) {
      const int error_number = errno;
      if (file_ == nullptr) ::close(opened);
      if (file_ != nullptr) std::fclose(file_);
      file_ = nullptr;
      ::unlink(temporary_.c_str());
      close_descriptor();
      fail(error_number);
    }
    return;
  }
}

void AtomicFile::write(const void* bytes, std::size_t num_bytes)
{
  if (file_ == nullptr) {
    if (num_bytes == 0) return;
    stream_bytes_.resize(std::max(stream_bytes_.size(), stream_position_ + num_bytes));
    std::memcpy(stream_bytes_.data() + stream_position_, bytes, num_bytes);
    stream_position_ += num_bytes;
  } else if (std::fwrite(bytes, 1, num_bytes, file_) != num_bytes) {
    fail(errno);
  }
}

void AtomicFile::seek(std::uint64_t position)
{
  if (file_ == nullptr) {
    stream_position_ = static_cast<std::size_t>(position);
  } else if (std::fseek(file_, static_cast<long>(position), SEEK_SET) != 0) {
    fail(errno);
  }
}

std::uint64_t AtomicFile::position()
{
  if (file_ == nullptr) return stream_position_;
  const long position = std::ftell(file_);
  if (position < 0) fail(errno);
  return static_cast<std::uint64_t>(position);
}

void AtomicFile::commit()
{
  if (file_ == nullptr) {
    commit_stream();
  } else {
    commit_temporary();
  }
}

void AtomicFile::commit_stream()
{
  std::string_view rest = stream_bytes_;
  while (!rest.empty()) {
    const ssize_t written = ::write(descriptor_, rest.data(), rest.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail(errno);
    rest.remove_prefix(static_cast<std::size_t>(written));
  }
  const int descriptor = std::exchange(descriptor_, -1);
  if (::close(descriptor) != 0) fail(errno);
}

void AtomicFile::commit_temporary()
{
  std::FILE* file = std::exchange(file_, nullptr);
  // Buffered bytes leave the process here, so this is where a full disk may show first.
  if (std::fclose(file) != 0) fail(errno);
  // What OpenEXR writes in a destructor fails without a word, and then nothing is left in the buffer to fail above.
  if (first_error_ != 0) fail(first_error_);
  // A name may reach the disk before the bytes that it names: after a power cut it would stand for an empty file.
  synchronize(descriptor_);
  if (::rename(temporary_.c_str(), destination_.c_str()) != 0) keep_aside(errno);
  temporary_.clear();
  note_.reset();
  synchronize_folder();
  close_descriptor();
}

void AtomicFile::keep_aside(int error_number)
{
  // The folder, or what stands in it, has changed since the file was opened. What was made may have taken hours.
  constexpr int kMostNames = 1000;
  for (int i = 1; i <= kMostNames; ++i) {
    fs::path aside = destination_;
    aside.replace_filename(destination_.stem().string() + ".kept-" + std::to_string(i) +
                           destination_.extension().string());
    if (::link(temporary_.c_str(), aside.c_str()) != 0) {
      if (errno == EEXIST) continue;
      break;
    }
    first_error_ = error_number;
    throw OutputError(path_.string(), std::generic_category().message(error_number) + "; it is kept as '" +
                                          aside.string() + "'");
  }
  fail(error_number);
}

void AtomicFile::synchronize(int descriptor)
{
  while (::fsync(descriptor) != 0) {
    // Where a file system cannot do it there is nothing more to be done.
    if (errno == EINVAL || errno == ENOTSUP) return;
    if (errno != EINTR) fail(errno);
  }
}

void AtomicFile::synchronize_folder()
{
  const fs::path folder = destination_.has_parent_path() ? destination_.parent_path() : fs::path(".");
  // A folder may be written to and not be read. The file has its name all the same.
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;
  ::fsync(descriptor);
  ::close(descriptor);
}

void atomic_write(const fs::path& target, std::string_view bytes)
{
  AtomicFile file(target);
  file.write(bytes.data(), bytes.size());
  file.commit();
}

}  // namespace relief
