// Images as bytes, made without any library: small files for scenes, and headers that promise much.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace relief::test {

/// A whole number, the most significant byte first.
inline std::string big_endian(std::uint32_t value, int num_bytes)
{
  std::string bytes;
  for (int i = num_bytes - 1; i >= 0; --i) bytes += static_cast<char>(value >> (8 * i) & 255);
  return bytes;
}

inline std::string little_endian(std::uint32_t value, int num_bytes)
{
  const std::string bytes = big_endian(value, num_bytes);
  return {bytes.rbegin(), bytes.rend()};
}

/// A grey 8-bit TGA of the first version; the name of its file has to end in .tga.
/// @param texels  rows from the top
inline std::string tga_grey(int width, int height, std::string_view texels)
{
  constexpr char kGrey = 3, kBits = 8, kTopFirst = 0x20;
  return std::string{0, 0, kGrey, 0, 0, 0, 0, 0, 0, 0, 0, 0} + little_endian(static_cast<std::uint32_t>(width), 2) +
         little_endian(static_cast<std::uint32_t>(height), 2) + std::string{kBits, kTopFirst} + std::string(texels);
}

/// A progressive JPEG with the head of one scan and no data.
inline std::string jpeg_progressive(std::uint32_t width, std::uint32_t height, int num_components)
{
  const auto n = static_cast<std::uint32_t>(num_components);
  std::string frame = std::string("\x08") + big_endian(height, 2) + big_endian(width, 2) + big_endian(n, 1);
  std::string scan = big_endian(n, 1);
  for (std::uint32_t c = 1; c <= n; ++c) {
    frame += big_endian(c, 1) + std::string("\x11\0", 2);
    scan += big_endian(c, 1) + std::string(1, '\0');
  }
  const auto segment = [](const char* marker, const std::string& content) {
    return marker + big_endian(static_cast<std::uint32_t>(content.size()) + 2, 2) + content;
  };
  const std::string codes = std::string(1, '\x01') + std::string(15, '\0') + std::string(1, '\0');
  return "\xff\xd8" + segment("\xff\xdb", std::string(1, '\0') + std::string(64, '\x01')) + segment("\xff\xc2", frame) +
         segment("\xff\xc4", std::string(1, '\0') + codes) + segment("\xff\xda", scan + std::string(3, '\0')) +
         std::string(8, '\0') + "\xff\xd9";
}

/// The head of a grey 8-bit PNG, and the end.
inline std::string png_header(std::uint32_t width, std::uint32_t height, bool is_interlaced)
{
  const auto chunk = [](const std::string& content) {
    std::uint32_t crc = 0xffffffffu;
    for (const char c : content) {
      crc ^= static_cast<unsigned char>(c);
      for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1) != 0 ? 0xedb88320u : 0u);
    }
    return big_endian(static_cast<std::uint32_t>(content.size()) - 4, 4) + content + big_endian(~crc, 4);
  };
  const std::string format = {8, 0, 0, 0, static_cast<char>(is_interlaced ? 1 : 0)};
  return "\x89PNG\r\n\x1a\n" + chunk("IHDR" + big_endian(width, 4) + big_endian(height, 4) + format) + chunk("IDAT") +
         chunk("IEND");
}

/// A grey 8-bit TIFF with one tile, of which little is there.
inline std::string tiff_tile(std::uint32_t side)
{
  struct Tag {
    std::uint32_t number, type, value;
  };
  constexpr std::uint32_t kShort = 3, kLong = 4, kDeflate = 8, kDataOffset = 200, kDataBytes = 20;
  const Tag tags[] = {{256, kLong, side},        {257, kLong, side},      {258, kShort, 8},   {259, kShort, kDeflate},
                      {262, kShort, 1},          {277, kShort, 1},        {322, kLong, side}, {323, kLong, side},
                      {324, kLong, kDataOffset}, {325, kLong, kDataBytes}};
  std::string bytes = std::string("II*\0", 4) + little_endian(8, 4) + little_endian(std::size(tags), 2);
  for (const Tag& t : tags) {
    bytes += little_endian(t.number, 2) + little_endian(t.type, 2) + little_endian(1, 4) + little_endian(t.value, 4);
  }
  bytes.resize(kDataOffset + kDataBytes, '\0');
  return bytes;
}

/// A grey TIFF of 16 bits, not compressed.
/// @param texels  rows from the top
inline std::string tiff_grey_16(int width, int height, const std::vector<std::uint16_t>& texels)
{
  struct Tag {
    std::uint32_t number, type, value;
  };
  constexpr std::uint32_t kShort = 3, kLong = 4, kDataOffset = 200;
  const auto w = static_cast<std::uint32_t>(width), h = static_cast<std::uint32_t>(height);
  const Tag tags[] = {{256, kLong, w},  {257, kLong, h},  {258, kShort, 16},
                      {259, kShort, 1}, {262, kShort, 1}, {273, kLong, kDataOffset},
                      {277, kShort, 1}, {278, kLong, h},  {279, kLong, 2 * w * h}};
  std::string bytes = std::string("II*\0", 4) + little_endian(8, 4) + little_endian(std::size(tags), 2);
  for (const Tag& t : tags) {
    bytes += little_endian(t.number, 2) + little_endian(t.type, 2) + little_endian(1, 4) + little_endian(t.value, 4);
  }
  bytes.resize(kDataOffset, '\0');
  for (const std::uint16_t texel : texels) bytes += little_endian(texel, 2);
  return bytes;
}

/// A tiled OpenEXR of one half channel.
inline std::string exr_tiles(std::uint32_t side, std::uint32_t tile)
{
  const auto attribute = [](const std::string& name, const std::string& type, const std::string& value) {
    return name + '\0' + type + '\0' + little_endian(static_cast<std::uint32_t>(value.size()), 4) + value;
  };
  const std::string window = std::string(8, '\0') + little_endian(side - 1, 4) + little_endian(side - 1, 4);
  const std::string one = std::string("\0\0\x80\x3f", 4);
  const std::string channel = std::string("Y\0", 2) + little_endian(1, 4) + std::string(4, '\0') + little_endian(1, 4) +
                              little_endian(1, 4) + std::string(1, '\0');
  return std::string("v/1\x01") + little_endian(0x202, 4) + attribute("channels", "chlist", channel) +
         attribute("compression", "compression", std::string(1, '\0')) + attribute("dataWindow", "box2i", window) +
         attribute("displayWindow", "box2i", window) + attribute("lineOrder", "lineOrder", std::string(1, '\0')) +
         attribute("pixelAspectRatio", "float", one) + attribute("screenWindowCenter", "v2f", std::string(8, '\0')) +
         attribute("screenWindowWidth", "float", one) +
         attribute("tiles", "tiledesc", little_endian(tile, 4) + little_endian(tile, 4) + std::string(1, '\0')) +
         std::string(65, '\0');
}

}  // namespace relief::test
