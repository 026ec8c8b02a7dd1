// What all writers of OpenEXR files share: a file that appears whole or not at all, a part's header, a film's channels, and rows
// that are packed a block at a time.
#pragma once

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <functional>
#include <vector>

#include "exporters/exr.h"

namespace relief {

/// Rows handled at once. A multiple of every compression's block (1, 16, 32, 256 rows), so that no block is compressed
/// twice or decompressed twice, and enough of them to keep a few threads busy.
inline constexpr int kRowsAtOnce = 256;

/// A hostile header is refused before anything of its size is allocated: sides of real pictures are smaller.
inline constexpr int kMaxSide = 1 << 17;

/// A part's windows, pixels.
struct ExrWindows {
  int width = 0, height = 0, crop_x = 0, crop_y = 0, full_width = 0, full_height = 0;
};
ExrWindows exr_windows(const FilmView& film);

/// The channels of a film with the types that they are stored by.
std::vector<ChannelView> exr_film_channels(const FilmView& film, const ExrOptions& options);

/// How a channel's type is called by OpenEXR, and what a value takes.
Imf::PixelType exr_pixel_type(ChannelType type);
std::size_t exr_value_bytes(ChannelType type);

Imf::Header exr_header_make(const ExrWindows& windows,
                            const std::vector<ChannelView>& channels,
                            const Attributes& attributes,
                            ExrCompression compression,
                            ColorSpace space = ColorSpace::kRec709);

/// What OpenEXR allocates to read a file: tables of all parts, and what it decodes of the first.
/// @error InputError: the file ends before its header does
std::uint64_t exr_decoder_bytes(const std::string& file);

/// Chooses the machine's number of threads unless exr_use_threads has.
void exr_threads_choose();

/// Writes a file that appears whole or not at all.
/// @param write  makes an output of OpenEXR's on the stream, and lets it go
/// @error OutputError, OutOfMemory
void exr_file_write(const std::filesystem::path& path, const std::function<void(Imf::OStream&)>& write);

/// Packs a row of a channel as the file has it.
void exr_row_pack(const ChannelView& channel, int width, int y, char* packed);

/// Likewise of a component of colours that are converted.
/// @param rgb      red, green and blue of its layer
/// @param weights  what each adds to it
void exr_row_pack(const ChannelView& channel,
                  const std::array<const ChannelView*, 3>& rgb,
                  const std::array<double, 3>& weights,
                  int width,
                  int y,
                  char* packed);

/// Red, green and blue of the layer that a channel is a component of. @return nulls if it is not the component of a colour
std::array<const ChannelView*, 3> exr_colors_of(const ChannelView& channel, const std::vector<ChannelView>& channels);

/// Packs and writes the rows, a block at a time, so that a film is never held twice.
/// @param output  Imf::OutputFile, or Imf::OutputPart
/// @param space   that colours are converted to
template <class Output>
void exr_rows_write(Output& output,
                    const ExrWindows& windows,
                    const std::vector<ChannelView>& channels,
                    ColorSpace space = ColorSpace::kRec709)
{
  const ColorMatrix matrix = color_matrix(ColorSpace::kRec709, space);
  std::vector<std::array<const ChannelView*, 3>> colors(channels.size());
  if (space != ColorSpace::kRec709) {
    std::transform(channels.begin(), channels.end(), colors.begin(),
                   [&](const ChannelView& channel) { return exr_colors_of(channel, channels); });
  }
  const std::size_t width = static_cast<std::size_t>(windows.width);
  // A picture may have fewer rows, and channels by the dozen.
  const int rows_at_once = std::min(kRowsAtOnce, windows.height);
  std::vector<std::vector<char>> packed;
  packed.reserve(channels.size());
  for (const ChannelView& channel : channels) {
    packed.emplace_back(width * static_cast<std::size_t>(rows_at_once) * exr_value_bytes(channel.type));
  }
  for (int y0 = 0; y0 < windows.height; y0 += rows_at_once) {
    const int num_rows = std::min(rows_at_once, windows.height - y0);
    Imf::FrameBuffer buffer;
    for (std::size_t c = 0; c < channels.size(); ++c) {
      const std::size_t pixel_bytes = exr_value_bytes(channels[c].type), row_bytes = pixel_bytes * width;
      for (int row = 0; row < num_rows; ++row) {
        char* const target = packed[c].data() + row_bytes * static_cast<std::size_t>(row);
        if (colors[c][0] != nullptr) {
          const std::size_t component = *color_component(channels[c].name);
          exr_row_pack(channels[c], colors[c], matrix[component], windows.width, y0 + row, target);
        } else {
          exr_row_pack(channels[c], windows.width, y0 + row, target);
        }
      }
      buffer.insert(channels[c].name, Imf::Slice::Make(exr_pixel_type(channels[c].type), packed[c].data(),
                                                       Imath::V2i(windows.crop_x, windows.crop_y + y0), windows.width,
                                                       num_rows, pixel_bytes, row_bytes));
    }
    output.setFrameBuffer(buffer);
    output.writePixels(num_rows);
  }
}

}  // namespace relief
