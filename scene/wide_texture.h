// Textures of 32-bit floats: those with values that halves do not hold, such as a sky with its sun. There are few of them, so
// the kernel's look-ups know nothing of them and call a function (TextureView::lookup).
#pragma once

#include <cstring>

#include "kernel/texture/texture.h"
#include "scene/mip_chain.h"

namespace relief {

/// One texel of floats, spread to four lanes as texel_load does.
template <int kChannels>
TexelValue texel_load_wide(const unsigned char* texel)
{
  float v[kChannels];
  std::memcpy(v, texel, sizeof v);
  if constexpr (kChannels == 1) return TexelValue{v[0], v[0], v[0], 1.0f};
  if constexpr (kChannels == 2) return TexelValue{v[0], v[0], v[0], v[1]};
  if constexpr (kChannels == 3) return TexelValue{v[0], v[1], v[2], 1.0f};
  if constexpr (kChannels == 4) return TexelValue{v[0], v[1], v[2], v[3]};
}

/// What a look-up function is handed: texels and a sampler.
struct WideTexture {
  const MipChain* chain = nullptr;  ///< is_wide
  TextureView view;                 ///< of the texels; it has no look-up
};

/// A view whose look-ups read `texture`, which must stay where it is.
TextureView wide_texture_view(const WideTexture& texture);

}  // namespace relief
