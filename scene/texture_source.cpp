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
  float repaired(float value, bool is_alpha);
  void associate(unsigned char* source_rows, std::size_t num_texels) const;

  ImageReader image;
  std::vector<int> channels;               ///< of the file, one a texel channel; −1: zero
  int channel_begin = 0, channel_end = 0;  ///< range that is read from the file
  bool is_8_bit = false, decode_srgb = false, associates = false, divides = false, is_16_bit = false;
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
  const bool is_srgb =
      texture_color_is_encoded(source.color) || (!texture_color_is_linear(source.color) && header.is_integer);
  // Of four channels alone, and of each value by its own code: as Cycles does it.
  associates = texture_color_is_associated(source.color) && header.alpha_is_straight && header.num_channels == 4;
  decode_srgb = is_srgb && !is_8_bit;
  divides = decode_srgb && texture_color_is_divided(source.color) && !header.alpha_is_straight &&
            header.num_channels == 4 && header.alpha_channel == 3;
  layout.width = header.width;
  layout.height = header.height;
  layout.num_channels = static_cast<int>(channels.size());
  layout.format = !is_8_bit ? TexelFormat::kHalf : is_srgb ? TexelFormat::kU8Srgb : TexelFormat::kU8;
  layout.is_wide = source.is_wide && !is_8_bit;
  is_16_bit = header.sample_type == SampleType::kU16;
  image.select(channel_begin, channel_end, is_8_bit ? SampleType::kU8 : SampleType::kFloat);
}

/// A value as light, finite and in range.
float TextureReader::Impl::repaired(float value, bool is_alpha)
{
  if (!is_finite(value)) {
    ++repairs.num_non_finite;
    return 0;
  }
  if (decode_srgb && !is_alpha) {
    value = linear_from_srgb(value);
  }
  if (std::abs(value) > kHalfMax && !layout.is_wide) {
    ++repairs.num_clamped;
    value = std::copysign(kHalfMax, value);
  }
  return value;
}

/// Multiplies colours of four channels by their alpha. Integers are rounded down.
void TextureReader::Impl::associate(unsigned char* source_rows, std::size_t num_texels) const
{
  constexpr std::size_t kColors = 3, kChannels = 4;
  for (std::size_t i = 0; i < num_texels; ++i) {
    if (is_8_bit) {
      unsigned char* texel = source_rows + i * kChannels;
      for (std::size_t c = 0; c < kColors; ++c) texel[c] = static_cast<unsigned char>(texel[c] * texel[kColors] / 255);
      continue;
    }
    float texel[kChannels];
    std::memcpy(texel, source_rows + i * sizeof texel, sizeof texel);
    for (std::size_t c = 0; c < kColors; ++c) {
      texel[c] *= texel[kColors];
      // The little more is for products that are whole numbers.
      if (is_16_bit) texel[c] = std::floor(texel[c] * 65535.0f + 0.01f) / 65535.0f;
    }
    std::memcpy(source_rows + i * sizeof texel, texel, sizeof texel);
  }
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
        // Light that is divided by alpha later has to be decode(code / alpha) then.
        float alpha = 1;
        if (divides && !is_alpha) {
          std::memcpy(&alpha, source_row + (x * num_read + 3) * sizeof alpha, sizeof alpha);
          if (!(alpha > 0.0f)) alpha = 1;
        }
        value = repaired(value / alpha, is_alpha) * alpha;
        if (layout.is_wide) {
          std::memcpy(texels + to * sizeof value, &value, sizeof value);
          continue;
        }
        const std::uint16_t half = half_from_float(value);
        std::memcpy(texels + to * sizeof half, &half, sizeof half);
      }
    }
  }
}

TextureReader::TextureReader(const TextureSource& source) : impl_(std::make_unique<Impl>(source)) {}
TextureReader::~TextureReader() = default;

const TexelLayout& TextureReader::layout() const { return impl_->layout; }
int TextureReader::rows_at_once() const { return impl_->image.rows_at_once(); }
const TexelRepairs& TextureReader::repairs() const { return impl_->repairs; }

void TextureReader::read_rows(int begin, int end, unsigned char* texels)
{
  const unsigned char* rows = impl_->image.load_rows(begin, end);
  std::vector<unsigned char> associated;
  if (impl_->associates) {
    // Rows of the reader may be asked for again.
    associated.assign(rows, rows + static_cast<std::size_t>(end - begin) * impl_->image.row_bytes());
    impl_->associate(associated.data(),
                     static_cast<std::size_t>(end - begin) * static_cast<std::size_t>(impl_->layout.width));
    rows = associated.data();
  }
  const std::size_t row_bytes = texel_row_bytes(impl_->layout);
  std::memset(texels, 0, static_cast<std::size_t>(end - begin) * row_bytes);
  for (std::size_t y = 0; y < static_cast<std::size_t>(end - begin); ++y) {
    impl_->convert_row(rows + y * impl_->image.row_bytes(), texels + y * row_bytes);
  }
}

}  // namespace relief
