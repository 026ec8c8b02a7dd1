#include "scene/reading_root.h"

#include <algorithm>

namespace relief {

namespace fs = std::filesystem;

namespace {

fs::path& root()
{
  static fs::path folder;
  return folder;
}

}  // namespace

bool reading_root_set(const fs::path& folder)
{
  std::error_code error;
  fs::path canonical = fs::canonical(folder, error);
  if (error || !fs::is_directory(canonical, error)) return false;
  root() = std::move(canonical);
  return true;
}

const fs::path& reading_root() { return root(); }

bool reading_is_allowed(const fs::path& path)
{
  if (root().empty()) return true;
  std::error_code error;
  const fs::path canonical = fs::canonical(path, error);
  if (error) return false;
  return std::mismatch(root().begin(), root().end(), canonical.begin(), canonical.end()).first == root().end();
}

}  // namespace relief
