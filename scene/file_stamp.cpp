#include "scene/file_stamp.h"

#include <algorithm>

#include <sys/stat.h>

namespace relief {

FileStamp file_stamp(const std::filesystem::path& path)
{
  FileStamp stamp;
  stamp.path = path.string();
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return stamp;
  const auto nanoseconds = [](const timespec& time) {
    return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
  };
  stamp.device = status.st_dev;
  stamp.inode = status.st_ino;
  stamp.bytes = static_cast<std::uint64_t>(status.st_size);
  stamp.modified_ns = nanoseconds(status.st_mtim);
  stamp.changed_ns = nanoseconds(status.st_ctim);
  return stamp;
}

std::vector<std::string> files_changed(const std::vector<FileStamp>& stamps)
{
  std::vector<std::string> changed;
  for (const FileStamp& stamp : stamps) {
    if (file_stamp(stamp.path) != stamp) changed.push_back(stamp.path);
  }
  std::sort(changed.begin(), changed.end());
  changed.erase(std::unique(changed.begin(), changed.end()), changed.end());
  return changed;
}

}  // namespace relief
