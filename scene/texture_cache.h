// Textures that do not fit the memory budget: OpenImageIO's tile cache reads their texels as they are needed, through
// TextureReader; filtering is the kernel's own, so that a texture looks the same here as in memory.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "scene/texture_source.h"

namespace relief {

/// Tile cache with a bound on its memory. Look-ups are thread safe; adding is not.
class TextureCache {
 public:
  explicit TextureCache(std::size_t budget_bytes);
  /// @pre  no view that came from add is used any more
  ~TextureCache();
  TextureCache(const TextureCache&) = delete;
  TextureCache& operator=(const TextureCache&) = delete;

  /// Makes an image available; its texels are read on demand, its mip levels are made on demand. sRGB texels are cached
  /// as linear halves, so that levels are averaged in linear light. Sides of levels round down here, not up.
  /// @param source  kept; its encoded bytes must outlive the cache
  /// @return        index for view()
  /// @error         SceneError
  std::size_t add(const TextureSource& source);

  /// View of an image with a sampler; valid as long as the cache. A tile that can no longer be read, because the file was
  /// taken away meanwhile, is black.
  TextureView view(std::size_t index, Wrap wrap_u, Wrap wrap_v, TexelFilter filter);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace relief
