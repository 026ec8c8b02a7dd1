// Mip chains: the texels of one texture at all resolutions, in one block of memory.
#pragma once

#include <cstddef>
#include <cstdlib>
#include <memory>

#include "kernel/texture/texture.h"

namespace relief {

/// Size and storage of an image's texels.
struct TexelLayout {
  int width = 0, height = 0;
  int num_channels = 0;  ///< 1 to 4, meant as in TextureView
  TexelFormat format = TexelFormat::kU8;
  /// Channels are 32-bit floats in place of halves, since some value is beyond those: the kernel looks such texels up by a
  /// function (wide_texture.h). The format is kHalf: light, not codes.
  bool is_wide = false;
};

/// Bytes of a texel.
std::size_t texel_layout_bytes(const TexelLayout& layout);

/// Bytes of one row of level 0.
std::size_t texel_row_bytes(const TexelLayout& layout);

/// Number of levels down to 1 × 1.
int mip_num_levels(int width, int height);

/// Bytes of all levels.
std::size_t mip_chain_bytes(const TexelLayout& layout);

/// Owner of a mip chain. Level sizes are those of mip_size.
class MipChain {
 public:
  /// All texels zero. Memory that is never written is not committed by the operating system.
  /// @error std::bad_alloc
  explicit MipChain(const TexelLayout& layout);

  unsigned char* level(int index) { return texels_.get() + offsets_[index]; }
  const unsigned char* level(int index) const { return texels_.get() + offsets_[index]; }
  const TexelLayout& layout() const { return layout_; }
  int num_levels() const { return num_levels_; }
  std::size_t bytes() const { return offsets_[num_levels_]; }

 private:
  struct Free {
    void operator()(unsigned char* block) const { std::free(block); }
  };
  TexelLayout layout_;
  int num_levels_ = 0;
  std::size_t offsets_[kMaxMipLevels + 1] = {};
  std::unique_ptr<unsigned char[], Free> texels_;
};

/// Computes levels 1 and up from level 0, in parallel. A texel is the mean over the area it covers, so that every level
/// has the image's mean: along an odd side it covers parts of texels, with their share. sRGB is averaged in linear light.
/// @cost  one pass over 4/3 of the texels
void mip_chain_build(MipChain& chain);

}  // namespace relief
