#include "scene/voxel_messages.h"

#include <cerrno>
#include <limits>

#include <sys/socket.h>

namespace relief {
namespace {

/// Most of the grids that a file has are named.
constexpr std::size_t kMostNamedGrids = 256;

template <typename Header, typename Pass>
void pass_numbers(Header& header, const Pass& pass)
{
  pass(header.is_known);
  pass(header.num_voxels);
  pass(header.channels);
  pass(header.object_from_lattice);
  pass(header.first);
  pass(header.count);
  pass(header.num_bricks);
}

}  // namespace

void VoxelLine::send(const void* bytes, std::size_t count) const
{
  const auto* at = static_cast<const char*>(bytes);
  while (count > 0) {
    // Without the signal that ends a program whose reader is gone.
    const ssize_t sent = ::send(socket_, at, count, MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) continue;
    if (sent <= 0) throw VoxelLineBroken{};
    at += sent;
    count -= static_cast<std::size_t>(sent);
  }
}

void VoxelLine::receive(void* bytes, std::size_t count) const
{
  auto* at = static_cast<char*>(bytes);
  while (count > 0) {
    const ssize_t got = ::recv(socket_, at, count, 0);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) throw VoxelLineBroken{};
    at += got;
    count -= static_cast<std::size_t>(got);
  }
}

std::uint64_t VoxelLine::receive_number() const
{
  std::uint64_t number = 0;
  receive(&number, sizeof number);
  return number;
}

void VoxelLine::send_text(const std::string& text) const
{
  const std::size_t size = text.size() < kMostVoxelText ? text.size() : kMostVoxelText;
  send_number(size);
  send(text.data(), size);
}

std::string VoxelLine::receive_text(std::size_t most) const
{
  const std::uint64_t size = receive_number();
  if (size > most) throw VoxelLineBroken{};
  std::string text(static_cast<std::size_t>(size), '\0');
  receive(text.data(), text.size());
  return text;
}

void VoxelLine::send_header(const VoxelHeader& header) const
{
  pass_numbers(header, [this](const auto& number) { send(&number, sizeof number); });
  const std::size_t num_grids = header.grids.size() < kMostNamedGrids ? header.grids.size() : kMostNamedGrids;
  send_number(num_grids);
  for (std::size_t i = 0; i < num_grids; ++i) send_text(header.grids[i]);
}

void VoxelLine::receive_header(VoxelHeader& header) const
{
  pass_numbers(header, [this](auto& number) { receive(&number, sizeof number); });
  const std::uint64_t num_grids = receive_number();
  // 1 or 3 numbers a voxel are all there is.
  if (num_grids > kMostNamedGrids || (header.channels != 1 && header.channels != 3)) throw VoxelLineBroken{};
  header.grids.clear();
  for (std::uint64_t i = 0; i < num_grids; ++i) header.grids.push_back(receive_text(kMostVoxelText));
}

}  // namespace relief
