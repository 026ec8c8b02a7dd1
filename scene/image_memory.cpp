#include "scene/image_memory.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <thread>

namespace relief {
namespace {

// Sizes are counted in double precision, in which products of what a header may say do not overflow.
std::uint64_t whole_bytes(double bytes)
{
  constexpr double kMost = 0x1p63;
  return static_cast<std::uint64_t>(std::clamp(bytes, 0.0, kMost));
}

/// Numbers at places of a file; what is not there makes the whole answer void.
class Numbers {
 public:
  explicit Numbers(ImageBytes& bytes) : bytes_(bytes) {}

  std::uint32_t little(std::uint64_t offset, std::size_t num_bytes) { return number(offset, num_bytes, false); }
  std::uint32_t big(std::uint64_t offset, std::size_t num_bytes) { return number(offset, num_bytes, true); }
  bool is_valid() const { return is_valid_; }

  /// Text up to a zero byte.
  std::string text(std::uint64_t offset)
  {
    constexpr std::size_t kLongest = 256;
    std::string out;
    for (std::uint32_t c = little(offset, 1); c != 0 && is_valid_ && out.size() < kLongest;) {
      out += static_cast<char>(c);
      c = little(offset + out.size(), 1);
    }
    return out;
  }

 private:
  std::uint32_t number(std::uint64_t offset, std::size_t num_bytes, bool is_big)
  {
    std::array<unsigned char, 4> at{};
    is_valid_ = is_valid_ && bytes_.read(offset, std::span(at).first(num_bytes));
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < num_bytes; ++i) {
      value = (value << 8) | at[is_big ? i : num_bytes - 1 - i];
    }
    return is_valid_ ? value : 0;
  }

  ImageBytes& bytes_;
  bool is_valid_ = true;
};

/// The coefficients of all blocks, if they come in several scans; else a few rows.
double jpeg_bytes(Numbers& file)
{
  constexpr std::uint32_t kStartOfScan = 0xda, kProgressive = 0xc2, kProgressiveArithmetic = 0xca;
  const auto is_frame = [](std::uint32_t marker) {
    return marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
  };
  double coefficients = 0, width = 0;
  std::uint32_t num_components = 0;
  bool is_progressive = false;
  for (std::uint64_t at = 2; file.is_valid();) {
    const std::uint32_t marker = file.big(at, 2) & 0xffu;
    if (marker == 0xff) {
      ++at;  // fill bytes
      continue;
    }
    const std::uint32_t length = file.big(at + 2, 2);
    if (is_frame(marker)) {
      const double height = file.big(at + 5, 2);
      width = file.big(at + 7, 2);
      num_components = std::min(file.big(at + 9, 1), 4u);
      is_progressive = marker == kProgressive || marker == kProgressiveArithmetic;
      double most_across = 1, most_down = 1, samples = 0;
      for (const bool sums : {false, true}) {
        for (std::uint32_t c = 0; c < num_components; ++c) {
          const std::uint32_t factors = file.big(at + 11 + 3 * c, 1);
          const double across = factors >> 4, down = factors & 15;
          most_across = std::max(most_across, across);
          most_down = std::max(most_down, down);
          samples += sums ? (width * across / most_across + 16) * (height * down / most_down + 16) : 0;
        }
      }
      constexpr double kCoefficientBytes = 2;
      coefficients = kCoefficientBytes * samples;
    } else if (marker == kStartOfScan) {
      const bool has_several_scans = is_progressive || file.big(at + 4, 1) < num_components;
      constexpr double kRows = 64, kSampleBytes = 4;
      return (has_several_scans ? coefficients : 0) + kRows * kSampleBytes * width * num_components;
    }
    at += 2 + std::max(length, 2u);
  }
  return 0;
}

double png_bytes(Numbers& file)
{
  const double width = file.big(16, 4), height = file.big(20, 4);
  const std::uint32_t depth = file.big(24, 1), color = file.big(25, 1);
  // Palettes and transparent colours become channels.
  const double num_channels = color == 0 ? 2 : color == 4 ? 2 : 4;
  const double row = width * num_channels * (depth == 16 ? 2 : 1);
  return row * (file.big(28, 1) != 0 ? height + 4 : 4);
}

double bmp_bytes(Numbers& file)
{
  constexpr std::uint32_t kOldHeaderBytes = 12;
  if (file.little(14, 4) == kOldHeaderBytes) {
    return 16.0 * file.little(18, 2);
  }
  const double width = std::abs(static_cast<std::int32_t>(file.little(18, 4)));
  const double height = std::abs(static_cast<double>(static_cast<std::int32_t>(file.little(22, 4))));
  const bool is_run_length_coded = file.little(30, 4) == 1 || file.little(30, 4) == 2;
  return width * (is_run_length_coded ? height + 16 : 16);
}

double targa_bytes(Numbers& file)
{
  const double texels = static_cast<double>(file.little(12, 2)) * file.little(14, 2);
  return 2 * texels * ((file.little(16, 1) + 7) / 8);
}

double webp_bytes(Numbers& file)
{
  const std::uint32_t kind = file.big(12, 4);
  constexpr std::uint32_t kLossy = 0x56503820, kLossless = 0x5650384c, kExtended = 0x56503858;
  double width = 0, height = 0;
  if (kind == kExtended) {
    width = 1.0 + file.little(24, 3);
    height = 1.0 + file.little(27, 3);
  } else if (kind == kLossy) {
    width = file.little(26, 2) & 0x3fffu;
    height = file.little(28, 2) & 0x3fffu;
  } else if (kind == kLossless) {
    const std::uint32_t bits = file.little(21, 4);
    width = 1 + (bits & 0x3fffu);
    height = 1 + (bits >> 14 & 0x3fffu);
  }
  // Two canvases of an animation decoder, and the picture itself.
  constexpr double kTexelBytes = 3 * 4;
  return kTexelBytes * width * height + file.little(4, 4);
}

/// What a header of OpenEXR says of a part.
struct ExrHeader {
  double width = 0, height = 0, texel_bytes = 0, tile_width = 0, tile_height = 0;
  std::uint32_t compression = 0;
  std::uint64_t end = 0;  ///< of the header

  bool is_tiled() const { return tile_width > 0 && tile_height > 0; }

  /// Rows that are compressed together: none, RLE, ZIPS, ZIP, PIZ, PXR24, B44, B44A, DWAA, DWAB.
  double chunk_rows() const
  {
    constexpr std::array<double, 10> kRows = {1, 1, 1, 16, 32, 16, 32, 32, 32, 256};
    return std::min(kRows[std::min<std::size_t>(compression, kRows.size() - 1)], height);
  }

  double num_chunks() const
  {
    return is_tiled() ? std::ceil(width / tile_width) * std::ceil(height / tile_height)
                      : std::ceil(height / std::max(chunk_rows(), 1.0));
  }
};

ExrHeader exr_header(Numbers& file, std::uint64_t at)
{
  ExrHeader header;
  while (file.is_valid()) {
    const std::string name = file.text(at);
    at += name.size() + 1;
    if (name.empty()) break;
    at += file.text(at).size() + 1;
    const std::uint64_t value = at + 4, end = value + file.little(at, 4);
    // Whoever claims more than the file has is no header: this makes the answer void.
    file.little(end, 1);
    if (name == "compression") {
      header.compression = file.little(value, 1);
    } else if (name == "dataWindow") {
      const auto side = [&](std::uint64_t first) {
        return static_cast<double>(static_cast<std::int32_t>(file.little(first + 8, 4))) -
               static_cast<std::int32_t>(file.little(first, 4)) + 1;
      };
      header.width = std::max(side(value), 0.0);
      header.height = std::max(side(value + 4), 0.0);
    } else if (name == "tiles") {
      header.tile_width = file.little(value, 4);
      header.tile_height = file.little(value + 4, 4);
    } else if (name == "channels") {
      constexpr std::uint64_t kChannelBytes = 16;
      constexpr std::uint32_t kHalf = 1;
      for (std::uint64_t channel = value; channel + kChannelBytes < end && file.is_valid();) {
        channel += file.text(channel).size() + 1;
        header.texel_bytes += file.little(channel, 4) == kHalf ? 2 : 4;
        channel += kChannelBytes;
      }
    }
    at = end;
  }
  header.end = at;
  return header;
}

/// For the first part, which is the one that is read, and the tables of all.
double openexr_bytes(Numbers& file)
{
  constexpr std::uint32_t kMagic = 20000630, kSeveralParts = 0x1000;
  if (file.little(0, 4) != kMagic) {
    return 0;
  }
  const bool has_several = (file.little(4, 4) & kSeveralParts) != 0;
  const ExrHeader header = exr_header(file, 8);
  constexpr double kOffsetBytes = 8 * 4.0 / 3;  // with those of smaller levels
  double bytes = kOffsetBytes * header.num_chunks();
  // An empty header ends the list.
  for (ExrHeader part = header; has_several && file.is_valid() && file.little(part.end, 1) != 0;) {
    part = exr_header(file, part.end);
    bytes += kOffsetBytes * part.num_chunks();
  }
  // Each thread decodes two chunks, each of which is there packed and unpacked; there are no more than the image has.
  const double most = 2 * std::max(1u, std::thread::hardware_concurrency());
  const double num_decoded = 2 * std::min(most, header.num_chunks());
  if (header.is_tiled()) {
    const double tile = header.tile_width * header.tile_height * header.texel_bytes;
    return bytes + tile * (num_decoded + 2 * std::ceil(header.width / header.tile_width));
  }
  constexpr double kTableBytes = 32;  // a row
  return bytes + kTableBytes * header.height + num_decoded * header.width * header.texel_bytes * header.chunk_rows();
}

}  // namespace

bool BytesOfFile::read(std::uint64_t offset, std::span<unsigned char> bytes)
{
  constexpr std::uint64_t kStep = 4096;
  // Steps within what is buffered stay there; seeking would read anew.
  if (offset < position_ || offset > position_ + kStep) {
    stream_.seekg(static_cast<std::streamoff>(offset));
  } else {
    stream_.ignore(static_cast<std::streamsize>(offset - position_));
  }
  stream_.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  position_ = offset + bytes.size();
  return static_cast<bool>(stream_);
}

std::optional<std::uint64_t> decoder_bytes(std::string_view reader, ImageBytes& bytes)
{
  struct Format {
    std::string_view name;
    double (*bytes)(Numbers&);
  };
  constexpr Format kFormats[] = {{"png", png_bytes}, {"jpeg", jpeg_bytes},   {"openexr", openexr_bytes},
                                 {"bmp", bmp_bytes}, {"targa", targa_bytes}, {"webp", webp_bytes}};
  const auto* format =
      std::find_if(std::begin(kFormats), std::end(kFormats), [&](const Format& f) { return f.name == reader; });
  if (format == std::end(kFormats)) {
    return 0;
  }
  Numbers numbers(bytes);
  const double size = format->bytes(numbers);
  if (!numbers.is_valid()) {
    return reader == "openexr" ? std::nullopt : std::optional<std::uint64_t>(0);
  }
  return whole_bytes(size);
}

std::uint64_t decoder_block_bytes(const ImageHeader& header)
{
  if (header.format_name != "tiff") {
    return 0;
  }
  // As the file has it, unpacked, and with channels brought together.
  constexpr double kCopies = 3;
  const double texel = static_cast<double>(header.num_channels) * std::max(header.sample_bits / 8, 1);
  if (header.tile_height > 0) {
    const double across = std::ceil(static_cast<double>(header.width) / std::max(header.tile_width, 1));
    return whole_bytes(kCopies * texel * across * header.tile_width * header.tile_height);
  }
  const double rows = header.strip_height > 0 ? std::min(header.strip_height, header.height) : header.height;
  return whole_bytes(kCopies * texel * header.width * rows);
}

}  // namespace relief
