#include "scene/image_io.h"

#include <algorithm>
#include <filesystem>
#include <stdexcept>
#include <thread>
#include <vector>

#include <dlfcn.h>
#include <sys/mman.h>

#include "scene/companion_file.h"
#include "scene/memory.h"

namespace relief {
namespace {

// The number counts changes of the interface: an old program that was copied away does not call into a newer build.
constexpr const char* kEntryPoint = "relief_image_io_5";
constexpr const char* kModule = RELIEF_IMAGE_IO_MODULE;

/// Makes sure of the address space that linking needs, where a shell bounds it (ulimit -v). Without it some of the 245
/// libraries abort in their initialization, or wait for ever for threads that could not be started.
/// @error OutOfMemory
void address_space_require()
{
  // 565 MiB were measured on two processors: code, data, and what threads reserve that libraries start.
  const std::size_t bytes = (std::size_t{480} << 20) + std::thread::hardware_concurrency() * (std::size_t{80} << 20);
  void* room = ::mmap(nullptr, bytes, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (room == MAP_FAILED) {
    throw OutOfMemory("the module that reads images needs " + memory_text(bytes) + " of address space (ulimit -v)");
  }
  ::munmap(room, bytes);
}

const ImageIo& module_load()
{
  address_space_require();
  std::string cause = companion_missing(kModule);
  bool is_there = false;
  for (const std::filesystem::path& path : companion_places(kModule)) {
    // Lazily, as at a program's start: looking up every function of 245 libraries takes another 20 ms.
    void* module = ::dlopen(path.c_str(), RTLD_LAZY | RTLD_LOCAL);
    const void* entry = module == nullptr ? nullptr : ::dlsym(module, kEntryPoint);
    if (entry != nullptr) {
      return *static_cast<const ImageIo*>(entry);
    }
    // What is wrong with the first that is there, mostly a library that it needs.
    const std::string text = module == nullptr ? ::dlerror() : path.string() + " is of another version of relief";
    std::error_code error;
    if (!is_there && std::filesystem::exists(path, error)) {
      cause = text;
      is_there = true;
    }
  }
  throw std::runtime_error("the module for images other than PNG, JPEG, HDR and EXR cannot be loaded: " + cause);
}

}  // namespace

int ImageHeader::channel_index(std::string_view name) const
{
  const auto found = std::find(channel_names.begin(), channel_names.end(), name);
  return found == channel_names.end() ? -1 : static_cast<int>(found - channel_names.begin());
}

bool image_io_is_there()
{
  const std::vector<std::filesystem::path> places = companion_places(kModule);
  return std::any_of(places.begin(), places.end(), [](const std::filesystem::path& path) {
    std::error_code unreadable;
    return std::filesystem::exists(path, unreadable);
  });
}

const ImageIo& image_io()
{
  static const ImageIo& module = module_load();
  return module;
}

}  // namespace relief
