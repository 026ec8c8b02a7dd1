#include "scene/texture_source.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "scene/image_reader.h"

namespace relief {
namespace {

/// Channels of the file that become R, G, B, A (or grey, alpha).
std::vector<int> select_channels(const ImageHeader& header)
{
  if (header.num_channels == 2 && header.alpha_channel != 1) {
    return {0, 1, -1};
  }
  if (header.num_channels <= 4) {
    std::vector<int> all(static_cast<std::size_t>(header.num_channels));
    for (int c = 0; c < header.num_channels; ++c) {
      all[static_cast<std::size_t>(c)] = c;
    }
    return all;
  }
  const int r = header.channel_index("R"), g = header.channel_index("G"), b = header.channel_index("B");
  const int a = header.channel_index("A");
  std::vector<int> channels = r >= 0 && g >= 0 && b >= 0 ? std::vector<int>{r, g, b} : std::vector<int>{0, 1, 2};
  if (a >= 0) {
    channels.push_back(a);
  }
  return channels;
}

float linear_from_srgb(float encoded)
{
  return encoded <= 0.04045f ? encoded / 12.92f : std::pow((encoded + 0.055f) / 1.055f, 2.4f);
}

}  // namespace

struct TextureReader::Impl {
  explicit Impl(const TextureSource& source);

  void convert_row(const unsigned char* source_row, unsigned char* texels);
  std::uint16_t convert_value(float value, bool is_alpha);

  ImageReader image;
  std::vector<int> channels;               ///< of the file, one a texel channel; −1: zero
  int channel_begin = 0, channel_end = 0;  ///< range that is read from the file
  bool is_8_bit = false, decode_srgb = false;
  TexelLayout layout;
  TexelRepairs repairs;
};

TextureReader::Impl::Impl(const TextureSource& source) : image(source)
{
  const ImageHeader& header = image.header();
  channels = select_channels(header);
  channel_begin = header.num_channels;
  for (const int c : channels) {
    if (c >= 0) {
      channel_begin = std::min(channel_begin, c);
      channel_end = std::max(channel_end, c + 1);
    }
  }
  is_8_bit = header.sample_type == SampleType::kU8;
  const bool is_srgb = source.color == TextureColor::kSrgb && header.is_integer;
  decode_srgb = is_srgb && !is_8_bit;
  layout.width = header.width;
  layout.height = header.height;
  layout.num_channels = static_cast<int>(channels.size());
  layout.format = !is_8_bit ? TexelFormat::kHalf : is_srgb ? TexelFormat::kU8Srgb : TexelFormat::kU8;
  image.select(channel_begin, channel_end, is_8_bit ? SampleType::kU8 : SampleType::kFloat);
}

std::uint16_t TextureReader::Impl::convert_value(float value, bool is_alpha)
{
  if (!is_finite(value)) {
    ++repairs.num_non_finite;
    return 0;
  }
  if (decode_srgb && !is_alpha) {
    value = linear_from_srgb(value);
  }
  if (std::abs(value) > kHalfMax) {
    ++repairs.num_clamped;
    value = std::copysign(kHalfMax, value);
  }
  return half_from_float(value);
}

void TextureReader::Impl::convert_row(const unsigned char* source_row, unsigned char* texels)
{
  const auto num_read = static_cast<std::size_t>(channel_end - channel_begin);
  const std::size_t num_channels = channels.size();
  for (std::size_t c = 0; c < num_channels; ++c) {
    if (channels[c] < 0) {
      continue;  // the caller's texels are zero
    }
    const auto offset = static_cast<std::size_t>(channels[c] - channel_begin);
    const bool is_alpha = (num_channels == 2 || num_channels == 4) && c == num_channels - 1;
    for (std::size_t x = 0; x < static_cast<std::size_t>(layout.width); ++x) {
      const std::size_t from = x * num_read + offset, to = x * num_channels + c;
      if (is_8_bit) {
        texels[to] = source_row[from];
      } else {
        float value;
        std::memcpy(&value, source_row + from * sizeof value, sizeof value);
        const std::uint16_t half = convert_value(value, is_alpha);
        std::memcpy(texels + to * sizeof half, &half, sizeof half);
      }
    }
  }
}

TextureReader::TextureReader(const TextureSource& source) : impl_(std::make_unique<Impl>(source)) {}
TextureReader::~TextureReader() = default;

const TexelLayout& TextureReader::layout() const { return impl_->layout; }
const TexelRepairs& TextureReader::repairs() const { return impl_->repairs; }

void TextureReader::read_rows(int begin, int end, unsigned char* texels)
{
  const unsigned char* rows = impl_->image.load_rows(begin, end);
  const std::size_t row_bytes = texel_row_bytes(impl_->layout);
  std::memset(texels, 0, static_cast<std::size_t>(end - begin) * row_bytes);
  for (std::size_t y = 0; y < static_cast<std::size_t>(end - begin); ++y) {
    impl_->convert_row(rows + y * impl_->image.row_bytes(), texels + y * row_bytes);
  }
}

}  // namespace relief
