#include "exporters/atomic_file.h"

#include <cerrno>
#include <random>
#include <system_error>

#include "exporters/errors.h"

namespace relief {

namespace {

std::filesystem::path temporary_path_make(const std::filesystem::path& destination)
{
  // The operating system's entropy, not a process number: renders on several machines may share the folder.
  std::random_device entropy;
  char suffix[32];
  std::snprintf(suffix, sizeof suffix, ".%08x%08x.tmp", entropy(), entropy());
  return destination.parent_path() / ("." + destination.filename().string() + suffix);
}

}  // namespace

AtomicFile::AtomicFile(std::filesystem::path target) : path_(std::move(target)), destination_(path_)
{
  std::error_code ignored;
  if (std::filesystem::is_symlink(path_, ignored)) {
    const std::filesystem::path followed = std::filesystem::weakly_canonical(path_, ignored);
    if (!ignored) destination_ = followed;
  }
  const std::filesystem::file_status status = std::filesystem::status(destination_, ignored);
  if (std::filesystem::is_directory(status)) fail(EISDIR);
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)) {
    file_ = std::fopen(destination_.c_str(), "wb");
  } else {
    temporary_ = temporary_path_make(destination_);
    file_ = std::fopen(temporary_.c_str(), "wbx");
  }
  if (file_ == nullptr) {
    const int error_number = errno;
    temporary_.clear();
    fail(error_number);
  }
}

AtomicFile::~AtomicFile()
{
  if (file_ != nullptr) std::fclose(file_);
  std::error_code ignored;
  if (!temporary_.empty()) std::filesystem::remove(temporary_, ignored);
}

void AtomicFile::fail(int error_number)
{
  if (first_error_ == 0) first_error_ = error_number;
  throw OutputError(path_.string(), std::generic_category().message(error_number));
}

void AtomicFile::write(const void* bytes, std::size_t num_bytes)
{
  if (std::fwrite(bytes, 1, num_bytes, file_) != num_bytes) fail(errno);
}

void AtomicFile::seek(std::uint64_t position)
{
  if (std::fseek(file_, static_cast<long>(position), SEEK_SET) != 0) fail(errno);
}

std::uint64_t AtomicFile::position()
{
  const long position = std::ftell(file_);
  if (position < 0) fail(errno);
  return static_cast<std::uint64_t>(position);
}

void AtomicFile::commit()
{
  std::FILE* file = file_;
  file_ = nullptr;
  // Buffered bytes reach the disk here, so this is where a full disk may show first.
  if (std::fclose(file) != 0) fail(errno);
  // What OpenEXR writes in a destructor fails without a word, and then nothing is left in the buffer to fail above.
  if (first_error_ != 0) fail(first_error_);
  if (temporary_.empty()) return;
  std::error_code error;
  std::filesystem::rename(temporary_, destination_, error);
  if (error) fail(error.value());
  temporary_.clear();
}

void atomic_write(const std::filesystem::path& target, std::string_view bytes)
{
  AtomicFile file(target);
  file.write(bytes.data(), bytes.size());
  file.commit();
}

}  // namespace relief
