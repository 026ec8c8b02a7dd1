#include "scene/companion_file.h"

#include <system_error>

namespace relief {
namespace {

std::filesystem::path program_folder()
{
  std::error_code no_proc;
  return std::filesystem::read_symlink("/proc/self/exe", no_proc).parent_path();
}

}  // namespace

std::vector<std::filesystem::path> companion_places(const std::string& name)
{
  namespace fs = std::filesystem;
  const fs::path folder = program_folder();
  std::vector<fs::path> places{folder / name, folder.parent_path() / "lib/relief" / name};
  for (fs::path above = folder; above.has_relative_path(); above = above.parent_path()) {
    std::error_code unreadable;
    if (!fs::exists(above / "CMakeCache.txt", unreadable)) continue;
    places.push_back(above / "cli" / name);
    break;
  }
  return places;
}

std::string companion_missing(const std::string& name)
{
  return name + " is neither in " + program_folder().string() + " nor in ../lib/relief";
}

}  // namespace relief
