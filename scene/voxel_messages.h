// What relief and relief_voxels (voxel_process.h) say to one another over a socket: a request is a VoxelRequest and what goes with it,
// the answer a text that says what is wrong, and, if nothing is, what was asked for. Both are of one build; so numbers go as they are.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "scene/voxel_file.h"

namespace relief {

enum class VoxelRequest : std::uint32_t {
  kOpen,    ///< bytes that may be taken, file, grid; a header
  kTree,    ///< a header
  kValues,  ///< how many numbers of the table and how many values; these
};

/// The other end went away.
struct VoxelLineBroken {};

/// One end of the line. All its functions throw VoxelLineBroken.
class VoxelLine {
 public:
  explicit VoxelLine(int socket) : socket_(socket) {}

  void send(const void* bytes, std::size_t count) const;
  void receive(void* bytes, std::size_t count) const;

  void send_number(std::uint64_t number) const { send(&number, sizeof number); }
  std::uint64_t receive_number() const;
  void send_text(const std::string& text) const;
  /// @param most  bytes; a text that is longer counts as nonsense, and the line as broken
  std::string receive_text(std::size_t most) const;
  void send_header(const VoxelHeader& header) const;
  void receive_header(VoxelHeader& header) const;

 private:
  int socket_;
};

/// Most bytes of a file's name, of a grid's, and of an error.
inline constexpr std::size_t kMostVoxelText = 1u << 16;

}  // namespace relief
