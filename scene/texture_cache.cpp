#include "scene/texture_cache.h"

#include <OpenImageIO/imagecache.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <deque>
#include <mutex>
#include <vector>

namespace relief {
namespace {

constexpr int kTileSize = 64;

/// Format of the tiles of an image. Linear halves stand for sRGB, whose codes must not be averaged.
TexelFormat tile_format(const TexelLayout& layout)
{
  return layout.format == TexelFormat::kU8 ? TexelFormat::kU8 : TexelFormat::kHalf;
}

/// Presents a TextureSource to the tile cache as a scanline image with one level.
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
      reader_ = std::make_unique<TextureReader>(*static_cast<const TextureSource*>(source));
    } catch (const std::exception& e) {
      errorfmt("{}", e.what());
      return false;
    }
    const TexelLayout& layout = reader_->layout();
    const bool is_half = tile_format(layout) == TexelFormat::kHalf;
    m_spec = OIIO::ImageSpec(layout.width, layout.height, layout.num_channels,
                             is_half ? OIIO::TypeDesc::HALF : OIIO::TypeDesc::UINT8);
    spec = m_spec;
    return true;
  }

  bool close() override
  {
    reader_.reset();
    return true;
  }

  bool read_native_scanline(int subimage, int miplevel, int y, int z, void* data) override
  {
    return read_native_scanlines(subimage, miplevel, y, y + 1, z, data);
  }

  bool read_native_scanlines(int subimage, int miplevel, int begin, int end, int, void* data) override
  {
    const std::lock_guard<const OIIO::ImageInput> guard(*this);
    if (reader_ == nullptr || subimage != 0 || miplevel != 0) {
      return false;
    }
    try {
      read_rows(begin, std::min(end, m_spec.height), static_cast<unsigned char*>(data));
    } catch (const std::exception& e) {
      errorfmt("{}", e.what());
      return false;
    }
    return true;
  }

 private:
  void read_rows(int begin, int end, unsigned char* data)
  {
    const TexelLayout& layout = reader_->layout();
    if (layout.format != TexelFormat::kU8Srgb) {
      reader_->read_rows(begin, end, data);
      return;
    }
    codes_.resize(static_cast<std::size_t>(end - begin) * texel_row_bytes(layout));
    reader_->read_rows(begin, end, codes_.data());
    const auto num_channels = static_cast<std::size_t>(layout.num_channels);
    for (std::size_t i = 0; i < codes_.size(); ++i) {
      const bool is_alpha = num_channels % 2 == 0 && i % num_channels == num_channels - 1;
      const float value = is_alpha ? static_cast<float>(codes_[i]) / 255.0f : kLinearFromSrgb8[codes_[i]];
      const std::uint16_t half = half_from_float(value);
      std::memcpy(data + i * sizeof half, &half, sizeof half);
    }
  }

  std::unique_ptr<TextureReader> reader_;
  std::vector<unsigned char> codes_;
};

struct LevelTiles {
  int width = 0, height = 0, tile_width = 0, tile_height = 0;
};

struct CachedImage {
  TextureSource source;
  OIIO::ImageCache* cache = nullptr;
  OIIO::ImageCache::ImageHandle* handle = nullptr;
  TexelLayout layout;  ///< of the tiles
  std::vector<LevelTiles> levels;
};

/// What a look-up function is handed: an image and a sampler (in `view`, whose look-up this is).
struct CachedTexture {
  const CachedImage* image = nullptr;
  TextureView view;
};

/// Texels of one level; holds on to one tile at a time.
class TileCursor {
 public:
  TileCursor(const CachedImage& image, int level)
      : image_(image),
        level_(level),
        tiles_(image.levels[static_cast<std::size_t>(level)]),
        thread_(image.cache->get_perthread_info())
  {
  }
  ~TileCursor() { release(); }
  TileCursor(const TileCursor&) = delete;
  TileCursor& operator=(const TileCursor&) = delete;

  /// @return  valid until the next call
  const unsigned char* texel(int x, int y)
  {
    const int tile_x = x - x % tiles_.tile_width, tile_y = y - y % tiles_.tile_height;
    if (tile_x != tile_x_ || tile_y != tile_y_) {
      release();
      tile_ = image_.cache->get_tile(image_.handle, thread_, 0, level_, tile_x, tile_y, 0);
      OIIO::TypeDesc format;
      texels_ =
          tile_ == nullptr ? nullptr : static_cast<const unsigned char*>(image_.cache->tile_pixels(tile_, format));
      tile_x_ = tile_x;
      tile_y_ = tile_y;
    }
    static constexpr unsigned char kBlack[8] = {};
    if (texels_ == nullptr) {
      return kBlack;
    }
    const int index = (y - tile_y) * tiles_.tile_width + (x - tile_x);
    return texels_ + index * texel_bytes(image_.layout.format, image_.layout.num_channels);
  }

 private:
  void release()
  {
    if (tile_ != nullptr) {
      image_.cache->release_tile(tile_);
      tile_ = nullptr;
    }
  }

  const CachedImage& image_;
  int level_;
  LevelTiles tiles_;
  OIIO::ImageCache::Perthread* thread_;
  OIIO::ImageCache::Tile* tile_ = nullptr;
  const unsigned char* texels_ = nullptr;
  int tile_x_ = -1, tile_y_ = -1;
};

/// As texture_sample_level, from tiles.
template <TexelFormat kFormat, int kChannels>
TexelValue cached_sample_level(const CachedTexture& texture, int level, Vec2f uv)
{
  const TextureView& view = texture.view;
  const LevelTiles& tiles = texture.image->levels[static_cast<std::size_t>(level)];
  TileCursor cursor(*texture.image, level);
  const auto load = [&](int x, int y) { return texel_load<kFormat, kChannels>(cursor.texel(x, y)); };
  if (view.filter == TexelFilter::kNearest) {
    return load(axis_nearest(uv.x, tiles.width, view.wrap_u), axis_nearest(uv.y, tiles.height, view.wrap_v));
  }
  const AxisTexels x = axis_linear(uv.x, tiles.width, view.wrap_u);
  const AxisTexels y = axis_linear(uv.y, tiles.height, view.wrap_v);
  // Named one by one: the order of arguments is not defined, and this one changes tiles least often.
  const TexelValue v00 = load(x.i0, y.i0), v01 = load(x.i0, y.i1);
  const TexelValue v11 = load(x.i1, y.i1), v10 = load(x.i1, y.i0);
  return texel_bilinear(v00, v10, v01, v11, x.t, y.t);
}

template <TexelFormat kFormat, int kChannels>
Vec4f cached_sample(const void* handle, Vec2f uv, float width)
{
  const CachedTexture& texture = *static_cast<const CachedTexture*>(handle);
  const MipSelection mip = mip_select(texture.view, width);
  TexelValue value = cached_sample_level<kFormat, kChannels>(texture, mip.level, uv);
  if (mip.blend > 0.0f) {
    value += mip.blend * (cached_sample_level<kFormat, kChannels>(texture, mip.level + 1, uv) - value);
  }
  value *= texel_scale<kFormat>();
  return {value[0], value[1], value[2], value[3]};
}

TextureView::Lookup lookup_for(const TexelLayout& layout)
{
  constexpr TextureView::Lookup kU8[] = {cached_sample<TexelFormat::kU8, 1>, cached_sample<TexelFormat::kU8, 2>,
                                         cached_sample<TexelFormat::kU8, 3>, cached_sample<TexelFormat::kU8, 4>};
  constexpr TextureView::Lookup kHalf[] = {cached_sample<TexelFormat::kHalf, 1>, cached_sample<TexelFormat::kHalf, 2>,
                                           cached_sample<TexelFormat::kHalf, 3>, cached_sample<TexelFormat::kHalf, 4>};
  const auto i = static_cast<std::size_t>(layout.num_channels - 1);
  return layout.format == TexelFormat::kU8 ? kU8[i] : kHalf[i];
}

[[noreturn]] void fail(const TextureSource& source, const std::string& cause)
{
  throw SceneError(source.scene_file, source.json_path, "an image that the tile cache can read", cause);
}

}  // namespace

struct TextureCache::Impl {
  OIIO::ImageCache* cache = nullptr;
  // Deques: the cache and the views hold pointers to the elements.
  std::deque<CachedImage> images;
  std::deque<CachedTexture> textures;
};

TextureCache::TextureCache(std::size_t budget_bytes) : impl_(std::make_unique<Impl>())
{
  impl_->cache = OIIO::ImageCache::create(false);
  OIIO::ImageCache& cache = *impl_->cache;
  cache.attribute("max_memory_MB", static_cast<float>(budget_bytes) / (1024.0f * 1024.0f));
  cache.attribute("autotile", kTileSize);
  cache.attribute("automip", 1);
  // Equal images were joined before they came here.
  cache.attribute("deduplicate", 0);
}

TextureCache::~TextureCache() { OIIO::ImageCache::destroy(impl_->cache, true); }

std::size_t TextureCache::add(const TextureSource& source)
{
  CachedImage& image = impl_->images.emplace_back();
  image.source = source;
  image.cache = impl_->cache;
  const std::size_t index = impl_->images.size() - 1;
  OIIO::ImageCache& cache = *impl_->cache;
  OIIO::ImageSpec config;
  const void* pointer = &image.source;
  config.attribute(SourceInput::kSourceAttribute, OIIO::TypeDesc(OIIO::TypeDesc::PTR), &pointer);
  const OIIO::ustring name(OIIO::Strutil::fmt::format("relief:{}", static_cast<const void*>(&image)));
  if (!cache.add_file(name, SourceInput::create, &config, true)) {
    fail(source, cache.geterror());
  }
  image.handle = cache.get_image_handle(name);
  int num_levels = 0;
  if (image.handle == nullptr ||
      !cache.get_image_info(image.handle, nullptr, 0, 0, OIIO::ustring("miplevels"), OIIO::TypeInt, &num_levels)) {
    fail(source, cache.geterror());
  }
  for (int level = 0; level < std::min(num_levels, kMaxMipLevels); ++level) {
    const OIIO::ImageSpec* spec = cache.imagespec(image.handle, nullptr, 0, level);
    if (spec == nullptr) {
      fail(source, cache.geterror());
    }
    image.levels.push_back({spec->width, spec->height, spec->tile_width, spec->tile_height});
    if (level == 0) {
      const bool is_u8 = spec->format == OIIO::TypeDesc::UINT8;
      image.layout = {spec->width, spec->height, spec->nchannels, is_u8 ? TexelFormat::kU8 : TexelFormat::kHalf};
    }
  }
  return index;
}

TextureView TextureCache::view(std::size_t index, Wrap wrap_u, Wrap wrap_v, TexelFilter filter)
{
  const CachedImage& image = impl_->images[index];
  CachedTexture& texture = impl_->textures.emplace_back();
  texture.image = &image;
  TextureView& view = texture.view;
  view.width = image.layout.width;
  view.height = image.layout.height;
  view.num_levels = static_cast<int>(image.levels.size());
  view.num_channels = image.layout.num_channels;
  view.format = image.layout.format;
  view.filter = filter;
  view.wrap_u = wrap_u;
  view.wrap_v = wrap_v;
  view.lookup = lookup_for(image.layout);
  view.lookup_handle = &texture;
  return view;
}

}  // namespace relief
