// The only source that uses OpenImageIO; see image_io.h.
#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imagecache.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <exception>
#include <mutex>
#include <new>

#include "scene/image_io.h"

namespace relief {
namespace {

OIIO::TypeDesc::BASETYPE oiio_type(SampleType type)
{
  return type == SampleType::kU8    ? OIIO::TypeDesc::UINT8
         : type == SampleType::kU16 ? OIIO::TypeDesc::UINT16
                                    : OIIO::TypeDesc::FLOAT;
}

SampleType sample_type(const OIIO::TypeDesc& type)
{
  return type == OIIO::TypeDesc::UINT8    ? SampleType::kU8
         : type == OIIO::TypeDesc::UINT16 ? SampleType::kU16
                                          : SampleType::kFloat;
}

/// The library's words, if it has any.
std::string error_or(const std::string& error, const char* otherwise) { return error.empty() ? otherwise : error; }

/// Held while OpenImageIO reads a header, of whatever format. Its readers share tables that grow as they are asked: those of
/// decode_icc_profile (2.4) gain an entry for each word that they do not know, so that no first call fills them for good.
std::mutex& header_mutex()
{
  static std::mutex mutex;
  return mutex;
}

class OiioFile final : public ImageFile {
 public:
  explicit OiioFile(std::unique_ptr<OIIO::ImageInput> input) : input_(std::move(input)) {}

  bool can_be_embedded() const override { return input_->supports("ioproxy") != 0; }

  std::string open(const std::string& name, std::span<const unsigned char> encoded, ImageHeader& header) override
  {
    OIIO::ImageSpec config;
    config.attribute("oiio:UnassociatedAlpha", 1);
    const std::lock_guard guard(header_mutex());
    try {
      if (!encoded.empty()) {
        memory_ = std::make_unique<OIIO::Filesystem::IOMemReader>(encoded.data(), encoded.size());
        input_->set_ioproxy(memory_.get());
      }
      if (!input_->open(name, spec_, config)) {
        return error_or(input_->geterror(), "cannot be opened");
      }
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception& e) {
      return e.what();
    }
    header = {spec_.width,
              spec_.height,
              spec_.depth,
              spec_.nchannels,
              spec_.tile_height > 0 ? spec_.tile_width : 0,
              spec_.tile_width > 0 ? spec_.tile_height : 0,
              spec_.get_int_attribute("tiff:RowsPerStrip"),
              sample_type(spec_.format),
              static_cast<int>(spec_.format.size()) * 8,
              !spec_.format.is_floating_point(),
              spec_.deep,
              spec_.channelnames,
              spec_.alpha_channel,
              alpha_is_straight(),
              input_->format_name()};
    return {};
  }

  std::string read_rows(int row_begin,
                        int row_end,
                        int channel_begin,
                        int channel_end,
                        SampleType type,
                        unsigned char* rows) override
  {
    const bool tiled = spec_.tile_width > 0 && spec_.tile_height > 0;
    const int y0 = spec_.y + row_begin, y1 = spec_.y + row_end;
    // Decoders that only go forward open the file anew for a row that they have passed.
    std::unique_lock guard(header_mutex(), std::defer_lock);
    if (row_begin < next_row_) guard.lock();
    next_row_ = row_end;
    try {
      const bool ok =
          tiled ? input_->read_tiles(0, 0, spec_.x, spec_.x + spec_.width, y0, y1, spec_.z, spec_.z + 1, channel_begin,
                                     channel_end, oiio_type(type), rows)
                : input_->read_scanlines(0, 0, y0, y1, spec_.z, channel_begin, channel_end, oiio_type(type), rows);
      return ok && !input_->has_error() ? std::string() : error_or(input_->geterror(), "truncated or corrupt data");
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception& e) {
      return e.what();
    }
  }

 private:
  bool alpha_is_straight() const
  {
    if (spec_.alpha_channel < 0) return false;
    // A TGA of old says nothing: it is straight, as in Blender, unless marked otherwise.
    constexpr int kAssociated = 4;
    if (input_->format_name() == std::string_view("targa")) {
      return spec_.get_int_attribute("targa:alpha_type", -1) != kAssociated;
    }
    return spec_.get_int_attribute("oiio:UnassociatedAlpha") != 0;
  }

  std::unique_ptr<OIIO::Filesystem::IOMemReader> memory_;
  std::unique_ptr<OIIO::ImageInput> input_;
  OIIO::ImageSpec spec_;
  int next_row_ = 0;  ///< after those that were read last
};

std::unique_ptr<ImageFile> file_make(const std::string& format)
{
  std::unique_ptr<OIIO::ImageInput> input = OIIO::ImageInput::create(format);
  if (input == nullptr) {
    // Fetched so that it is not taken for a later one.
    OIIO::geterror();
    return nullptr;
  }
  return std::make_unique<OiioFile>(std::move(input));
}

/// Presents a TileSource to OpenImageIO's cache as a scanline image with one level.
class SourceInput final : public OIIO::ImageInput {
 public:
  static constexpr const char* kSourceAttribute = "relief:source";
  static OIIO::ImageInput* create() { return new SourceInput; }

  const char* format_name() const override { return "relief"; }

  bool open(const std::string&, OIIO::ImageSpec&) override { return false; }

  bool open(const std::string&, OIIO::ImageSpec& spec, const OIIO::ImageSpec& config) override
  {
    const void* source = nullptr;
    if (!config.getattribute(kSourceAttribute, OIIO::TypeDesc(OIIO::TypeDesc::PTR), &source)) {
      return false;
    }
    try {
      rows_ = static_cast<const TileSource*>(source)->open();
    } catch (const std::exception& e) {
      errorfmt("{}", e.what());
      return false;
    }
    const TexelLayout layout = rows_->layout();
    m_spec = OIIO::ImageSpec(layout.width, layout.height, layout.num_channels,
                             layout.format == TexelFormat::kU8 ? OIIO::TypeDesc::UINT8
                             : layout.is_wide                  ? OIIO::TypeDesc::FLOAT
                                                               : OIIO::TypeDesc::HALF);
    spec = m_spec;
    return true;
  }

  bool close() override
  {
    rows_.reset();
    return true;
  }

  bool read_native_scanline(int subimage, int miplevel, int y, int z, void* data) override
  {
    return read_native_scanlines(subimage, miplevel, y, y + 1, z, data);
  }

  bool read_native_scanlines(int subimage, int miplevel, int begin, int end, int, void* data) override
  {
    const std::lock_guard<const OIIO::ImageInput> guard(*this);
    if (rows_ == nullptr || subimage != 0 || miplevel != 0) {
      return false;
    }
    try {
      rows_->read_rows(begin, std::min(end, m_spec.height), static_cast<unsigned char*>(data));
    } catch (const std::exception& e) {
      errorfmt("{}", e.what());
      return false;
    }
    return true;
  }

 private:
  std::unique_ptr<TileRows> rows_;
};

/// What the cache keeps of a level. OpenImageIO 3 has told it apart from what the file holds.
bool level_spec(OIIO::ImageCache& cache, OIIO::ImageCache::ImageHandle* handle, int level, OIIO::ImageSpec& spec)
{
#if OIIO_VERSION_MAJOR >= 3
  return cache.get_cache_dimensions(handle, nullptr, spec, 0, level);
#else
  const OIIO::ImageSpec* found = cache.imagespec(handle, nullptr, 0, level);
  if (found != nullptr) spec = *found;
  return found != nullptr;
#endif
}

class OiioTileCache final : public TileCache {
 public:
  OiioTileCache(std::size_t budget_bytes, int tile_size) : cache_(OIIO::ImageCache::create(false))
  {
    cache_->attribute("max_memory_MB", static_cast<float>(budget_bytes) / (1024.0f * 1024.0f));
    cache_->attribute("autotile", tile_size);
    cache_->attribute("automip", 1);
    // Equal images were joined before they came here.
    cache_->attribute("deduplicate", 0);
  }
  ~OiioTileCache() override { OIIO::ImageCache::destroy(cache_, true); }
  OiioTileCache(const OiioTileCache&) = delete;
  OiioTileCache& operator=(const OiioTileCache&) = delete;

  std::string add(const TileSource& source, TileImage& image) override
  {
    OIIO::ImageSpec config;
    const void* pointer = &source;
    config.attribute(SourceInput::kSourceAttribute, OIIO::TypeDesc(OIIO::TypeDesc::PTR), &pointer);
    const OIIO::ustring name(OIIO::Strutil::fmt::format("relief:{}", pointer));
    if (!cache_->add_file(name, SourceInput::create, &config, true)) {
      return error_or(cache_->geterror(), "no reason is known");
    }
    OIIO::ImageCache::ImageHandle* handle = cache_->get_image_handle(name);
    int num_levels = 0;
    if (handle == nullptr ||
        !cache_->get_image_info(handle, nullptr, 0, 0, OIIO::ustring("miplevels"), OIIO::TypeInt, &num_levels)) {
      return error_or(cache_->geterror(), "no reason is known");
    }
    image.handle = handle;
    for (int level = 0; level < std::min(num_levels, kMaxMipLevels); ++level) {
      OIIO::ImageSpec spec;
      if (!level_spec(*cache_, handle, level, spec)) {
        return error_or(cache_->geterror(), "no reason is known");
      }
      image.levels.push_back({spec.width, spec.height, spec.tile_width, spec.tile_height});
      if (level == 0) {
        const bool is_u8 = spec.format == OIIO::TypeDesc::UINT8;
        image.layout = {spec.width, spec.height, spec.nchannels, is_u8 ? TexelFormat::kU8 : TexelFormat::kHalf,
                        spec.format == OIIO::TypeDesc::FLOAT};
      }
    }
    return {};
  }

  Tile tile(const TileImage& image, int level, int x, int y) override
  {
    auto* handle = static_cast<OIIO::ImageCache::ImageHandle*>(image.handle);
    OIIO::ImageCache::Tile* tile = cache_->get_tile(handle, nullptr, 0, level, x, y, 0);
    OIIO::TypeDesc format;
    return {tile, tile == nullptr ? nullptr : static_cast<const unsigned char*>(cache_->tile_pixels(tile, format))};
  }

  void release(void* tile) override { cache_->release_tile(static_cast<OIIO::ImageCache::Tile*>(tile)); }

 private:
  decltype(OIIO::ImageCache::create(false)) cache_;  // a pointer, since OpenImageIO 3 a shared one
};

std::unique_ptr<TileCache> tile_cache_make(std::size_t budget_bytes, int tile_size)
{
  return std::make_unique<OiioTileCache>(budget_bytes, tile_size);
}

}  // namespace
}  // namespace relief

extern "C" const relief::ImageIo relief_image_io_5 = {relief::file_make, relief::tile_cache_make};
