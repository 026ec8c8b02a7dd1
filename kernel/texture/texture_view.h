// What the kernel needs to know of a texture: plain data, no ownership. Look-ups are in texture.h.
#pragma once

#include <cstdint>

#include "kernel/math/vec.h"

namespace relief {

enum class Wrap : std::uint8_t { kRepeat, kMirror, kClamp };
enum class TexelFilter : std::uint8_t { kNearest, kLinear };
/// Storage of one channel. kU8Srgb is decoded to linear by a 256-entry table at look-up; alpha is always linear.
enum class TexelFormat : std::uint8_t { kU8, kU8Srgb, kHalf };

inline constexpr int kMaxMipLevels = 20;

/// One texture: a mip chain in memory, or a handle into an external tile cache.
///
/// Texel (0, 0) is the top-left one; uv (0, 0) is the top-left *corner* of the image (glTF), so the centre of texel
/// (i, j) of level l lies at ((i + ½)/width_l, (j + ½)/height_l). Level l + 1 has max(1, ceil(size_l / 2)) texels a side.
struct TextureView {
  /// Looks a texel footprint up in a cache outside the kernel.
  /// @param uv     texture space, before wrapping
  /// @param width  footprint, in uv units (0: finest level)
  using Lookup = Vec4f (*)(const void* handle, Vec2f uv, float width);

  const void* levels[kMaxMipLevels] = {};  ///< row-major texels, `num_channels` interleaved; null when cached
  int width = 0, height = 0;               ///< level 0, texels
  int num_levels = 0;
  int num_channels = 0;  ///< 1…4; missing colour channels repeat the first (1, 2: grey, grey+alpha), alpha is 1
  TexelFormat format = TexelFormat::kU8;
  TexelFilter filter = TexelFilter::kLinear;
  Wrap wrap_u = Wrap::kRepeat, wrap_v = Wrap::kRepeat;
  Lookup lookup = nullptr;  ///< non-null: the texture lives in a cache and `levels` is empty
  const void* lookup_handle = nullptr;
};

/// Use of a texture by a material: which one, which uv set, and KHR_texture_transform as a 2×3 matrix
/// (uv_texture = (m00 u + m01 v + m02, m10 u + m11 v + m12)).
struct TextureRef {
  int texture_index = -1;  ///< −1: absent
  int uv_set = 0;          ///< 0 or 1
  float m00 = 1, m01 = 0, m02 = 0, m10 = 0, m11 = 1, m12 = 0;
};

}  // namespace relief
