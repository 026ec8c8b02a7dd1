#include "scene/voxel_process.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <new>

#include <fcntl.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "scene/companion_file.h"
#include "scene/memory.h"
#include "scene/voxel_messages.h"

namespace relief {
namespace {

class VoxelProcess final : public VoxelFile {
 public:
  VoxelProcess() = default;
  VoxelProcess(const VoxelProcess&) = delete;
  VoxelProcess& operator=(const VoxelProcess&) = delete;
  ~VoxelProcess() override { end(); }

  std::string open(const std::string& file, const std::string& grid, VoxelHeader& header) override
  {
    if (file.size() > kMostVoxelText || grid.size() > kMostVoxelText) return "a name of more than 65,536 bytes";
    if (const std::string error = start(); !error.empty()) return error;
    return ask(
        [&](const VoxelLine& line) {
          send_request(line, VoxelRequest::kOpen);
          line.send_number(memory_left());
          line.send_text(file);
          line.send_text(grid);
        },
        [&](const VoxelLine& line) { line.receive_header(header); });
  }

  std::string read_tree(VoxelHeader& header) override
  {
    return ask([](const VoxelLine& line) { send_request(line, VoxelRequest::kTree); },
               [&](const VoxelLine& line) {
                 line.receive_header(header);
                 // What crashed memory says need not be possible.
                 constexpr std::int64_t kMost = std::int64_t{1} << 29;
                 for (int axis = 0; axis < 3; ++axis) {
                   const std::int64_t first = header.first[axis], count = header.count[axis];
                   if (first < -kMost || first > kMost || count < 0 || count > kMost) throw VoxelLineBroken{};
                 }
                 num_places_ = 1;
                 for (const std::int64_t count : header.count) num_places_ *= static_cast<std::size_t>(count);
                 num_bricks_ = header.num_bricks;
                 num_values_ =
                     static_cast<std::size_t>(num_bricks_) * kBrickVoxels * static_cast<std::size_t>(header.channels);
               });
  }

  std::string read_values(std::uint32_t* bricks, std::uint16_t* values) override
  {
    return ask(
        [&](const VoxelLine& line) {
          send_request(line, VoxelRequest::kValues);
          line.send_number(num_places_);
          line.send_number(num_values_);
        },
        [&](const VoxelLine& line) {
          line.receive(bricks, num_places_ * sizeof *bricks);
          line.receive(values, num_values_ * sizeof *values);
          const auto is_beyond = [&](std::uint32_t brick) { return brick >= num_bricks_; };
          if (std::any_of(bricks, bricks + num_places_, is_beyond)) throw VoxelLineBroken{};
        });
  }

 private:
  static void send_request(const VoxelLine& line, VoxelRequest request) { line.send(&request, sizeof request); }

  /// @return  what is wrong
  template <typename Say, typename Hear>
  std::string ask(const Say& say, const Hear& hear)
  {
    try {
      const VoxelLine line(socket_);
      say(line);
      const std::string error = line.receive_text(kMostVoxelText);
      if (!error.empty()) return error;
      hear(line);
      return {};
    } catch (const VoxelLineBroken&) {
      return end();
    }
  }

  std::string start()
  {
    constexpr const char* kName = "relief_voxels";
    std::filesystem::path program;
    for (const std::filesystem::path& path : companion_places(kName)) {
      if (::access(path.c_str(), X_OK) == 0) {
        program = path;
        break;
      }
    }
    if (program.empty()) return companion_missing(kName);
    int ends[2];
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) return std::strerror(errno);
    socket_ = ends[0];
    posix_spawn_file_actions_t actions;
    ::posix_spawn_file_actions_init(&actions);
    ::posix_spawn_file_actions_adddup2(&actions, ends[1], STDIN_FILENO);
    // What the library says before it ends is for no one.
    ::posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    ::posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
    std::string name = kName;
    char* arguments[] = {name.data(), nullptr};
    const int failed = ::posix_spawn(&process_, program.c_str(), &actions, nullptr, arguments, environ);
    ::posix_spawn_file_actions_destroy(&actions);
    ::close(ends[1]);
    if (failed == 0) return {};
    process_ = -1;
    return program.string() + " cannot be started: " + std::strerror(failed);
  }

  /// Ends the program. @return  how it had ended by itself
  std::string end()
  {
    if (socket_ >= 0) ::close(socket_);
    socket_ = -1;
    int status = 0;
    if (process_ > 0) {
      while (::waitpid(process_, &status, 0) < 0 && errno == EINTR) {
      }
    }
    process_ = -1;
    if (WIFSIGNALED(status)) {
      return std::string("truncated or corrupt data: what reads it ended by the signal \"") +
             ::strsignal(WTERMSIG(status)) + '"';
    }
    // The dynamic linker's.
    constexpr int kNoLibrary = 127;
    if (WEXITSTATUS(status) == kNoLibrary) return "relief_voxels misses a library, or memory for one (ulimit -v)";
    return "truncated or corrupt data";
  }

  int socket_ = -1;
  pid_t process_ = -1;
  std::size_t num_places_ = 0, num_values_ = 0;
  std::uint64_t num_bricks_ = 0;
};

}  // namespace

std::unique_ptr<VoxelFile> voxel_process_make() { return std::make_unique<VoxelProcess>(); }

}  // namespace relief
