#include "scene/texture_store.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <deque>
#include <map>
#include <new>
#include <numeric>
#include <optional>
#include <string_view>
#include <tuple>
#include <unordered_map>

#include "scene/height_image.h"
#include "scene/kept_images.h"
#include "scene/memory.h"
#include "scene/mip_chain.h"
#include "scene/parallel.h"
#include "scene/texture_cache.h"
#include "scene/texture_faults.h"
#include "scene/texture_source.h"
#include "scene/wide_texture.h"

namespace relief {
namespace {

/// Tiles in use by the threads at one time must fit, whatever the budget.
constexpr std::size_t kLeastCacheBytes = std::size_t{64} << 20;

/// An image as it was read, to stay in memory.
struct TextureTexels {
  std::optional<MipChain> chain;  ///< none: halves do not hold its values, and it has to be read again
  TexelRepairs repairs;

  std::size_t bytes() const { return chain ? chain->bytes() : 0; }
};

/// One distinct image and what became of it.
struct Image {
  TextureSource source;
  bool is_missing = false;  ///< someone knows already
  TextureFaults* faults = nullptr;
  std::optional<SceneError> fault;  ///< it cannot be read
  std::string label;
  std::vector<unsigned char> encoded;  ///< what source.encoded looks at
  TexelLayout layout;
  TexelRepairs repairs;
  bool cached = false, needs_load = true;
  std::size_t cache_index = 0;
  std::shared_ptr<const TextureTexels> read;  ///< null: it is served by the cache
};

/// What messages about memory call an image.
std::string label_with_size(const Image& image)
{
  return image.label + ", " + std::to_string(image.layout.width) + " x " + std::to_string(image.layout.height) +
         " texels";
}

/// Reads all rows, in bands: to keep them, or only to know that they can be read. Ends where a value is beyond halves.
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
  const int band = reader.rows_at_once();
  for (int y = 0; y < image.layout.height; y += band) {
    const int end = std::min(y + band, image.layout.height);
    if (destination == nullptr) {
      scratch.resize(static_cast<std::size_t>(end - y) * row_bytes);
    }
    unsigned char* texels =
        destination == nullptr ? scratch.data() : destination + static_cast<std::size_t>(y) * row_bytes;
    reader.read_rows(y, end, texels);
    if (reader.repairs().num_clamped > 0) break;
  }
  return reader.repairs();
}

std::shared_ptr<const TextureTexels> image_read(const Image& image)
{
  const MemoryReservation room(mip_chain_bytes(image.layout), label_with_size(image));
  const auto out = std::make_shared<TextureTexels>(TextureTexels{MipChain(image.layout), {}});
  out->repairs = rows_load(image, out->chain->level(0));
  if (out->repairs.num_clamped > 0) {
    out->chain.reset();
  } else {
    mip_chain_build(*out->chain);
  }
  return out;
}

/// What stands in the place of an image that cannot be read.
std::shared_ptr<const TextureTexels> missing_make(TexelLayout& layout)
{
  layout = {1, 1, 4, TexelFormat::kU8};
  const auto out = std::make_shared<TextureTexels>(TextureTexels{MipChain(layout), {}});
  std::memcpy(out->chain->level(0), kMissingTexel, sizeof kMissingTexel);
  return out;
}

/// Runs a step of an image's way, unless there is none to go. Where someone hears of faults they are kept instead of thrown.
template <class Step>
void image_step(Image& image, const Step& step)
{
  if (image.is_missing || image.fault) return;
  if (image.faults == nullptr) return step();
  try {
    step();
  } catch (const SceneError& fault) {
    image.fault = fault;
  }
}

std::string kind_of(const TextureSource& source)
{
  return "texture " + std::to_string(static_cast<int>(source.color)) + (source.is_wide ? " wide" : "");
}

void image_load(Image& image, KeptImages& kept)
{
  try {
    if (image.cached) {
      // The cache would meet damaged data only while rendering; it is found here instead.
      image.repairs = rows_load(image, nullptr);
      return;
    }
    image.read = kept.get<TextureTexels>(KeptImages::key(kind_of(image.source), image.source),
                                         [&] { return image_read(image); });
    image.repairs = image.read->repairs;
  } catch (const OutOfMemory&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw OutOfMemory(label_with_size(image));
  }
}

/// Marks images as cached, largest first, until the others fit; ties go by order. Those that are, stay.
/// @return  bytes left to the cache
std::size_t choose_cached(std::vector<Image>& images, std::size_t budget_bytes)
{
  std::size_t resident = 0;
  bool any_cached = false;
  for (const Image& image : images) {
    any_cached = any_cached || image.cached;
    resident += image.cached ? 0 : mip_chain_bytes(image.layout);
  }
  if (resident <= budget_bytes && !any_cached) {
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
    if (images[i].cached) continue;
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
}

TextureView texels_view(const MipChain& chain, const TextureRequest& request)
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
      if (image.source.color == request.color && image.source.file == file && image.encoded == request.encoded &&
          image.is_missing == request.is_missing) {
        return entry->second;
      }
    }
    Image& image = images.emplace_back();
    image.encoded = std::move(request.encoded);
    image.source = {{file, {}, request.scene_file, request.json_path}, request.color};
    image.label = request.label;
    image.is_missing = request.is_missing;
    image.faults = request.faults;
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
  std::deque<WideTexture> wide;  ///< views point at them
  std::vector<std::size_t> image_of_texture;

  /// View of an image in memory.
  TextureView resident_view(const Image& image, const TextureRequest& request)
  {
    const TextureView view = texels_view(*image.read->chain, request);
    return image.read->chain->layout().is_wide
               ? wide_texture_view(wide.emplace_back(WideTexture{&*image.read->chain, view}))
               : view;
  }
  std::vector<std::string> labels;
  std::map<std::size_t, std::unique_ptr<HeightImage>> height_images;  ///< by their images
  std::vector<TextureView> height_views;
  std::vector<ImageBounds> height_bounds;
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
    image_step(images[i], [&] { images[i].layout = TextureReader(images[i].source).layout(); });
  });
  for (std::size_t i = 0; i < requests.size(); ++i) {
    const Image& image = images[impl_->image_of_texture[i]];
    if (!requests[i].of_vectors || image.is_missing || image.fault || image.layout.num_channels > 2) continue;
    throw SceneError(requests[i].scene_file, requests[i].json_path,
                     "an image of three channels, as it is one of vectors",
                     image.layout.num_channels == 1 ? "one channel" : "two channels");
  }
  // Where memory is short, the tile cache is better than an end. What is there already needs none.
  const auto budget =
      static_cast<std::size_t>(std::min<std::uint64_t>(budget_bytes, memory_left() / 2 + kept->bytes()));
  std::size_t cache_bytes = choose_cached(images, budget);
  const auto load_all = [&] {
    for_each_in_parallel(images.size(), [&](std::size_t i) {
      image_step(images[i], [&] {
        if (images[i].needs_load) image_load(images[i], *kept);
        images[i].needs_load = false;
      });
    });
  };
  load_all();
  // Which images halves do not hold is known when they have been read so far. Then they are as large again.
  bool any_wide = false;
  for (Image& image : images) {
    if (image.repairs.num_clamped == 0) continue;
    image.source.is_wide = image.layout.is_wide = image.needs_load = any_wide = true;
  }
  if (any_wide) {
    cache_bytes = choose_cached(images, budget);
    for (Image& image : images) {
      if (image.cached) image.read.reset();
    }
    load_all();
  }
  for (Image& image : images) {
    if (image.fault) image.faults->add(*image.fault);
    if (image.is_missing || image.fault) {
      image.cached = false;
      image.read = missing_make(image.layout);
    }
  }
  if (cache_bytes > 0) impl_->cache = std::make_unique<TextureCache>(cache_bytes);
  for (std::size_t i = 0; i < requests.size(); ++i) {
    const std::size_t of = impl_->image_of_texture[i];
    if (!requests[i].of_heights || impl_->height_images.contains(of)) continue;
    const Image& image = images[of];
    const bool is_there = !image.is_missing && !image.fault;
    impl_->height_images[of] = std::make_unique<HeightImage>(is_there ? &image.source : nullptr, image.layout, image.label);
  }
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
                               : impl_->resident_view(image, request));
  }
  impl_->height_views = impl_->views;
  impl_->height_bounds.resize(requests.size());
  for (std::size_t i = 0; i < requests.size(); ++i) {
    if (!requests[i].of_heights) continue;
    HeightImage& image = *impl_->height_images[impl_->image_of_texture[i]];
    impl_->height_views[i] = image.view(impl_->views[i]);
    impl_->height_bounds[i] = image.bounds(impl_->height_views[i]);
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
  image.layout.is_wide = std::any_of(rgb.begin(), rgb.end(), [](float v) { return std::abs(v) > kHalfMax; });
  const auto read = std::make_shared<TextureTexels>(TextureTexels{MipChain(image.layout), {}});
  unsigned char* const texels = read->chain->level(0);
  if (image.layout.is_wide) {
    std::memcpy(texels, rgb.data(), rgb.size_bytes());
  } else {
    std::transform(rgb.begin(), rgb.end(), reinterpret_cast<std::uint16_t*>(texels), half_from_float);
  }
  mip_chain_build(*read->chain);
  TextureRequest request;
  request.wrap_u = wrap_u;
  request.wrap_v = wrap_v;
  // Views look into the chain's own block, which stays where it is when the images move.
  image.read = read;
  impl_->views.push_back(impl_->resident_view(image, request));
  impl_->image_of_texture.push_back(impl_->images.size());
  impl_->images.push_back(std::move(image));
  impl_->labels.push_back(std::move(label));
  return static_cast<int>(impl_->views.size()) - 1;
}

std::span<const TextureView> TextureStore::views() const { return impl_->views; }
std::span<const TextureView> TextureStore::height_views() const { return impl_->height_views; }
std::span<const ImageBounds> TextureStore::height_bounds() const { return impl_->height_bounds; }

std::size_t TextureStore::bytes() const
{
  std::size_t bytes = 0;
  for (const Image& image : impl_->images) {
    bytes += image.read != nullptr ? image.read->bytes() : 0;
  }
  for (const auto& [index, image] : impl_->height_images) bytes += image->bytes();
  return bytes;
}

bool TextureStore::is_cached(int index) const
{
  return impl_->images[impl_->image_of_texture[static_cast<std::size_t>(index)]].cached;
}

const std::string& TextureStore::label(int index) const { return impl_->labels[static_cast<std::size_t>(index)]; }

}  // namespace relief
