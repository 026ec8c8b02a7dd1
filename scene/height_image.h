// An image as value graphs of heights read it: in the precision that its file has, with bounds of any window.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "kernel/graph/image_bounds.h"
#include "scene/mip_chain.h"
#include "scene/texture_source.h"

namespace relief {

class HeightImage {
 public:
  /// Reads images whose texels are halves once more, as floats; bytes are what they are.
  /// @param source  null: it cannot be read, and is what the store has in its place
  /// @param layout  of its texels elsewhere
  /// @param label   for messages about memory
  /// @error SceneError as of TextureReader; OutOfMemory
  HeightImage(const TextureSource* source, const TexelLayout& layout, const std::string& label);
  HeightImage(const HeightImage&) = delete;
  HeightImage& operator=(const HeightImage&) = delete;

  /// A texture of the image, without coarser levels.
  TextureView view(TextureView texture) const;
  /// The bounds of a texture that `view` gave, made when they are first asked for.
  ImageBounds bounds(const TextureView& texture);
  std::size_t bytes() const;

 private:
  static Vec4f look_up(const void* image, Vec2f uv, float width);

  std::string label_;
  TexelLayout layout_;
  std::vector<float> texels_;  ///< empty: the image is of bytes
  std::vector<std::vector<TexelRange>> levels_;
};

}  // namespace relief
