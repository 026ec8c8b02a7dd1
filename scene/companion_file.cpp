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

std::vector<std::filesystem::path> companion_places(const std::string& name, const std::string& built)
{
  const std::filesystem::path folder = program_folder();
  return {folder / name, folder.parent_path() / "lib/relief" / name, built};
}

std::string companion_missing(const std::string& name)
{
  return name + " is neither in " + program_folder().string() + " nor in ../lib/relief";
}

}  // namespace relief
