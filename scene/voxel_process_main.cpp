// The program relief_voxels: reads one grid of a .vdb file for the relief that started it, over the socket that is its standard
// input (voxel_messages.h). It ends when the other end is closed, or when the library crashes.
#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <new>
#include <string>
#include <system_error>
#include <vector>

#include <sys/resource.h>
#include <unistd.h>

#include "scene/openvdb_file.h"
#include "scene/voxel_messages.h"

namespace {

/// Bounds the address space, so that a size that is nonsense is refused before the machine runs out of memory, and before minutes
/// have passed: the library makes texts of any length, byte by byte, after the end of the file.
/// @param bytes  that may be taken besides what the libraries have
void address_space_bound(std::uint64_t bytes)
{
  constexpr std::uint64_t kOfLibraries = std::uint64_t{2} << 30;
  rlimit limit{};
  if (bytes > RLIM_INFINITY - kOfLibraries || ::getrlimit(RLIMIT_AS, &limit) != 0) return;
  limit.rlim_cur = std::min<rlim_t>(bytes + kOfLibraries, limit.rlim_max);
  ::setrlimit(RLIMIT_AS, &limit);
}

/// Bounds the time of the next step: of bytes that are changed the library takes some for billions of things to be read.
void time_bound(std::uint64_t file_bytes)
{
  // Of processors. 56 MB of voxels without order take a quarter of a second.
  constexpr std::uint64_t kSeconds = 5, kBytesASecond = std::uint64_t{1} << 20;
  rusage used{};
  rlimit limit{};
  if (::getrusage(RUSAGE_SELF, &used) != 0 || ::getrlimit(RLIMIT_CPU, &limit) != 0) return;
  const auto until_now = static_cast<std::uint64_t>(used.ru_utime.tv_sec + used.ru_stime.tv_sec);
  limit.rlim_cur = std::min<rlim_t>(until_now + kSeconds + file_bytes / kBytesASecond, limit.rlim_max);
  ::setrlimit(RLIMIT_CPU, &limit);
}

/// What is wrong where a step runs out of memory.
template <typename Step>
std::string attempt(const Step& step)
{
  try {
    return step();
  } catch (const std::bad_alloc&) {
    return "corrupt data, or more than there is memory for";
  }
}

void answer(const relief::VoxelLine& line, relief::VoxelFile& file)
{
  // Heads have little but what stands in the file; of grids the most that compression makes small are even bricks.
  constexpr std::uint64_t kOfHeads = std::uint64_t{256} << 20, kOfGrid = std::uint64_t{1} << 30, kMostCompressed = 512;
  relief::VoxelHeader header;
  std::uint64_t most_bytes = 0, file_bytes = 0;
  for (;;) {
    relief::VoxelRequest request{};
    line.receive(&request, sizeof request);
    time_bound(file_bytes);
    switch (request) {
      case relief::VoxelRequest::kOpen: {
        most_bytes = line.receive_number();
        const std::string name = line.receive_text(relief::kMostVoxelText);
        const std::string grid = line.receive_text(relief::kMostVoxelText);
        std::error_code unknown;
        const std::uintmax_t size = std::filesystem::file_size(name, unknown);
        file_bytes = unknown ? 0 : std::min<std::uint64_t>(size, std::uint64_t{1} << 50);
        address_space_bound(kOfHeads + file_bytes);
        time_bound(file_bytes);
        const std::string error = attempt([&] { return file.open(name, grid, header); });
        most_bytes = std::min(most_bytes, kOfGrid + kMostCompressed * file_bytes);
        line.send_text(error);
        if (error.empty()) line.send_header(header);
        break;
      }
      case relief::VoxelRequest::kTree: {
        address_space_bound(most_bytes);
        const std::string error = attempt([&] { return file.read_tree(header); });
        line.send_text(error);
        if (error.empty()) line.send_header(header);
        break;
      }
      case relief::VoxelRequest::kValues: {
        const auto num_places = static_cast<std::size_t>(line.receive_number());
        const auto num_values = static_cast<std::size_t>(line.receive_number());
        // relief has found room for as much.
        address_space_bound(most_bytes + num_places * sizeof(std::uint32_t) + num_values * sizeof(std::uint16_t));
        std::vector<std::uint32_t> bricks;
        std::unique_ptr<std::uint16_t[]> values;
        const std::string error = attempt([&] {
          bricks.resize(num_places);
          values = std::make_unique_for_overwrite<std::uint16_t[]>(num_values);
          return file.read_values(bricks.data(), values.get());
        });
        line.send_text(error);
        if (!error.empty()) break;
        line.send(bricks.data(), bricks.size() * sizeof bricks[0]);
        line.send(values.get(), num_values * sizeof values[0]);
        break;
      }
    }
  }
}

}  // namespace

int main()
{
  try {
    const std::unique_ptr<relief::VoxelFile> file = relief::openvdb_file_make();
    answer(relief::VoxelLine(STDIN_FILENO), *file);
  } catch (const relief::VoxelLineBroken&) {
  }
  // Without the end of a heap that may be broken.
  ::_exit(0);
}
