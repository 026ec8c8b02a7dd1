#include "scene/texture_cache.h"

#include <cstring>
#include <deque>
#include <vector>

#include "scene/image_io.h"
#include "scene/wide_texture.h"

namespace relief {
namespace {

constexpr int kTileSize = 64;

/// A texture as the tile cache reads it: linear halves stand for sRGB, whose codes must not be averaged.
class LinearRows final : public TileRows {
 public:
  explicit LinearRows(const TextureSource& source) : reader_(source) {}

  TexelLayout layout() const override
  {
    TexelLayout layout = reader_.layout();
    layout.format = layout.format == TexelFormat::kU8 ? TexelFormat::kU8 : TexelFormat::kHalf;
    return layout;
  }

  void read_rows(int begin, int end, unsigned char* texels) override
  {
    const TexelLayout& layout = reader_.layout();
    if (layout.format != TexelFormat::kU8Srgb) {
      reader_.read_rows(begin, end, texels);
      return;
    }
    codes_.resize(static_cast<std::size_t>(end - begin) * texel_row_bytes(layout));
    reader_.read_rows(begin, end, codes_.data());
    const auto num_channels = static_cast<std::size_t>(layout.num_channels);
    for (std::size_t i = 0; i < codes_.size(); ++i) {
      const bool is_alpha = num_channels % 2 == 0 && i % num_channels == num_channels - 1;
      const float value = is_alpha ? static_cast<float>(codes_[i]) / 255.0f : kLinearFromSrgb8[codes_[i]];
      const std::uint16_t half = half_from_float(value);
      std::memcpy(texels + i * sizeof half, &half, sizeof half);
    }
  }

 private:
  TextureReader reader_;
  std::vector<unsigned char> codes_;
};

struct CachedImage final : TileSource {
  CachedImage(const TextureSource& texture_source, TileCache& tile_cache) : source(texture_source), cache(tile_cache) {}

  std::unique_ptr<TileRows> open() const override { return std::make_unique<LinearRows>(source); }

  TextureSource source;
  TileCache& cache;
  TileImage tiles;
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
      : image_(image), level_(level), size_(image.tiles.levels[static_cast<std::size_t>(level)])
  {
  }
  ~TileCursor() { release(); }
  TileCursor(const TileCursor&) = delete;
  TileCursor& operator=(const TileCursor&) = delete;

  /// @return  valid until the next call
  const unsigned char* texel(int x, int y)
  {
    const int tile_x = x - x % size_.tile_width, tile_y = y - y % size_.tile_height;
    if (tile_x != tile_x_ || tile_y != tile_y_) {
      release();
      tile_ = image_.cache.tile(image_.tiles, level_, tile_x, tile_y);
      tile_x_ = tile_x;
      tile_y_ = tile_y;
    }
    static constexpr unsigned char kBlack[4 * sizeof(float)] = {};
    if (tile_.texels == nullptr) {
      return kBlack;
    }
    const int index = (y - tile_y) * size_.tile_width + (x - tile_x);
    return tile_.texels + static_cast<std::size_t>(index) * texel_layout_bytes(image_.tiles.layout);
  }

 private:
  void release()
  {
    if (tile_.handle != nullptr) {
      image_.cache.release(tile_.handle);
      tile_ = {};
    }
  }

  const CachedImage& image_;
  int level_;
  TileLevel size_;
  Tile tile_;
  int tile_x_ = -1, tile_y_ = -1;
};

/// How the texels of tiles are read.
template <TexelFormat kFormat, int kChannels>
struct FormatTexel {
  static TexelValue load(const unsigned char* texel) { return texel_load<kFormat, kChannels>(texel); }
  static TexelValue scale() { return texel_scale<kFormat>(); }
};
template <int kChannels>
struct WideTexel {
  static TexelValue load(const unsigned char* texel) { return texel_load_wide<kChannels>(texel); }
  static TexelValue scale() { return texel_scale<TexelFormat::kHalf>(); }
};

/// As texture_sample_level, from tiles.
template <class Texel>
TexelValue cached_sample_level(const CachedTexture& texture, int level, Vec2f uv)
{
  const TextureView& view = texture.view;
  const TileLevel& size = texture.image->tiles.levels[static_cast<std::size_t>(level)];
  TileCursor cursor(*texture.image, level);
  const auto load = [&](int x, int y) { return Texel::load(cursor.texel(x, y)); };
  if (view.filter == TexelFilter::kNearest) {
    return load(axis_nearest(uv.x, size.width, view.wrap_u), axis_nearest(uv.y, size.height, view.wrap_v));
  }
  const AxisTexels x = axis_linear(uv.x, size.width, view.wrap_u);
  const AxisTexels y = axis_linear(uv.y, size.height, view.wrap_v);
  // Named one by one: the order of arguments is not defined, and this one changes tiles least often.
  const TexelValue v00 = load(x.i0, y.i0), v01 = load(x.i0, y.i1);
  const TexelValue v11 = load(x.i1, y.i1), v10 = load(x.i1, y.i0);
  return texel_bilinear(v00, v10, v01, v11, x.t, y.t);
}

template <class Texel>
Vec4f cached_sample(const void* handle, Vec2f uv, float width)
{
  const CachedTexture& texture = *static_cast<const CachedTexture*>(handle);
  const MipSelection mip = mip_select(texture.view, width);
  TexelValue value = cached_sample_level<Texel>(texture, mip.level, uv);
  if (mip.blend > 0.0f) {
    value += mip.blend * (cached_sample_level<Texel>(texture, mip.level + 1, uv) - value);
  }
  value *= Texel::scale();
  return {value[0], value[1], value[2], value[3]};
}

TextureView::Lookup lookup_for(const TexelLayout& layout)
{
  constexpr auto kU8 = TexelFormat::kU8, kHalf = TexelFormat::kHalf;
  constexpr TextureView::Lookup kOfU8[] = {cached_sample<FormatTexel<kU8, 1>>, cached_sample<FormatTexel<kU8, 2>>,
                                           cached_sample<FormatTexel<kU8, 3>>, cached_sample<FormatTexel<kU8, 4>>};
  constexpr TextureView::Lookup kOfHalf[] = {cached_sample<FormatTexel<kHalf, 1>>, cached_sample<FormatTexel<kHalf, 2>>,
                                             cached_sample<FormatTexel<kHalf, 3>>,
                                             cached_sample<FormatTexel<kHalf, 4>>};
  constexpr TextureView::Lookup kWide[] = {cached_sample<WideTexel<1>>, cached_sample<WideTexel<2>>,
                                           cached_sample<WideTexel<3>>, cached_sample<WideTexel<4>>};
  const auto i = static_cast<std::size_t>(layout.num_channels - 1);
  return layout.format == kU8 ? kOfU8[i] : layout.is_wide ? kWide[i] : kOfHalf[i];
}

}  // namespace

struct TextureCache::Impl {
  // Deques: the cache and the views hold pointers to the elements.
  std::deque<CachedImage> images;
  std::deque<CachedTexture> textures;
  std::unique_ptr<TileCache> cache;  ///< last, so that it goes before the images
};

TextureCache::TextureCache(std::size_t budget_bytes) : impl_(std::make_unique<Impl>())
{
  impl_->cache = image_io().make_tile_cache(budget_bytes, kTileSize);
}

TextureCache::~TextureCache() = default;

std::size_t TextureCache::add(const TextureSource& source)
{
  CachedImage& image = impl_->images.emplace_back(source, *impl_->cache);
  const std::string error = impl_->cache->add(image, image.tiles);
  if (!error.empty()) {
    throw SceneError(source.scene_file, source.json_path, "an image that the tile cache can read", error);
  }
  return impl_->images.size() - 1;
}

TextureView TextureCache::view(std::size_t index, Wrap wrap_u, Wrap wrap_v, TexelFilter filter)
{
  const CachedImage& image = impl_->images[index];
  CachedTexture& texture = impl_->textures.emplace_back();
  texture.image = &image;
  TextureView& view = texture.view;
  view.width = image.tiles.layout.width;
  view.height = image.tiles.layout.height;
  view.num_levels = static_cast<int>(image.tiles.levels.size());
  view.num_channels = image.tiles.layout.num_channels;
  view.format = image.tiles.layout.format;
  view.filter = filter;
  view.wrap_u = wrap_u;
  view.wrap_v = wrap_v;
  view.lookup = lookup_for(image.tiles.layout);
  view.lookup_handle = &texture;
  return view;
}

}  // namespace relief
