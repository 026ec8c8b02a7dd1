// Least and largest values of the texels of an image in windows of it: what bounds of a graph's image are made of.
//
// A pyramid whose finest blocks are 8 × 8 texels, each coarser one two by two of these. Small windows are looked at texel by texel.
#pragma once

#include "kernel/graph/image.h"

namespace relief {

/// Least and largest of some texels, channel by channel: codes where the texture has codes, as image_texel gives them.
struct TexelRange {
  TexelValue low, high;
};

inline constexpr int kImageBoundsBlock = 8;

/// The pyramid of one texture, without ownership. Level k + 1 has half the blocks a side of level k, rounded up.
struct ImageBounds {
  const TexelRange* levels[kMaxMipLevels] = {};
  int num_levels = 0;  ///< 0: there is no pyramid, and nothing is known
};

/// Blocks of a level along a side.
RELIEF_KERNEL int image_bounds_size(int texels, int level)
{
  return mip_size((texels + kImageBoundsBlock - 1) / kImageBoundsBlock, level);
}

RELIEF_KERNEL TexelRange texel_hull(const TexelRange& a, const TexelRange& b)
{
  return {a.low < b.low ? a.low : b.low, a.high > b.high ? a.high : b.high};
}

RELIEF_KERNEL TexelRange texel_range_of_nothing()
{
  const float most = kInfinity;
  return {TexelValue{most, most, most, most}, TexelValue{-most, -most, -most, -most}};
}

/// Texels of an axis from first to last, both within.
struct TexelSpan {
  int first, last;
};

/// The texels that indices before wrapping stand for: one span or two.
/// @param first, last  first <= last; within ±2³⁰
/// @return             how many
RELIEF_KERNEL int texel_spans(int first, int last, int size, Wrap wrap, TexelSpan (&spans)[2])
{
  spans[0] = {0, size - 1};
  if (wrap == Wrap::kClamp) {
    spans[0] = {first < 0 ? 0 : first < size ? first : size - 1, last < 0 ? 0 : last < size ? last : size - 1};
    return 1;
  }
  if (last - first >= size - 1) return 1;
  if (wrap == Wrap::kRepeat) {
    const int begin = image_wrap(first, size, wrap, false), end = begin + (last - first);
    spans[0] = {begin, end < size ? end : size - 1};
    spans[1] = {0, end - size};
    return end < size ? 1 : 2;
  }
  // Between two mirrors indices run one way; where one is passed, its texel is there as well.
  const int a = image_wrap(first, size, wrap, false), b = image_wrap(last, size, wrap, false);
  const auto mirrors_before = [size](int i) { return i >= 0 ? i / size : -((-(i + 1)) / size) - 1; };
  spans[0] = {a < b ? a : b, a < b ? b : a};
  if (mirrors_before(first) != mirrors_before(last)) {
    // The mirror lies at the end of an even period, or at the start of it.
    if (mirrors_before(first) % 2 == 0) {
      spans[0].last = size - 1;
    } else {
      spans[0].first = 0;
    }
  }
  return 1;
}

/// Range of the texels of a window.
/// @param x, y  both ends within; y counts from the top
RELIEF_KERNEL TexelRange image_window_range(const TextureView& texture,
                                            const ImageBounds& bounds,
                                            TexelSpan x,
                                            TexelSpan y)
{
  constexpr int kMostSingle = 12;
  TexelRange out = texel_range_of_nothing();
  const int width = x.last - x.first + 1, height = y.last - y.first + 1;
  if (width <= kMostSingle && height <= kMostSingle) {
    for (int row = y.first; row <= y.last; ++row) {
      for (int column = x.first; column <= x.last; ++column) {
        const TexelValue texel = image_texel(texture, column, row);
        out = texel_hull(out, {texel, texel});
      }
    }
    return out;
  }
  // At most four blocks along the longer side, five with what is cut off at both ends.
  const int longer = width > height ? width : height;
  int level = 0;
  while (level + 1 < bounds.num_levels && (kImageBoundsBlock << level) * 4 < longer) ++level;
  const int shift = level + 3, columns = image_bounds_size(texture.width, level);
  static_assert(kImageBoundsBlock == 1 << 3);
  for (int row = y.first >> shift; row <= y.last >> shift; ++row) {
    for (int column = x.first >> shift; column <= x.last >> shift; ++column) {
      out = texel_hull(out, bounds.levels[level][static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
                                                 static_cast<std::size_t>(column)]);
    }
  }
  return out;
}

/// Bounds of an image's linear RGBA over a rectangle of coordinates, whatever footprint it is read with.
/// @param u, v   low and high, v up; infinite where nothing is known
/// @param flags  ImageFlags
/// @return       low above high nowhere; infinite where colours are divided by opacities that may be 0
RELIEF_KERNEL TexelRange image_range(const TextureView& texture,
                                     const ImageBounds& bounds,
                                     const float (&u)[2],
                                     const float (&v)[2],
                                     bool is_finest,
                                     unsigned flags)
{
  constexpr float kFar = 1e6f;  // beyond, coordinates in texels lose their digits
  const bool is_known = is_finest && u[0] >= -kFar && u[1] <= kFar && v[0] >= -kFar && v[1] <= kFar;
  const auto indices = [&](const float(&range)[2], int size) -> TexelSpan {
    // The texels of cubic filters, and one more for rounding.
    constexpr int kTaps = 3;
    const auto place = [size](float at) { return static_cast<int>(__builtin_floorf(at * static_cast<float>(size))); };
    return {place(range[0]) - kTaps, place(range[1]) + kTaps};
  };
  const TexelSpan x = is_known ? indices(u, texture.width) : TexelSpan{0, texture.width - 1};
  const TexelSpan up = is_known ? indices(v, texture.height) : TexelSpan{0, texture.height - 1};
  const TexelSpan y = {texture.height - 1 - up.last, texture.height - 1 - up.first};
  TexelRange out = texel_range_of_nothing();
  TexelSpan columns[2], rows[2];
  const int num_columns = texel_spans(x.first, x.last, texture.width, texture.wrap_u, columns);
  const int num_rows = texel_spans(y.first, y.last, texture.height, texture.wrap_v, rows);
  for (int i = 0; i < num_columns; ++i) {
    for (int j = 0; j < num_rows; ++j) out = texel_hull(out, image_window_range(texture, bounds, columns[i], rows[j]));
  }
  const bool is_inside = is_known && x.first >= 0 && x.last < texture.width && y.first >= 0 && y.last < texture.height;
  if ((flags & kImageOpaque) != 0) out.low[3] = out.high[3] = 1.0f;
  // Products with an opacity: of some filters the mean of products, which lies between products of the ends.
  if ((flags & kImageMultiply) != 0) {
    const float alphas[2] = {out.low[3] < 1.0f ? out.low[3] : 1.0f, out.high[3] < 1.0f ? out.high[3] : 1.0f};
    for (int c = 0; c < 3; ++c) {
      const float p[4] = {out.low[c] * alphas[0], out.low[c] * alphas[1], out.high[c] * alphas[0],
                          out.high[c] * alphas[1]};
      out.low[c] =
          min(min(p[0], p[1]), min(p[2], p[3])) - (texture.format != TexelFormat::kHalf ? 1.0f / 255.0f : 0.0f);
      out.high[c] = max(max(p[0], p[1]), max(p[2], p[3])) + 1e-5f;  // by which whole numbers of bytes are made good for
    }
  }
  if ((flags & kImageClip) != 0 && !is_inside) out = texel_hull(out, {TexelValue{}, TexelValue{}});
  // Images of one channel have no opacity, not even outside.
  if (texture.num_channels == 1) out.low[3] = out.high[3] = 1.0f;
  if ((flags & kImageDivide) != 0) {
    const bool has_quotient = out.low[3] > 0.0f;
    for (int c = 0; c < 3; ++c) {
      const float p[4] = {out.low[c] / out.low[3], out.low[c] / out.high[3], out.high[c] / out.low[3],
                          out.high[c] / out.high[3]};
      out.low[c] = has_quotient ? min(min(p[0], p[1]), min(p[2], p[3])) : -kInfinity;
      out.high[c] = has_quotient ? max(max(p[0], p[1]), max(p[2], p[3])) : kInfinity;
    }
  }
  if (texture.format == TexelFormat::kU8Srgb && texture.lookup == nullptr) {
    for (int c = 0; c < 3; ++c) {
      out.low[c] = image_decode(out.low[c]);
      out.high[c] = image_decode(out.high[c]);
    }
  }
  return out;
}

}  // namespace relief
