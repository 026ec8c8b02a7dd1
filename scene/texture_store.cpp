#include "scene/texture_store.h"

#include <algorithm>
#include <cstring>
#include <new>
#include <numeric>
#include <string_view>
#include <tuple>
#include <unordered_map>

#include "scene/kept_images.h"
#include "scene/memory.h"
#include "scene/mip_chain.h"
#include "scene/parallel.h"
#include "scene/texture_cache.h"
#include "scene/texture_source.h"

namespace relief {
namespace {

/// Rows read at a time: a multiple of the usual tile sides and compression blocks.
constexpr int kBandRows = 256;

/// Tiles in use by the threads at one time must fit, whatever the budget.
constexpr std::size_t kLeastCacheBytes = std::size_t{64} << 20;

/// An image as it was read, to stay in memory.
struct TextureTexels {
  MipChain chain;
  TexelRepairs repairs;

  std::size_t bytes() const { return chain.bytes(); }
};

/// One distinct image and what became of it.
struct Image {
  TextureSource source;
  std::string label;
  std::vector<unsigned char> encoded;  ///< what source.encoded looks at
  TexelLayout layout;
  TexelRepairs repairs;
  bool cached = false;
  std::size_t cache_index = 0;
  std::shared_ptr<const TextureTexels> read;  ///< null: it is served by the cache
};

/// What messages about memory call an image.
std::string label_with_size(const Image& image)
{
  return image.label + ", " + std::to_string(image.layout.width) + " x " + std::to_string(image.layout.height) +
         " texels";
}

/// Reads all rows, in bands: to keep them, or only to know that they can be read.
/// @param destination  level 0, or null
TexelRepairs rows_load(const Image& image, unsigned char* destination)
{
  TextureReader reader(image.source);
  const std::size_t row_bytes = texel_row_bytes(image.layout);
  if (reader.layout().width != image.layout.width || reader.layout().height != image.layout.height ||
      texel_row_bytes(reader.layout()) != row_bytes) {
    throw SceneError(image.source.scene_file, image.source.json_path, "a file that stays as it is while it is read",
                     "a file that changed");
  }
  std::vector<unsigned char> scratch;
  for (int y = 0; y < image.layout.height; y += kBandRows) {
    const int end = std::min(y + kBandRows, image.layout.height);
    if (destination == nullptr) {
      scratch.resize(static_cast<std::size_t>(end - y) * row_bytes);
    }
    unsigned char* texels =
        destination == nullptr ? scratch.data() : destination + static_cast<std::size_t>(y) * row_bytes;
    reader.read_rows(y, end, texels);
  }
  return reader.repairs();
}

std::shared_ptr<const TextureTexels> image_read(const Image& image)
{
  const MemoryReservation room(mip_chain_bytes(image.layout), label_with_size(image));
  const auto out = std::make_shared<TextureTexels>(TextureTexels{MipChain(image.layout), {}});
  out->repairs = rows_load(image, out->chain.level(0));
  mip_chain_build(out->chain);
  return out;
}

void image_load(Image& image, KeptImages& kept)
{
  try {
    if (image.cached) {
      // The cache would meet damaged data only while rendering; it is found here instead.
      image.repairs = rows_load(image, nullptr);
      return;
    }
    const char* const kind = image.source.color == TextureColor::kSrgb ? "texture sRGB" : "texture linear";
    image.read = kept.get<TextureTexels>(KeptImages::key(kind, image.source), [&] { return image_read(image); });
    image.repairs = image.read->repairs;
  } catch (const OutOfMemory&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw OutOfMemory(label_with_size(image));
  }
}

/// Marks images as cached, largest first, until the others fit; ties go by order.
/// @return  bytes left to the cache
std::size_t choose_cached(std::vector<Image>& images, std::size_t budget_bytes)
{
  std::size_t resident = 0;
  for (const Image& image : images) {
    resident += mip_chain_bytes(image.layout);
  }
  if (resident <= budget_bytes) {
    return 0;
  }
  // A quarter of the budget is the cache's own.
  const std::size_t cache_bytes = std::max(kLeastCacheBytes, budget_bytes / 4);
  const std::size_t resident_budget = budget_bytes - budget_bytes / 4;
  std::vector<std::size_t> by_size(images.size());
  std::iota(by_size.begin(), by_size.end(), std::size_t{0});
  std::stable_sort(by_size.begin(), by_size.end(), [&](std::size_t a, std::size_t b) {
    return mip_chain_bytes(images[a].layout) > mip_chain_bytes(images[b].layout);
  });
  for (const std::size_t i : by_size) {
    if (resident <= resident_budget) {
      break;
    }
    images[i].cached = true;
    resident -= mip_chain_bytes(images[i].layout);
  }
  return cache_bytes;
}

void warn(const Image& image, Warnings& warnings)
{
  const TexelRepairs& repairs = image.repairs;
  if (repairs.num_non_finite > 0) {
    warnings.add(image.label + ": " + std::to_string(repairs.num_non_finite) +
                 " values were not finite and are read as 0");
  }
  if (repairs.num_clamped > 0) {
    warnings.add(image.label + ": " + std::to_string(repairs.num_clamped) +
                 " values were beyond the range of half precision and are clamped to 65504");
  }
}

TextureView resident_view(const MipChain& chain, const TextureRequest& request)
{
  const TexelLayout& layout = chain.layout();
  TextureView view;
  for (int level = 0; level < chain.num_levels(); ++level) {
    view.levels[level] = chain.level(level);
  }
  view.width = layout.width;
  view.height = layout.height;
  view.num_levels = chain.num_levels();
  view.num_channels = layout.num_channels;
  view.format = layout.format;
  view.filter = request.filter;
  view.wrap_u = request.wrap_u;
  view.wrap_v = request.wrap_v;
  return view;
}

/// Gathers the distinct images of the requests; takes the requests' encoded bytes.
class ImageGroups {
 public:
  /// @return  index into images
  std::size_t add(TextureRequest& request)
  {
    const std::string_view bytes(reinterpret_cast<const char*>(request.encoded.data()), request.encoded.size());
    const std::string file =
        request.file.empty() ? std::string() : std::filesystem::absolute(request.file).lexically_normal().string();
    const std::size_t key =
        request.file.empty() ? std::hash<std::string_view>()(bytes) : std::hash<std::string>()(file);
    const auto [begin, end] = by_key_.equal_range(key);
    for (auto entry = begin; entry != end; ++entry) {
      const Image& image = images[entry->second];
      if (image.source.color == request.color && image.source.file == file && image.encoded == request.encoded) {
        return entry->second;
      }
    }
    Image& image = images.emplace_back();
    image.encoded = std::move(request.encoded);
    image.source = {{file, {}, request.scene_file, request.json_path}, request.color};
    image.label = request.label;
    by_key_.emplace(key, images.size() - 1);
    return images.size() - 1;
  }

  std::vector<Image> images;

 private:
  std::unordered_multimap<std::size_t, std::size_t> by_key_;
};

}  // namespace

struct TextureStore::Impl {
  // The cache is destroyed before the images, whose encoded bytes it reads.
  std::vector<Image> images;
  std::unique_ptr<TextureCache> cache;
  std::vector<TextureView> views;
  std::vector<std::size_t> image_of_texture;
  std::vector<std::string> labels;
};

TextureStore::TextureStore(std::vector<TextureRequest> requests,
                           std::size_t budget_bytes,
                           Warnings& warnings,
                           KeptImages* kept)
    : impl_(std::make_unique<Impl>())
{
  KeptImages own;
  if (kept == nullptr) kept = &own;
  ImageGroups groups;
  for (TextureRequest& request : requests) {
    impl_->image_of_texture.push_back(groups.add(request));
    impl_->labels.push_back(request.label);
  }
  impl_->images = std::move(groups.images);
  std::vector<Image>& images = impl_->images;
  for_each_in_parallel(images.size(), [&](std::size_t i) {
    images[i].source.encoded = images[i].encoded;
    images[i].layout = TextureReader(images[i].source).layout();
  });
  // Where memory is short, the tile cache is better than an end. What is there already needs none.
  const auto budget =
      static_cast<std::size_t>(std::min<std::uint64_t>(budget_bytes, memory_left() / 2 + kept->bytes()));
  if (const std::size_t cache_bytes = choose_cached(images, budget); cache_bytes > 0) {
    impl_->cache = std::make_unique<TextureCache>(cache_bytes);
  }
  for_each_in_parallel(images.size(), [&](std::size_t i) { image_load(images[i], *kept); });
  for (Image& image : images) {
    warn(image, warnings);
    if (image.cached) {
      image.cache_index = impl_->cache->add(image.source);
    } else {
      image.source.encoded = {};
      std::vector<unsigned char>().swap(image.encoded);
    }
  }
  for (std::size_t i = 0; i < requests.size(); ++i) {
    const TextureRequest& request = requests[i];
    const Image& image = images[impl_->image_of_texture[i]];
    impl_->views.push_back(image.cached
                               ? impl_->cache->view(image.cache_index, request.wrap_u, request.wrap_v, request.filter)
                               : resident_view(image.read->chain, request));
  }
}

TextureStore::~TextureStore() = default;

int TextureStore::add_image(std::string label,
                            int width,
                            int height,
                            std::span<const float> rgb,
                            Wrap wrap_u,
                            Wrap wrap_v)
{
  Image image;
  image.label = label;
  image.layout = {width, height, 3, TexelFormat::kHalf};
  const auto read = std::make_shared<TextureTexels>(TextureTexels{MipChain(image.layout), {}});
  auto* texels = reinterpret_cast<std::uint16_t*>(read->chain.level(0));
  std::transform(rgb.begin(), rgb.end(), texels,
                 [](float value) { return half_from_float(clamp(value, -kHalfMax, kHalfMax)); });
  mip_chain_build(read->chain);
  TextureRequest request;
  request.wrap_u = wrap_u;
  request.wrap_v = wrap_v;
  // Views look into the chain's own block, which stays where it is when the images move.
  impl_->views.push_back(resident_view(read->chain, request));
  image.read = read;
  impl_->image_of_texture.push_back(impl_->images.size());
  impl_->images.push_back(std::move(image));
  impl_->labels.push_back(std::move(label));
  return static_cast<int>(impl_->views.size()) - 1;
}

std::span<const TextureView> TextureStore::views() const { return impl_->views; }

std::size_t TextureStore::bytes() const
{
  std::size_t bytes = 0;
  for (const Image& image : impl_->images) {
    bytes += image.read != nullptr ? image.read->bytes() : 0;
  }
  return bytes;
}

bool TextureStore::is_cached(int index) const
{
  return impl_->images[impl_->image_of_texture[static_cast<std::size_t>(index)]].cached;
}

const std::string& TextureStore::label(int index) const { return impl_->labels[static_cast<std::size_t>(index)]; }

}  // namespace relief
