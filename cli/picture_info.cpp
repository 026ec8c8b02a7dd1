#include "cli/picture_info.h"

#include <array>
#include <filesystem>
#include <fstream>
#include <system_error>

#include <fmt/format.h>

#include "cli/exit_code.h"
#include "cli/standard_streams.h"
#include "exporters/exr.h"

namespace relief {

namespace {

const char* type_name(ChannelType type)
{
  return type == ChannelType::kUint ? "32-bit integer" : type == ChannelType::kHalf ? "half" : "float";
}

}  // namespace

bool is_exr_file(const std::string& file)
{
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) return false;  // a pipe is not read twice
  constexpr std::array<char, 4> kMagic = {0x76, 0x2f, 0x31, 0x01};
  std::array<char, 4> begin = {};
  std::ifstream(file, std::ios::binary).read(begin.data(), begin.size());
  return begin == kMagic;
}

int picture_info(const std::string& file)
{
  const Picture picture = exr_load(file);
  print_line(fmt::format("picture: {}x{} pixels{}", picture.full_width, picture.full_height,
                         picture.lossy ? ", compressed with loss" : ""));
  if (picture.width != picture.full_width || picture.height != picture.full_height || picture.crop_x != 0 || picture.crop_y != 0) {
    print_line(fmt::format("stored: {}x{} pixels from ({}, {}) on", picture.width, picture.height, picture.crop_x, picture.crop_y));
  }
  print_line(fmt::format("channels: {}", picture.channels.size()));
  for (const Channel& channel : picture.channels) print_line(fmt::format("  {}: {}", channel.name, type_name(channel.type)));
  print_line(fmt::format("attributes: {}", picture.attributes.size()));
  for (const auto& [name, text] : picture.attributes) print_line(fmt::format("  {}: {}", name, text));
  return kDone;
}

}  // namespace relief
