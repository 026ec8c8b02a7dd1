#include "scene/height_image.h"

#include <algorithm>

#include "scene/memory.h"
#include "scene/parallel.h"

namespace relief {

HeightImage::HeightImage(const TextureSource* source, const TexelLayout& layout, const std::string& label)
    : label_(label), layout_(layout)
{
  if (source == nullptr || layout.format != TexelFormat::kHalf) return;
  constexpr int kBandRows = 256;
  const std::size_t row = static_cast<std::size_t>(layout.width) * static_cast<std::size_t>(layout.num_channels);
  const MemoryReservation room(row * static_cast<std::size_t>(layout.height) * sizeof(float), label + ", as heights");
  texels_.resize(row * static_cast<std::size_t>(layout.height));
  TextureSource wide = *source;
  wide.is_wide = true;
  TextureReader reader(wide);
  for (int y = 0; y < layout.height; y += kBandRows) {
    reader.read_rows(y, std::min(y + kBandRows, layout.height),
                     reinterpret_cast<unsigned char*>(&texels_[static_cast<std::size_t>(y) * row]));
  }
}

Vec4f HeightImage::look_up(const void* image, Vec2f uv, float)
{
  const HeightImage& of = *static_cast<const HeightImage*>(image);
  const auto place = [](float at, int size) {
    return static_cast<std::size_t>(std::clamp(static_cast<int>(at * static_cast<float>(size)), 0, size - 1));
  };
  const auto num_channels = static_cast<std::size_t>(of.layout_.num_channels);
  const std::size_t texel =
      place(uv.y, of.layout_.height) * static_cast<std::size_t>(of.layout_.width) + place(uv.x, of.layout_.width);
  const float* t = &of.texels_[texel * num_channels];
  switch (num_channels) {
    case 1:
      return {t[0], t[0], t[0], 1.0f};
    case 2:
      return {t[0], t[0], t[0], t[1]};
    case 3:
      return {t[0], t[1], t[2], 1.0f};
    default:
      return {t[0], t[1], t[2], t[3]};
  }
}

TextureView HeightImage::view(TextureView texture) const
{
  // Heights are asked for at points, which have no width.
  texture.num_levels = 1;
  if (texels_.empty()) return texture;
  texture.lookup = look_up;
  texture.lookup_handle = this;
  texture.format = TexelFormat::kHalf;
  return texture;
}

ImageBounds HeightImage::bounds(const TextureView& texture)
{
  if (levels_.empty()) {
    const auto size = [&](int side, int level) { return static_cast<std::size_t>(image_bounds_size(side, level)); };
    const auto count = [&](int level) { return size(texture.width, level) * size(texture.height, level); };
    const MemoryReservation room(2 * count(0) * sizeof(TexelRange), label_ + ", bounds of heights");
    levels_.emplace_back(count(0));
    for_each_in_parallel(size(texture.height, 0), [&](std::size_t row) {
      for (std::size_t column = 0; column < size(texture.width, 0); ++column) {
        TexelRange range = texel_range_of_nothing();
        const int y0 = static_cast<int>(row) * kImageBoundsBlock, x0 = static_cast<int>(column) * kImageBoundsBlock;
        for (int y = y0; y < std::min(y0 + kImageBoundsBlock, texture.height); ++y) {
          for (int x = x0; x < std::min(x0 + kImageBoundsBlock, texture.width); ++x) {
            const TexelValue texel = image_texel(texture, x, y);
            range = texel_hull(range, {texel, texel});
          }
        }
        levels_[0][row * size(texture.width, 0) + column] = range;
      }
    });
    for (int level = 1; count(level - 1) > 1 && level < kMaxMipLevels; ++level) {
      std::vector<TexelRange>& coarse = levels_.emplace_back(count(level), texel_range_of_nothing());
      const std::vector<TexelRange>& fine = levels_[static_cast<std::size_t>(level) - 1];
      const std::size_t fine_columns = size(texture.width, level - 1), columns = size(texture.width, level);
      for (std::size_t i = 0; i < fine.size(); ++i) {
        TexelRange& range = coarse[i / fine_columns / 2 * columns + i % fine_columns / 2];
        range = texel_hull(range, fine[i]);
      }
    }
  }
  ImageBounds out;
  out.num_levels = static_cast<int>(levels_.size());
  for (std::size_t i = 0; i < levels_.size(); ++i) out.levels[i] = levels_[i].data();
  return out;
}

std::size_t HeightImage::bytes() const
{
  std::size_t bytes = texels_.size() * sizeof(float);
  for (const std::vector<TexelRange>& level : levels_) bytes += level.size() * sizeof(TexelRange);
  return bytes;
}

}  // namespace relief
