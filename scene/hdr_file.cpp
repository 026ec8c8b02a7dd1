#include "scene/hdr_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <optional>

#include "kernel/assert.h"
#include "scene/sample_put.h"

namespace relief {
namespace {

struct HdrHeader {
  int width = 0, height = 0;
  std::size_t size = 0;  ///< bytes, up to the first row
};

/// Lines up to an empty one, and then one with the size.
std::optional<HdrHeader> header_of(std::span<const unsigned char> bytes)
{
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const std::size_t gap = text.find("\n\n");
  if (gap == std::string_view::npos || text.substr(0, gap).find("\nFORMAT=32-bit_rle_rgbe") == std::string_view::npos)
    return {};
  const std::size_t end = text.find('\n', gap + 2);
  constexpr std::size_t kMostOfLine = 80;
  if (end == std::string_view::npos || end - gap > kMostOfLine) return {};
  const std::string line(text.substr(gap + 2, end - gap - 2));
  HdrHeader header;
  if (std::sscanf(line.c_str(), "-Y %d +X %d", &header.height, &header.width) != 2) return {};
  header.size = end + 1;
  return header;
}

class HdrFile final : public ImageFile {
 public:
  bool can_be_embedded() const override { return true; }

  std::string open(const std::string&, std::span<const unsigned char> encoded, ImageHeader& header) override
  {
    encoded_ = encoded;
    const std::optional<HdrHeader> found = header_of(encoded);
    RELIEF_ASSERT(found);
    first_ = next_ = found->size;
    width_ = static_cast<std::size_t>(std::max(found->width, 0));
    height_ = found->height;
    header.width = found->width;
    header.height = found->height;
    header.depth = 1;
    header.num_channels = kChannels;
    header.sample_bits = 32;
    header.sample_type = SampleType::kFloat;
    header.channel_names = {"R", "G", "B"};
    header.format_name = "hdr";
    return {};
  }

  std::string read_rows(int row_begin,
                        int row_end,
                        int channel_begin,
                        int channel_end,
                        SampleType type,
                        unsigned char* rows) override
  {
    RELIEF_ASSERT(0 <= row_begin && row_begin < row_end && row_end <= height_);
    if (row_begin < next_row_) {
      next_ = first_;
      next_row_ = 0;
    }
    texels_.resize(4 * width_);
    while (next_row_ < row_end) {
      const char* const error = decode_row();
      if (error != nullptr) return "row " + std::to_string(next_row_) + ": " + error;
      if (next_row_++ < row_begin) continue;
      for (std::size_t x = 0; x < width_; ++x) {
        for (int c = channel_begin; c < channel_end; ++c) sample_put(value(x, c), type, rows);
      }
    }
    return {};
  }

 private:
  static constexpr int kChannels = 3;

  float value(std::size_t x, int channel) const
  {
    return static_cast<float>(texels_[4 * x + static_cast<std::size_t>(channel)]) * scales_[texels_[4 * x + 3]];
  }

  /// Of each exponent: eight bits behind the point, in excess of 128; 0 is black.
  static std::array<float, 256> exponent_scales()
  {
    std::array<float, 256> scales{};
    for (int exponent = 1; exponent < 256; ++exponent) {
      scales[static_cast<std::size_t>(exponent)] = std::ldexp(1.0f, exponent - 136);
    }
    return scales;
  }

  bool take(std::size_t count, unsigned char* to)
  {
    if (encoded_.size() - next_ < count) return false;
    std::memcpy(to, encoded_.data() + next_, count);
    next_ += count;
    return true;
  }

  /// Decodes the next row into texels_. @return what is wrong; null: nothing
  const char* decode_row()
  {
    constexpr const char* kTooShort = "the file ends before it does";
    constexpr std::size_t kLeastRun = 8, kMostRun = 0x7fff;
    unsigned char start[4];
    if (width_ < kLeastRun || width_ > kMostRun) return take(texels_.size(), texels_.data()) ? nullptr : kTooShort;
    if (!take(sizeof start, start)) return kTooShort;
    const bool has_runs = start[0] == 2 && start[1] == 2 && (start[2] & 0x80) == 0;
    if (!has_runs) {
      std::copy_n(start, 4, texels_.begin());
      return take(texels_.size() - 4, texels_.data() + 4) ? nullptr : kTooShort;
    }
    if ((std::size_t{start[2]} << 8 | start[3]) != width_) return "its width is not the image's";
    for (std::size_t c = 0; c < 4; ++c) {
      for (std::size_t x = 0; x < width_;) {
        unsigned char count = 0, same = 0;
        if (!take(1, &count)) return kTooShort;
        const bool is_run = count > 128;
        const std::size_t num = is_run ? count - 128u : count;
        if (num == 0 || num > width_ - x) return "a run goes beyond it";
        if (is_run && !take(1, &same)) return kTooShort;
        for (std::size_t i = 0; i < num; ++i, ++x) {
          if (!is_run && !take(1, &same)) return kTooShort;
          texels_[4 * x + c] = same;
        }
      }
    }
    return nullptr;
  }

  const std::array<float, 256> scales_ = exponent_scales();
  std::span<const unsigned char> encoded_;
  std::size_t first_ = 0, next_ = 0;  ///< bytes where the first row begins, and the next
  std::size_t width_ = 0;
  int height_ = 0, next_row_ = 0;
  std::vector<unsigned char> texels_;  ///< of the row before the next, R, G, B, exponent
};

}  // namespace

std::unique_ptr<ImageFile> hdr_file_make(std::span<const unsigned char> encoded)
{
  return header_of(encoded) ? std::make_unique<HdrFile>() : nullptr;
}

}  // namespace relief
