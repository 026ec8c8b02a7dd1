#include "scene/height_map.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <limits>
#include <map>
#include <new>
#include <optional>
#include <set>
#include <string_view>
#include <tuple>
#include <utility>

#include "scene/image_reader.h"
#include "scene/kept_images.h"
#include "scene/memory.h"
#include "scene/parallel.h"
#include "scene/texture_faults.h"
#include "scene/texture_store.h"

namespace relief {
namespace {

std::size_t format_bytes(HeightFormat format)
{
  return format == HeightFormat::kU8 ? 1 : format == HeightFormat::kU16 ? 2 : 4;
}

HeightFormat height_format(SampleType type)
{
  return type == SampleType::kU8    ? HeightFormat::kU8
         : type == SampleType::kU16 ? HeightFormat::kU16
                                    : HeightFormat::kFloat;
}

/// What was met in an image's values.
struct HeightFindings {
  std::int64_t num_replaced = 0;  ///< not finite or too large
  int first_x = 0, first_y = 0;   ///< the first replaced texel
  std::int64_t num_coloured = 0;  ///< texels whose channels differ
};

/// An image as it was read.
struct HeightTexels {
  HeightMap map;  ///< size, format and texels
  HeightFindings findings;

  std::size_t bytes() const { return map.bytes(); }
};

/// One distinct image and what became of it.
struct HeightImage {
  ImageSource source;
  std::string label;
  std::shared_ptr<const HeightTexels> read;
  bool is_missing = false;  ///< someone knows already
  TextureFaults* faults = nullptr;
  std::optional<SceneError> fault;  ///< it cannot be read
};

/// Channels of an image that count: the one with the heights first, then those that should equal it.
std::vector<int> height_channels(const ImageHeader& header)
{
  const int r = header.channel_index("R"), g = header.channel_index("G"), b = header.channel_index("B");
  if (r >= 0 && g >= 0 && b >= 0) {
    return {r, g, b};
  }
  constexpr std::size_t kColours = 3;
  std::vector<int> channels;
  for (int c = 0; c < header.num_channels && channels.size() < kColours; ++c) {
    if (c != header.alpha_channel) {
      channels.push_back(c);
    }
  }
  return channels.empty() ? std::vector<int>{0} : channels;
}

/// Copies the first of several interleaved channels; counts the texels whose other channels differ from it.
/// @param channels  offsets within a texel, the wanted one first
/// @param stride    channels a texel
template <class T>
std::int64_t channel_copy(const T* from,
                          std::size_t num_texels,
                          std::span<const std::size_t> channels,
                          std::size_t stride,
                          T* to)
{
  std::int64_t num_different = 0;
  for (std::size_t i = 0; i < num_texels; ++i, from += stride) {
    to[i] = from[channels[0]];
    bool differs = false;
    for (const std::size_t c : channels.subspan(1)) {
      // By their bits, so that equal NaN count as equal. NOLINTNEXTLINE(bugprone-suspicious-memory-comparison)
      differs |= std::memcmp(&from[c], &from[channels[0]], sizeof(T)) != 0;
    }
    num_different += differs ? 1 : 0;
  }
  return num_different;
}

/// Reads an image band by band into texels of type T.
template <class T>
void texels_load(ImageReader& reader, HeightTexels& image, T* texels)
{
  const std::vector<int> channels = height_channels(reader.header());
  const auto [low, high] = std::minmax_element(channels.begin(), channels.end());
  const int begin = *low;
  reader.select(begin, *high + 1, reader.header().sample_type);
  std::vector<std::size_t> offsets;
  offsets.reserve(channels.size());
  for (const int c : channels) {
    offsets.push_back(static_cast<std::size_t>(c - begin));
  }
  const auto width = static_cast<std::size_t>(image.map.width);
  const std::size_t stride = reader.row_bytes() / (width * sizeof(T));
  const int band = reader.rows_at_once();
  for (int y = 0; y < image.map.height; y += band) {
    const int end = std::min(y + band, image.map.height);
    const auto num_texels = static_cast<std::size_t>(end - y) * width;
    const auto* rows = reinterpret_cast<const T*>(reader.load_rows(y, end));
    image.findings.num_coloured +=
        channel_copy(rows, num_texels, offsets, stride, texels + static_cast<std::size_t>(y) * width);
  }
}

/// Replaces what is not a height by the mean of the others.
void texels_repair(std::span<float> texels, int width, HeightFindings& findings)
{
  // NaN is no height either: it fails the comparison.
  const auto is_height = [](float h) { return std::abs(h) <= kHighestHeight; };
  double sum = 0;
  for (std::size_t i = 0; i < texels.size(); ++i) {
    if (is_height(texels[i])) {
      sum += static_cast<double>(texels[i]);
    } else if (findings.num_replaced++ == 0) {
      findings.first_x = static_cast<int>(i % static_cast<std::size_t>(width));
      findings.first_y = static_cast<int>(i / static_cast<std::size_t>(width));
    }
  }
  if (findings.num_replaced == 0) {
    return;
  }
  const auto num_heights = static_cast<double>(texels.size()) - static_cast<double>(findings.num_replaced);
  const float mean = num_heights > 0 ? static_cast<float>(sum / num_heights) : 0.0f;
  std::replace_if(
      texels.begin(), texels.end(), [&](float h) { return !is_height(h); }, mean);
}

/// @param name  of the image, for messages
std::shared_ptr<const HeightTexels> image_read(const ImageSource& source, const std::string& name)
{
  const auto out = std::make_shared<HeightTexels>();
  HeightTexels& image = *out;
  ImageReader reader(source);
  const ImageHeader& header = reader.header();
  HeightMap& map = image.map;
  map.width = header.width;
  map.height = header.height;
  map.format = height_format(header.sample_type);
  const std::string label = name + ", " + std::to_string(map.width) + " x " + std::to_string(map.height) + " texels";
  try {
    // What is traced adds to the map a quarter of a byte a texel, and levels of detail a third of it.
    const MemoryReservation room(2 * map.bytes(), label);
    const std::shared_ptr<void> texels = height_texels_allocate(map.bytes());
    switch (map.format) {
      case HeightFormat::kU8:
        texels_load(reader, image, static_cast<std::uint8_t*>(texels.get()));
        break;
      case HeightFormat::kU16:
        texels_load(reader, image, static_cast<std::uint16_t*>(texels.get()));
        break;
      case HeightFormat::kFloat:
        auto* heights = static_cast<float*>(texels.get());
        texels_load(reader, image, heights);
        texels_repair({heights, map.bytes() / sizeof(float)}, map.width, image.findings);
        break;
    }
    map.texels = texels;
    return out;
  } catch (const OutOfMemory&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw OutOfMemory(label);
  }
}

/// One height everywhere, in the place of an image that cannot be read.
std::shared_ptr<const HeightTexels> missing_make()
{
  const auto out = std::make_shared<HeightTexels>();
  out->map.width = out->map.height = 1;
  out->map.format = HeightFormat::kFloat;
  const std::shared_ptr<void> texel = height_texels_allocate(sizeof(float));
  std::memcpy(texel.get(), &kMissingHeight, sizeof kMissingHeight);
  out->map.texels = texel;
  return out;
}

void warn(const std::string& label, const HeightFindings& found, Warnings& warnings)
{
  if (found.num_replaced > 0) {
    warnings.add(label + ": " + std::to_string(found.num_replaced) +
                 " heights were not finite or beyond 1e30 and are replaced by the mean of the others, the first at "
                 "column " +
                 std::to_string(found.first_x) + ", row " + std::to_string(found.first_y));
  }
  if (found.num_coloured > 0) {
    warnings.add(label + ": a colour image as height map: its first channel is used, though the others differ in " +
                 std::to_string(found.num_coloured) + " texels");
  }
}

/// Finds the distinct images and maps of requests.
class Grouping {
 public:
  explicit Grouping(std::span<const TextureRequest> requests)
  {
    for (const TextureRequest& request : requests) {
      map_of_request.push_back(add_map(request));
    }
  }

  std::vector<HeightImage> images;
  std::vector<HeightMap> maps;  ///< labels and wrap modes only
  std::vector<std::size_t> image_of_map;
  std::vector<int> map_of_request;

 private:
  std::size_t add_image(const TextureRequest& request)
  {
    const std::string file = request.is_missing ? "missing"  // no path that is absolute
                             : request.file.empty()
                                 ? std::string()
                                 : std::filesystem::absolute(request.file).lexically_normal().string();
    const std::string_view bytes(reinterpret_cast<const char*>(request.encoded.data()), request.encoded.size());
    const auto [known, is_new] = image_of_.try_emplace({file, bytes}, images.size());
    if (is_new) {
      HeightImage& image = images.emplace_back();
      image.source = {file, request.encoded, request.scene_file, request.json_path};
      image.label = request.label;
      image.is_missing = request.is_missing;
      image.faults = request.faults;
    }
    return known->second;
  }

  int add_map(const TextureRequest& request)
  {
    const std::size_t image = add_image(request);
    const auto [known, is_new] =
        map_of_.try_emplace({image, request.wrap_u, request.wrap_v}, static_cast<int>(maps.size()));
    if (is_new) {
      HeightMap& map = maps.emplace_back();
      map.label = request.label;
      map.wrap_u = request.wrap_u;
      map.wrap_v = request.wrap_v;
      image_of_map.push_back(image);
    }
    return known->second;
  }

  std::map<std::pair<std::string, std::string_view>, std::size_t> image_of_;
  std::map<std::tuple<std::size_t, Wrap, Wrap>, int> map_of_;
};

}  // namespace

std::shared_ptr<void> height_texels_allocate(std::size_t bytes)
{
  constexpr std::size_t kAlignment = 64;
  void* block = std::aligned_alloc(kAlignment, (bytes + kAlignment - 1) / kAlignment * kAlignment);
  if (block == nullptr) {
    throw std::bad_alloc();
  }
  return {block, [](void* texels) { std::free(texels); }};
}

void height_texels_repair(std::span<float> texels, int width, const std::string& label, Warnings& warnings)
{
  HeightFindings findings;
  texels_repair(texels, width, findings);
  warn(label, findings, warnings);
}

HeightMapView HeightMap::view() const { return {texels.get(), width, height, format, wrap_u, wrap_v}; }

std::size_t HeightMap::bytes() const
{
  return static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * format_bytes(format);
}

HeightRange height_map_range(const HeightMapView& map)
{
  HeightRange range{height_at(map, 0), height_at(map, 0)};
  const std::int64_t num_texels = std::int64_t{map.width} * map.height;
  for (std::int64_t i = 1; i < num_texels; ++i) {
    const float h = height_at(map, i);
    range = {std::min(range.low, h), std::max(range.high, h)};
  }
  return range;
}

std::size_t height_map_bytes(std::span<const HeightMap> maps)
{
  std::set<const void*> counted;
  std::size_t bytes = 0;
  for (const HeightMap& map : maps) {
    bytes += counted.insert(map.texels.get()).second ? map.bytes() : 0;
  }
  return bytes;
}

HeightMapSet height_maps_load(std::span<const TextureRequest> requests, Warnings& warnings, KeptImages* kept)
{
  KeptImages own;
  if (kept == nullptr) kept = &own;
  Grouping groups(requests);
  for_each_in_parallel(groups.images.size(), [&](std::size_t i) {
    HeightImage& image = groups.images[i];
    if (image.is_missing) return;
    try {
      image.read = kept->get<HeightTexels>(KeptImages::key("heights", image.source),
                                           [&] { return image_read(image.source, image.label); });
    } catch (const SceneError& fault) {
      if (image.faults == nullptr) throw;
      image.fault = fault;
    }
  });
  for (HeightImage& image : groups.images) {
    if (image.fault) image.faults->add(*image.fault);
    if (image.read == nullptr) image.read = missing_make();
  }
  for (const HeightImage& image : groups.images) {
    warn(image.label, image.read->findings, warnings);
  }
  for (const TextureRequest& request : requests) {
    if (request.filter == TexelFilter::kNearest) {
      warnings.add(request.label + ": sampled by nearest texel as a texture, but heights are interpolated");
    }
  }
  for (std::size_t m = 0; m < groups.maps.size(); ++m) {
    const HeightMap& loaded = groups.images[groups.image_of_map[m]].read->map;
    HeightMap& map = groups.maps[m];
    map.width = loaded.width;
    map.height = loaded.height;
    map.format = loaded.format;
    map.texels = loaded.texels;
  }
  return {std::move(groups.maps), std::move(groups.map_of_request)};
}

}  // namespace relief
