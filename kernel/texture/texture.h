// Texture look-ups: wrap modes, level of detail, bilinear and trilinear filtering. Read mip_select (which levels),
// then axis_linear (which texels, one axis), then texture_sample, which dispatches on the storage once a look-up.
//
// The pieces are public because the tile cache in scene/ filters with them too, so that a texture looks the same
// wherever its texels live.
#pragma once

#include <cstddef>

#include "kernel/assert.h"
#include "kernel/texture/half.h"
#include "kernel/texture/srgb_table.h"
#include "kernel/texture/texture_view.h"

namespace relief {

/// Four lanes that the compiler keeps in one register: R, G, B, A of a texel.
using TexelValue = float __attribute__((vector_size(16)));
using TexelCode = int __attribute__((vector_size(16)));

/// Size of a mip level along one side.
/// @param size   texels at level 0, > 0
/// @param level  >= 0
/// @return       ceil(size / 2^level): the repeated halving of TextureView
RELIEF_KERNEL int mip_size(int size, int level)
{
  return static_cast<int>((static_cast<std::int64_t>(size) + (std::int64_t{1} << level) - 1) >> level);
}

/// Two neighbouring mip levels and the share of the coarser one.
struct MipSelection {
  int level = 0;    ///< the finer one
  float blend = 0;  ///< weight of level + 1, in [0, 1); 0 if there is no such level
};

/// Mip levels for a footprint.
/// @param footprint  width in uv units; <= 0 or NaN: finest level
/// @return           level floor(log2 w) for a footprint of w texels. The blend grows linearly with w between two
///                   levels instead of with log2 w: at most 0.09 apart, and it needs no logarithm
/// @cost             a square root
RELIEF_KERNEL MipSelection mip_select(int width, int height, int num_levels, float footprint)
{
  if (!(footprint > 0.0f)) {
    return {};
  }
  // The footprint is a mean over directions, so it is measured in mean texels: those of non-square images are usually
  // square on the surface.
  const float texels = footprint * __builtin_sqrtf(static_cast<float>(width) * static_cast<float>(height));
  if (!(texels > 1.0f)) {
    return {};
  }
  const std::uint32_t bits = __builtin_bit_cast(std::uint32_t, texels);
  const int level = static_cast<int>(bits >> 23) - 127;
  if (level >= num_levels - 1) {
    return {num_levels - 1, 0.0f};
  }
  return {level, static_cast<float>(bits & 0x7fffffu) * 0x1p-23f};
}

/// A coordinate brought into [0, 1] by the wrap mode; NaN and infinity give 0.
RELIEF_KERNEL float wrap_coordinate(float u, Wrap wrap)
{
  if (wrap == Wrap::kRepeat) {
    u -= __builtin_floorf(u);
  } else if (wrap == Wrap::kMirror) {
    const float period = u - 2.0f * __builtin_floorf(0.5f * u);
    u = period <= 1.0f ? period : 2.0f - period;
  }
  return clamp(u, 0.0f, 1.0f);
}

/// The two texels along one axis whose centres enclose a coordinate.
struct AxisTexels {
  int i0 = 0, i1 = 0;  ///< both in [0, size)
  float t = 0;         ///< weight of i1, in [0, 1)
};

/// @param u  texture space, before wrapping; any float
RELIEF_KERNEL AxisTexels axis_linear(float u, int size, Wrap wrap)
{
  // Half a texel is added, not subtracted: the sum is positive, so that truncation is the floor.
  const float x = wrap_coordinate(u, wrap) * static_cast<float>(size) + 0.5f;
  const int i = static_cast<int>(x);
  const int low_neighbour = wrap == Wrap::kRepeat ? size - 1 : 0;
  const int high_neighbour = wrap == Wrap::kRepeat ? 0 : size - 1;
  return {i > 0 ? i - 1 : low_neighbour, i < size ? i : high_neighbour, x - static_cast<float>(i)};
}

/// The texel along one axis that contains a coordinate.
RELIEF_KERNEL int axis_nearest(float u, int size, Wrap wrap)
{
  const int i = static_cast<int>(wrap_coordinate(u, wrap) * static_cast<float>(size));
  return i < size ? i : size - 1;
}

inline constexpr int texel_bytes(TexelFormat format, int num_channels)
{
  return num_channels * (format == TexelFormat::kHalf ? 2 : 1);
}

/// One texel of halves, spread to four lanes.
template <int kChannels>
RELIEF_KERNEL TexelValue texel_load_half(const unsigned char* texel)
{
  // Assembled in a register: through an array in memory, narrow stores before a wide load stall.
  constexpr std::uint64_t kOpaque = std::uint64_t{0x3c00} << 48;
  constexpr std::uint64_t kThreeTimes = 0x000100010001;
  std::uint64_t bits = 0;
  std::uint32_t low = 0;
  std::uint16_t last = 0;
  if constexpr (kChannels == 4) {
    __builtin_memcpy(&bits, texel, 8);
  } else if constexpr (kChannels == 3) {
    __builtin_memcpy(&low, texel, 4);
    __builtin_memcpy(&last, texel + 4, 2);
    bits = low | (static_cast<std::uint64_t>(last) << 32) | kOpaque;
  } else if constexpr (kChannels == 2) {
    __builtin_memcpy(&low, texel, 4);
    bits = (low & 0xffff) * kThreeTimes | (static_cast<std::uint64_t>(low >> 16) << 48);
  } else {
    __builtin_memcpy(&last, texel, 2);
    bits = last * kThreeTimes | kOpaque;
  }
#ifdef __F16C__
  return _mm_cvtph_ps(_mm_cvtsi64_si128(static_cast<long long>(bits)));
#else
  const auto lane = [bits](int shift) { return float_from_half(static_cast<std::uint16_t>(bits >> shift)); };
  return TexelValue{lane(0), lane(16), lane(32), lane(48)};
#endif
}

/// One texel before its scale: codes 0 to 255 stay as they are, because filtering is linear and one multiplication by
/// texel_scale at the end is cheaper than four here.
template <TexelFormat kFormat, int kChannels>
RELIEF_KERNEL TexelValue texel_load(const unsigned char* texel)
{
  if constexpr (kFormat == TexelFormat::kHalf) {
    return texel_load_half<kChannels>(texel);
  } else {
    constexpr bool kHasAlpha = kChannels == 2 || kChannels == 4;
    const int r = texel[0];
    const int g = kChannels >= 3 ? texel[1] : r;
    const int b = kChannels >= 3 ? texel[2] : r;
    const int a = kHasAlpha ? texel[kChannels - 1] : 255;
    if constexpr (kFormat == TexelFormat::kU8Srgb) {
      return TexelValue{kLinearFromSrgb8[r], kLinearFromSrgb8[g], kLinearFromSrgb8[b], static_cast<float>(a)};
    } else {
      return __builtin_convertvector((TexelCode{r, g, b, a}), TexelValue);
    }
  }
}

/// What a filtered sum of texel_load has to be multiplied by.
template <TexelFormat kFormat>
RELIEF_KERNEL TexelValue texel_scale()
{
  constexpr float kByte = 1.0f / 255.0f;
  if constexpr (kFormat == TexelFormat::kU8) {
    return TexelValue{kByte, kByte, kByte, kByte};
  } else if constexpr (kFormat == TexelFormat::kU8Srgb) {
    return TexelValue{1.0f, 1.0f, 1.0f, kByte};
  } else {
    return TexelValue{1.0f, 1.0f, 1.0f, 1.0f};
  }
}

/// Interpolates four texels; equal texels give exactly their value.
RELIEF_KERNEL TexelValue
texel_bilinear(TexelValue v00, TexelValue v10, TexelValue v01, TexelValue v11, float tx, float ty)
{
  const TexelValue top = v00 + tx * (v10 - v00);
  const TexelValue bottom = v01 + tx * (v11 - v01);
  return top + ty * (bottom - top);
}

/// One level of a texture in memory, filtered as the view says, before texel_scale.
/// @param level  in [0, num_levels)
template <TexelFormat kFormat, int kChannels>
RELIEF_KERNEL TexelValue texture_sample_level(const TextureView& texture, int level, Vec2f uv)
{
  const int width = mip_size(texture.width, level);
  const int height = mip_size(texture.height, level);
  constexpr std::size_t kBytes = static_cast<std::size_t>(texel_bytes(kFormat, kChannels));
  const auto* texels = static_cast<const unsigned char*>(texture.levels[level]);
  const std::size_t pitch = static_cast<std::size_t>(width) * kBytes;
  const auto row = [&](int y) { return texels + static_cast<std::size_t>(y) * pitch; };
  if (texture.filter == TexelFilter::kNearest) {
    const int x = axis_nearest(uv.x, width, texture.wrap_u);
    return texel_load<kFormat, kChannels>(row(axis_nearest(uv.y, height, texture.wrap_v)) +
                                          static_cast<std::size_t>(x) * kBytes);
  }
  const AxisTexels x = axis_linear(uv.x, width, texture.wrap_u);
  const AxisTexels y = axis_linear(uv.y, height, texture.wrap_v);
  const std::size_t x0 = static_cast<std::size_t>(x.i0) * kBytes;
  const std::size_t x1 = static_cast<std::size_t>(x.i1) * kBytes;
  const unsigned char* row0 = row(y.i0);
  const unsigned char* row1 = row(y.i1);
  return texel_bilinear(texel_load<kFormat, kChannels>(row0 + x0), texel_load<kFormat, kChannels>(row0 + x1),
                        texel_load<kFormat, kChannels>(row1 + x0), texel_load<kFormat, kChannels>(row1 + x1), x.t, y.t);
}

/// Mip levels for a footprint as the texture's filter uses them: a nearest filter also takes one level, the nearer.
RELIEF_KERNEL MipSelection mip_select(const TextureView& texture, float footprint)
{
  const MipSelection mip = mip_select(texture.width, texture.height, texture.num_levels, footprint);
  return texture.filter == TexelFilter::kLinear ? mip : MipSelection{mip.level + (mip.blend >= 0.5f ? 1 : 0), 0.0f};
}

template <TexelFormat kFormat, int kChannels>
RELIEF_KERNEL Vec4f texture_sample_resident(const TextureView& texture, Vec2f uv, float width)
{
  const MipSelection mip = mip_select(texture, width);
  TexelValue value = texture_sample_level<kFormat, kChannels>(texture, mip.level, uv);
  if (mip.blend > 0.0f) {
    value += mip.blend * (texture_sample_level<kFormat, kChannels>(texture, mip.level + 1, uv) - value);
  }
  value *= texel_scale<kFormat>();
  return {value[0], value[1], value[2], value[3]};
}

/// Filtered value of a texture, linear: grey textures have R = G = B, textures without alpha A = 1.
/// @param texture  with at least one level, or a look-up function
/// @param uv       texture space (see TextureView), before wrapping; any float: non-finite coordinates read some texel
/// @param width    footprint's width in uv units, a mean over directions; <= 0 or NaN: finest level
/// @return         finite if the texels are; u8 formats in [0, 1]
/// @cost           four texels, eight between two levels. 2k sRGB RGBA on one core of an AVX2 machine, nanoseconds:
///                 coherent 10, incoherent 16; between levels 24 and 33. Not inlined: all storages copied into a
///                 caller's loop took 22 instead of 9 for most of them
[[gnu::noinline]] RELIEF_KERNEL Vec4f texture_sample(const TextureView& texture, Vec2f uv, float width)
{
  if (texture.lookup != nullptr) {
    return texture.lookup(texture.lookup_handle, uv, width);
  }
  RELIEF_ASSERT(texture.num_levels > 0 && texture.num_channels >= 1 && texture.num_channels <= 4);
  constexpr auto kU8 = TexelFormat::kU8;
  constexpr auto kU8Srgb = TexelFormat::kU8Srgb;
  constexpr auto kHalf = TexelFormat::kHalf;
  switch (4 * static_cast<int>(texture.format) + texture.num_channels - 1) {
    case 0:
      return texture_sample_resident<kU8, 1>(texture, uv, width);
    case 1:
      return texture_sample_resident<kU8, 2>(texture, uv, width);
    case 2:
      return texture_sample_resident<kU8, 3>(texture, uv, width);
    case 3:
      return texture_sample_resident<kU8, 4>(texture, uv, width);
    case 4:
      return texture_sample_resident<kU8Srgb, 1>(texture, uv, width);
    case 5:
      return texture_sample_resident<kU8Srgb, 2>(texture, uv, width);
    case 6:
      return texture_sample_resident<kU8Srgb, 3>(texture, uv, width);
    case 7:
      return texture_sample_resident<kU8Srgb, 4>(texture, uv, width);
    case 8:
      return texture_sample_resident<kHalf, 1>(texture, uv, width);
    case 9:
      return texture_sample_resident<kHalf, 2>(texture, uv, width);
    case 10:
      return texture_sample_resident<kHalf, 3>(texture, uv, width);
    default:
      return texture_sample_resident<kHalf, 4>(texture, uv, width);
  }
}

/// Texture coordinates after KHR_texture_transform.
/// @param uv  the mesh's coordinates of the set that `ref` names
RELIEF_KERNEL Vec2f texture_ref_uv(const TextureRef& ref, Vec2f uv)
{
  return {ref.m00 * uv.x + ref.m01 * uv.y + ref.m02, ref.m10 * uv.x + ref.m11 * uv.y + ref.m12};
}

/// Footprint after KHR_texture_transform.
/// @param width  footprint in the mesh's uv units
/// @return       in the texture's uv units: scaled by the mean over directions, the root of the area's scale
RELIEF_KERNEL float texture_ref_width(const TextureRef& ref, float width)
{
  return width * __builtin_sqrtf(__builtin_fabsf(difference_of_products(ref.m00, ref.m11, ref.m01, ref.m10)));
}

}  // namespace relief
