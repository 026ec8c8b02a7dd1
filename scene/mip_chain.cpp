#include "scene/mip_chain.h"

#include <sys/mman.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <new>
#include <vector>

#include "kernel/assert.h"

namespace relief {
namespace {

/// Levels start at cache lines.
constexpr std::size_t kLevelAlignment = 64;

/// Nearest 8-bit sRGB code of a linear value, by a first guess from a table and exact comparisons.
class SrgbEncoder {
 public:
  SrgbEncoder()
  {
    for (int code = 0; code < 255; ++code) {
      // "Nearest" is meant in the encoded scale, where codes are equally far apart.
      const double encoded = (code + 0.5) / 255.0;
      const double linear = encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
      upper_bound_[static_cast<std::size_t>(code)] = static_cast<float>(linear);
    }
    upper_bound_[255] = kInfinity;
    int code = 0;
    for (std::size_t i = 0; i < kGuesses; ++i) {
      while (static_cast<float>(i) / kGuesses > upper_bound_[static_cast<std::size_t>(code)]) {
        ++code;
      }
      guess_[i] = static_cast<unsigned char>(code);
    }
  }

  /// @param linear  in [0, 1]
  unsigned char encode(float linear) const
  {
    const auto i = static_cast<std::size_t>(linear * kGuesses);
    unsigned char code = guess_[std::min(i, kGuesses - 1)];
    while (linear > upper_bound_[code]) {
      ++code;
    }
    return code;
  }

 private:
  static constexpr std::size_t kGuesses = 4096;
  std::array<float, 256> upper_bound_{};
  std::array<unsigned char, kGuesses> guess_{};
};

/// The texels of the finer level that one texel of the coarser one covers along one side, and their shares.
struct Coverage {
  int first = 0, count = 0;
  float weights[3] = {};
};

std::vector<Coverage> coverage_make(int fine_size, int coarse_size)
{
  std::vector<Coverage> coverage(static_cast<std::size_t>(coarse_size));
  for (int i = 0; i < coarse_size; ++i) {
    // In units of 1 / coarse_size of a fine texel all borders are integers.
    const std::int64_t begin = std::int64_t{i} * fine_size;
    const std::int64_t end = begin + fine_size;
    Coverage& c = coverage[static_cast<std::size_t>(i)];
    c.first = static_cast<int>(begin / coarse_size);
    for (std::int64_t texel = c.first; texel * coarse_size < end; ++texel) {
      RELIEF_ASSERT(c.count < 3);
      const std::int64_t share = std::min(end, (texel + 1) * coarse_size) - std::max(begin, texel * coarse_size);
      c.weights[c.count++] = static_cast<float>(share) / static_cast<float>(fine_size);
    }
  }
  return coverage;
}

template <TexelFormat kFormat, int kChannels>
void texel_write(unsigned char* texel, TexelValue value, const SrgbEncoder& encoder)
{
  for (int c = 0; c < kChannels; ++c) {
    // texel_load moved the alpha of grey textures to the last lane.
    const float v = value[kChannels == 2 && c == 1 ? 3 : c];
    const bool is_alpha = (kChannels == 2 || kChannels == 4) && c == kChannels - 1;
    if constexpr (kFormat == TexelFormat::kHalf) {
      const std::uint16_t half = half_from_float(v);
      std::memcpy(texel + 2 * c, &half, sizeof half);
    } else if (kFormat == TexelFormat::kU8Srgb && !is_alpha) {
      texel[c] = encoder.encode(v);
    } else {
      // To even: means of four codes end in .5 a quarter of the time, and always rounding up would brighten each level.
      texel[c] = static_cast<unsigned char>(std::lrint(v));
    }
  }
}

/// How a texel is read and written whose channels are of one of the kernel's formats.
template <TexelFormat kFormat, int kChannels>
struct FormatTexel {
  const SrgbEncoder& encoder;
  static TexelValue load(const unsigned char* texel) { return texel_load<kFormat, kChannels>(texel); }
  void write(unsigned char* texel, TexelValue value) const { texel_write<kFormat, kChannels>(texel, value, encoder); }
};

/// Likewise of floats.
struct WideTexel {
  std::size_t num_channels;
  TexelValue load(const unsigned char* texel) const
  {
    TexelValue value{};
    std::memcpy(&value, texel, num_channels * sizeof(float));
    return value;
  }
  void write(unsigned char* texel, TexelValue value) const { std::memcpy(texel, &value, num_channels * sizeof(float)); }
};

template <class Texel>
void level_build(MipChain& chain, int level, const Texel& texel)
{
  const TexelLayout& layout = chain.layout();
  const int fine_width = mip_size(layout.width, level - 1);
  const std::vector<Coverage> columns = coverage_make(fine_width, mip_size(layout.width, level));
  const std::vector<Coverage> rows = coverage_make(mip_size(layout.height, level - 1), mip_size(layout.height, level));
  const std::size_t bytes = texel_layout_bytes(layout);
  const unsigned char* fine = chain.level(level - 1);
  unsigned char* coarse = chain.level(level);
  const std::size_t fine_pitch = static_cast<std::size_t>(fine_width) * bytes;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, rows.size()), [&](const tbb::blocked_range<std::size_t>& range) {
    for (std::size_t y = range.begin(); y < range.end(); ++y) {
      for (std::size_t x = 0; x < columns.size(); ++x) {
        TexelValue sum{};
        for (int j = 0; j < rows[y].count; ++j) {
          const unsigned char* fine_row = fine + static_cast<std::size_t>(rows[y].first + j) * fine_pitch;
          TexelValue row_sum{};
          for (int i = 0; i < columns[x].count; ++i) {
            row_sum +=
                columns[x].weights[i] * texel.load(fine_row + static_cast<std::size_t>(columns[x].first + i) * bytes);
          }
          sum += rows[y].weights[j] * row_sum;
        }
        texel.write(coarse + (y * columns.size() + x) * bytes, sum);
      }
    }
  });
}

template <TexelFormat kFormat>
void level_build(MipChain& chain, int level, const SrgbEncoder& encoder)
{
  switch (chain.layout().num_channels) {
    case 1:
      return level_build(chain, level, FormatTexel<kFormat, 1>{encoder});
    case 2:
      return level_build(chain, level, FormatTexel<kFormat, 2>{encoder});
    case 3:
      return level_build(chain, level, FormatTexel<kFormat, 3>{encoder});
    default:
      return level_build(chain, level, FormatTexel<kFormat, 4>{encoder});
  }
}

/// Asks for large memory pages before a block is touched: look-ups all over a large texture otherwise spend most of
/// their time on address translation. Refusal changes nothing but speed.
void advise_large_pages(unsigned char* block, std::size_t bytes)
{
  constexpr std::uintptr_t kPage = 4096;
  constexpr std::size_t kLargePage = std::size_t{2} << 20;
  if (bytes < 2 * kLargePage) {
    return;
  }
  const std::uintptr_t address = reinterpret_cast<std::uintptr_t>(block);
  const std::uintptr_t begin = (address + kPage - 1) / kPage * kPage;
  const std::uintptr_t end = (address + bytes) / kPage * kPage;
  static_cast<void>(madvise(block + (begin - address), end - begin, MADV_HUGEPAGE));
}

std::size_t level_bytes(const TexelLayout& layout, int level)
{
  return static_cast<std::size_t>(mip_size(layout.width, level)) *
         static_cast<std::size_t>(mip_size(layout.height, level)) * texel_layout_bytes(layout);
}

}  // namespace

std::size_t texel_layout_bytes(const TexelLayout& layout)
{
  return layout.is_wide ? static_cast<std::size_t>(layout.num_channels) * sizeof(float)
                        : static_cast<std::size_t>(texel_bytes(layout.format, layout.num_channels));
}

std::size_t texel_row_bytes(const TexelLayout& layout)
{
  return static_cast<std::size_t>(layout.width) * texel_layout_bytes(layout);
}

int mip_num_levels(int width, int height)
{
  int levels = 1;
  while (mip_size(std::max(width, height), levels - 1) > 1) {
    ++levels;
  }
  return levels;
}

std::size_t mip_chain_bytes(const TexelLayout& layout)
{
  std::size_t bytes = 0;
  for (int level = 0; level < mip_num_levels(layout.width, layout.height); ++level) {
    bytes += (level_bytes(layout, level) + kLevelAlignment - 1) / kLevelAlignment * kLevelAlignment;
  }
  return bytes;
}

MipChain::MipChain(const TexelLayout& layout)
    : layout_(layout), num_levels_(mip_num_levels(layout.width, layout.height))
{
  RELIEF_ASSERT(num_levels_ <= kMaxMipLevels);
  for (int i = 0; i < num_levels_; ++i) {
    offsets_[i + 1] = offsets_[i] + (level_bytes(layout, i) + kLevelAlignment - 1) / kLevelAlignment * kLevelAlignment;
  }
  texels_.reset(static_cast<unsigned char*>(std::calloc(bytes(), 1)));
  if (texels_ == nullptr) {
    throw std::bad_alloc();
  }
  advise_large_pages(texels_.get(), bytes());
}

void mip_chain_build(MipChain& chain)
{
  static const SrgbEncoder encoder;
  for (int level = 1; level < chain.num_levels(); ++level) {
    if (chain.layout().is_wide) {
      level_build(chain, level, WideTexel{static_cast<std::size_t>(chain.layout().num_channels)});
      continue;
    }
    switch (chain.layout().format) {
      case TexelFormat::kU8:
        level_build<TexelFormat::kU8>(chain, level, encoder);
        break;
      case TexelFormat::kU8Srgb:
        level_build<TexelFormat::kU8Srgb>(chain, level, encoder);
        break;
      case TexelFormat::kHalf:
        level_build<TexelFormat::kHalf>(chain, level, encoder);
        break;
    }
  }
}

}  // namespace relief
