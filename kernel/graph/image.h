// Images as Blender's Image Texture reads them: the texel that holds a point, or a linear or cubic filter over what is
// stored; what is outside, alpha, boxes and tiles.
//
// Glossary: a code is what a texel stores, 0…1 for bytes. Cycles filters the codes of 8-bit sRGB images and decodes the
// sum, so that is done here; the coarser levels of a texture are filtered as light, as in texture.h.
#pragma once

#include <cmath>

#include "kernel/texture/texture.h"

namespace relief {

/// How a node reads its image: bits of an immediate.
enum ImageFlags : std::uint16_t {
  kImageClip = 1u << 0,      ///< transparent black outside
  kImageCubic = 1u << 1,     ///< uniform B-spline in place of the texture's filter
  kImageMultiply = 1u << 2,  ///< colours are multiplied by alpha before they are filtered
  kImageDivide = 1u << 3,    ///< and divided by it afterwards
  kImageOpaque = 1u << 4     ///< alpha is 1 inside
};

/// Colour of an image, or a tile, that is missing.
inline constexpr Vec4f kMissingImage{1, 0, 1, 1};

/// Codes of a texel. Textures in the tile cache give light for codes.
RELIEF_KERNEL TexelValue image_texel(const TextureView& texture, int x, int y)
{
  if (texture.lookup != nullptr) {
    const Vec2f centre{(static_cast<float>(x) + 0.5f) / static_cast<float>(texture.width),
                       (static_cast<float>(y) + 0.5f) / static_cast<float>(texture.height)};
    const Vec4f v = texture.lookup(texture.lookup_handle, centre, 0.0f);
    return TexelValue{v.x, v.y, v.z, v.w};
  }
  const std::size_t index =
      static_cast<std::size_t>(y) * static_cast<std::size_t>(texture.width) + static_cast<std::size_t>(x);
  const auto* texel = static_cast<const unsigned char*>(texture.levels[0]) +
                      index * static_cast<std::size_t>(texel_bytes(texture.format, texture.num_channels));
  constexpr auto kU8 = TexelFormat::kU8;
  if (texture.format == TexelFormat::kHalf) {
    switch (texture.num_channels) {
      case 1:
        return texel_load_half<1>(texel);
      case 2:
        return texel_load_half<2>(texel);
      case 3:
        return texel_load_half<3>(texel);
      default:
        return texel_load_half<4>(texel);
    }
  }
  switch (texture.num_channels) {
    case 1:
      return texel_load<kU8, 1>(texel) * texel_scale<kU8>();
    case 2:
      return texel_load<kU8, 2>(texel) * texel_scale<kU8>();
    case 3:
      return texel_load<kU8, 3>(texel) * texel_scale<kU8>();
    default:
      return texel_load<kU8, 4>(texel) * texel_scale<kU8>();
  }
}

/// Index of a texel on one axis, brought inside; −1: clipped.
RELIEF_KERNEL int image_wrap(int i, int size, Wrap wrap, bool clip)
{
  if (i >= 0 && i < size) return i;
  if (clip) return -1;
  if (wrap == Wrap::kClamp) return i < 0 ? 0 : size - 1;
  if (wrap == Wrap::kRepeat) {
    const int rest = i % size;
    return rest < 0 ? rest + size : rest;
  }
  const int period = (i < 0 ? -(i + 1) : i) % (2 * size);
  return period < size ? period : 2 * size - 1 - period;
}

/// A coordinate in texels as a whole number and the rest; beyond the range of int one far away.
RELIEF_KERNEL int image_floor(float x, float* rest)
{
  constexpr float kFar = 1073741824.0f;
  const float bounded = clamp(x, -kFar, kFar);  // NaN: −kFar
  // Negative whole numbers count as the end of the texel before, as in Cycles.
  const int i = static_cast<int>(bounded) - (bounded < 0.0f ? 1 : 0);
  // Where whole numbers are further apart than 1, the end of the texel before would be 2 away.
  *rest = min(bounded - static_cast<float>(i), 1.0f);
  return i;
}

/// Weights of the texels around a point, the first `kTaps / 2 − 1` before its own.
template <int kTaps>
RELIEF_KERNEL void image_weights(float t, float (&w)[kTaps])
{
  if constexpr (kTaps == 1) {
    w[0] = 1.0f;
  } else if constexpr (kTaps == 2) {
    w[0] = 1.0f - t;
    w[1] = t;
  } else {
    // Uniform cubic B-spline.
    const float s = 1.0f - t;
    w[0] = s * s * s / 6.0f;
    w[1] = (0.5f * t - 1.0f) * t * t + 2.0f / 3.0f;
    w[2] = (0.5f * s - 1.0f) * s * s + 2.0f / 3.0f;
    w[3] = t * t * t / 6.0f;
  }
}

/// Codes filtered over kTaps² texels of the finest level.
/// @param u, v  v up
template <int kTaps>
RELIEF_KERNEL TexelValue image_filter(const TextureView& texture, float u, float v, unsigned flags)
{
  constexpr float kHalfTexel = kTaps == 1 ? 0.0f : 0.5f;
  const bool clip = (flags & kImageClip) != 0;
  float tx, ty, wx[kTaps], wy[kTaps];
  const int x0 = image_floor(u * static_cast<float>(texture.width) - kHalfTexel, &tx) - (kTaps - 1) / 2;
  const int y0 = image_floor(v * static_cast<float>(texture.height) - kHalfTexel, &ty) - (kTaps - 1) / 2;
  image_weights<kTaps>(tx, wx);
  image_weights<kTaps>(ty, wy);
  TexelValue sum{};
  for (int j = 0; j < kTaps; ++j) {
    const int y = image_wrap(y0 + j, texture.height, texture.wrap_v, clip);
    if (y < 0) continue;
    for (int i = 0; i < kTaps; ++i) {
      const int x = image_wrap(x0 + i, texture.width, texture.wrap_u, clip);
      if (x < 0) continue;
      TexelValue texel = image_texel(texture, x, texture.height - 1 - y);
      if ((flags & kImageOpaque) != 0) texel[3] = 1.0f;
      if ((flags & kImageMultiply) != 0 && texel[3] < 1.0f) {
        const float alpha = texel[3];
        texel *= TexelValue{alpha, alpha, alpha, 1.0f};
        if (texture.format != TexelFormat::kHalf) {
          // Bytes stay bytes, rounded down; the little more is for products that are whole numbers.
          for (int c = 0; c < 3; ++c) texel[c] = __builtin_floorf(texel[c] * 255.0f + 1e-3f) / 255.0f;
        }
      }
      sum += wx[i] * wy[j] * texel;
    }
  }
  return sum;
}

/// Linear value of an sRGB code between the 256 of a byte.
/// @return  relative error below 1e-6
RELIEF_KERNEL float image_decode(float code)
{
  if (code < 0.04045f) return max(code, 0.0f) / 12.92f;
  if (code > 1.0f) return std::pow((code + 0.055f) / 1.055f, 2.4f);
  // (1 + e)^2.4 from the nearest byte that is above the straight part.
  const int nearest = static_cast<int>(max(11.0f, code * 255.0f + 0.5f));
  const float at = static_cast<float>(nearest) / 255.0f;
  const float e = (code - at) / (at + 0.055f);
  return kLinearFromSrgb8[nearest] * (1.0f + e * (2.4f + e * (1.68f + e * (0.224f - e * 0.0336f))));
}

/// An image at a point as linear RGBA.
/// @param u, v   v up
/// @param width  footprint in units of u and v; 0: the finest level
RELIEF_KERNEL Vec4f image_sample(const TextureView& texture, float u, float v, float width, unsigned flags)
{
  const bool is_nearest = texture.filter == TexelFilter::kNearest, is_cubic = (flags & kImageCubic) != 0;
  const MipSelection mip = is_cubic ? MipSelection{} : mip_select(texture, width);
  Vec4f coarse{};
  if (mip.level > 0 || mip.blend > 0.0f) {
    const bool outside = !(u >= 0.0f && u < 1.0f && v >= 0.0f && v < 1.0f);
    if (outside && (flags & kImageClip) != 0) return {};
    // Two texels: level 1, and nothing of level 2.
    const float texel = 1.0f / __builtin_sqrtf(static_cast<float>(texture.width) * static_cast<float>(texture.height));
    coarse = texture_sample(texture, {u, 1.0f - v}, mip.level > 0 ? width : 2.0f * texel);
    const unsigned alpha = flags & (kImageMultiply | kImageDivide);
    if (alpha == kImageMultiply) coarse = {coarse.x * coarse.w, coarse.y * coarse.w, coarse.z * coarse.w, coarse.w};
    if (alpha == kImageDivide && coarse.w > 0.0f) {
      coarse = {coarse.x / coarse.w, coarse.y / coarse.w, coarse.z / coarse.w, coarse.w};
    }
    if ((flags & kImageOpaque) != 0) coarse.w = 1.0f;
    if (mip.level > 0) return coarse;
  }
  TexelValue value = is_cubic     ? image_filter<4>(texture, u, v, flags)
                     : is_nearest ? image_filter<1>(texture, u, v, flags)
                                  : image_filter<2>(texture, u, v, flags);
  // Images of one channel have none, not even outside.
  const float alpha = texture.num_channels == 1 ? 1.0f : value[3];
  if ((flags & kImageDivide) != 0 && alpha != 1.0f && alpha != 0.0f) value /= alpha;
  if (texture.format == TexelFormat::kU8Srgb && texture.lookup == nullptr) {
    for (int c = 0; c < 3; ++c) value[c] = image_decode(value[c]);
  }
  const Vec4f fine{value[0], value[1], value[2], alpha};
  const float t = mip.blend;
  if (t == 0.0f) return fine;
  return {fine.x + t * (coarse.x - fine.x), fine.y + t * (coarse.y - fine.y), fine.z + t * (coarse.z - fine.z),
          fine.w + t * (coarse.w - fine.w)};
}

/// Shares of the projections along x, y and z of a box for a normal.
/// @param n      not zero
/// @param blend  [0, 1]: how far two sides, and in corners three, reach into each other
RELIEF_KERNEL Vec3f image_box_weights(Vec3f n, float blend)
{
  const Vec3f size{__builtin_fabsf(n.x), __builtin_fabsf(n.y), __builtin_fabsf(n.z)};
  const float sum = size.x + size.y + size.z;
  const float of[3] = {size.x / sum, size.y / sum, size.z / sum};
  const float limit = 0.5f * (1.0f + blend);
  float w[3] = {0, 0, 0};
  // A normal is a point in a triangle whose corners are the axes: near a corner one side alone is seen.
  for (int i = 0; i < 3; ++i) {
    const float a = of[i], b = of[(i + 1) % 3], c = of[(i + 2) % 3];
    if (a > limit * (a + b) && a > limit * (a + c)) {
      w[i] = 1.0f;
      return {w[0], w[1], w[2]};
    }
  }
  if (!(blend > 0.0f)) return {1, 0, 0};
  // Along an edge of it two sides are.
  constexpr int kEdges[3][3] = {{0, 1, 2}, {1, 2, 0}, {0, 2, 1}};
  for (const auto& [i, j, other] : kEdges) {
    if (of[other] < (1.0f - limit) * (of[i] + of[j])) {
      w[i] = clamp((of[i] / (of[i] + of[j]) - 0.5f * (1.0f - blend)) / blend, 0.0f, 1.0f);
      w[j] = 1.0f - w[i];
      return {w[0], w[1], w[2]};
    }
  }
  for (int i = 0; i < 3; ++i) w[i] = ((2.0f - limit) * of[i] + (limit - 1.0f)) / (2.0f * limit - 1.0f);
  return {w[0], w[1], w[2]};
}

/// An image projected onto the sides of a box, none of them mirrored.
/// @param n  normal in the space of the point
RELIEF_KERNEL Vec4f image_box(const TextureView& texture, Vec3f p, Vec3f n, float blend, unsigned flags)
{
  const Vec3f w = image_box_weights(n, blend);
  Vec4f sum{};
  const auto add = [&](float weight, float u, float v) {
    if (!(weight > 0.0f)) return;
    const Vec4f side = image_sample(texture, u, v, 0.0f, flags);
    sum = {sum.x + weight * side.x, sum.y + weight * side.y, sum.z + weight * side.z, sum.w + weight * side.w};
  };
  add(w.x, n.x < 0.0f ? 1.0f - p.y : p.y, p.z);
  add(w.y, n.y > 0.0f ? 1.0f - p.x : p.x, p.z);
  add(w.z, n.z > 0.0f ? 1.0f - p.y : p.y, p.x);
  return sum;
}

inline constexpr int kImageTileColumns = 10;

/// Which tile of a row-major lattice of kImageTileColumns columns a point lies in; −1: in none.
/// @param u, v  become coordinates in the tile; between −1 and 0 is in the first column or row
RELIEF_KERNEL int image_tile(float& u, float& v, int num_rows)
{
  if (!(u > -1.0f && v > -1.0f && u < static_cast<float>(kImageTileColumns) && v < static_cast<float>(num_rows))) {
    return -1;
  }
  const int column = static_cast<int>(u), row = static_cast<int>(v);
  u -= static_cast<float>(column);
  v -= static_cast<float>(row);
  return kImageTileColumns * row + column;
}

}  // namespace relief
