// What relief needs of OpenImageIO, behind an interface without its types. The library brings along 245 others, whose
// linking takes a quarter of a second of processor time and 100 MiB; so it is in a module of its own, image_io_module.cpp,
// which image_io.cpp loads when the first image is opened that is neither PNG, JPEG, HDR nor EXR (png_file.h, jpeg_file.h,
// hdr_file.h, exr_file.h). What images are read for is in image_reader.h and texture_cache.h.
//
// Between program and module errors are texts, and exceptions go by std::exception alone: of relief's own types, and of
// templates in them, each side has its own.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "scene/mip_chain.h"

namespace relief {

/// How values of an image are handed over: integers scaled to the type, or to 0…1 for floats.
enum class SampleType { kU8, kU16, kFloat };

/// Bytes of a sample.
constexpr std::size_t sample_bytes(SampleType type)
{
  return type == SampleType::kU8 ? 1 : type == SampleType::kU16 ? 2 : 4;
}

/// What an image says of itself; nothing is checked.
struct ImageHeader {
  int width = 0, height = 0, depth = 0, num_channels = 0;
  int tile_width = 0, tile_height = 0;          ///< 0: stored by rows, not by tiles
  int strip_height = 0;                         ///< rows that are stored together; 0: not known
  SampleType sample_type = SampleType::kFloat;  ///< kU8 and kU16 where the image has them; kFloat for everything else
  int sample_bits = 0;
  bool is_integer = false, is_deep = false;
  std::vector<std::string> channel_names;
  int alpha_channel = -1;          ///< -1: none
  bool alpha_is_straight = false;  ///< colours are not multiplied by it
  std::string format_name;         ///< OpenImageIO's

  /// Index of the channel of this name; -1: none.
  int channel_index(std::string_view name) const;
};

/// An image of one format. Not for use by several threads at once.
class ImageFile {
 public:
  virtual ~ImageFile() = default;

  /// Whether `open` can be given bytes.
  virtual bool can_be_embedded() const = 0;

  /// Reads the header. Called once.
  /// @param name     of the file; with bytes only for messages
  /// @param encoded  the file's bytes, which must outlive this; empty: read from the file
  /// @return         what is wrong; empty: nothing
  virtual std::string open(const std::string& name, std::span<const unsigned char> encoded, ImageHeader& header) = 0;

  /// Reads some rows of some channels, tightly packed. Of a tiled image they must be whole rows of tiles.
  /// @return  what is wrong; empty: nothing
  virtual std::string read_rows(int row_begin,
                                int row_end,
                                int channel_begin,
                                int channel_end,
                                SampleType type,
                                unsigned char* rows) = 0;
};

/// Rows of an open image, for the tile cache. Not used by several threads at once.
class TileRows {
 public:
  virtual ~TileRows() = default;
  /// Format kU8 or kHalf; wide, too.
  virtual TexelLayout layout() const = 0;
  /// Gives rows [begin, end), tightly packed. @error std::exception
  virtual void read_rows(int begin, int end, unsigned char* texels) = 0;
};

/// Where the tile cache gets an image from. It opens it when it needs rows, perhaps more than once.
class TileSource {
 public:
  virtual ~TileSource() = default;
  /// @error std::exception
  virtual std::unique_ptr<TileRows> open() const = 0;
};

struct TileLevel {
  int width = 0, height = 0, tile_width = 0, tile_height = 0;
};

/// An image in the tile cache.
struct TileImage {
  void* handle = nullptr;  ///< the cache's own
  TexelLayout layout;
  std::vector<TileLevel> levels;
};

/// A tile that is held.
struct Tile {
  void* handle = nullptr;                 ///< the cache's own; null: the tile could not be read
  const unsigned char* texels = nullptr;  ///< rows of tile_width; null: as above
};

/// Tiles of images and of their mip levels, within a bound on memory. `tile` and `release` may be called by any thread.
class TileCache {
 public:
  virtual ~TileCache() = default;

  /// @param source  must outlive the cache
  /// @return        what is wrong; empty: nothing
  virtual std::string add(const TileSource& source, TileImage& image) = 0;

  /// Reads a tile unless it is there, and holds it.
  /// @param x, y  its first texel
  virtual Tile tile(const TileImage& image, int level, int x, int y) = 0;

  /// @param tile  not null
  virtual void release(void* tile) = 0;
};

/// What the module gives.
struct ImageIo {
  /// @param format  OpenImageIO's name of it (image_format.h)
  /// @return        null: no such format is known
  std::unique_ptr<ImageFile> (*make_file)(const std::string& format);

  std::unique_ptr<TileCache> (*make_tile_cache)(std::size_t budget_bytes, int tile_size);
};

/// The module, loaded when first asked for and never unloaded. Any thread may ask.
/// @error std::runtime_error: it is not there, or a library that it needs is not
const ImageIo& image_io();

/// Whether its file is there; it is not loaded.
bool image_io_is_there();

}  // namespace relief
