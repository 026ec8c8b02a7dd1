// Reading one image as a texture: any format that scene/image_reader.h opens, brought to the few texel formats that the
// kernel knows. Used to fill mip chains, and by the tile cache to read what it needs.
#pragma once

#include <cstdint>
#include <memory>

#include "scene/image_reader.h"
#include "scene/mip_chain.h"
#include "scene/texture_store.h"

namespace relief {

/// An image to be read as a texture. Does not own the bytes.
struct TextureSource : ImageSource {
  TextureColor color = TextureColor::kLinear;
  bool is_wide = false;  ///< what would become half stays a 32-bit float
};

/// What was changed to make an image's values usable.
struct TexelRepairs {
  std::int64_t num_non_finite = 0;  ///< NaN and infinities, became 0
  std::int64_t num_clamped = 0;     ///< beyond the range of half, became ±kHalfMax; none if it is wide
};

/// An open image. The texels' meaning:
/// - 8-bit integers stay as they are (sRGB ones marked so); other integers and floats become half, other sRGB integers
///   are decoded on the way;
/// - 1 channel: grey; 2: grey and alpha, or R and G of RGB if the second is no alpha; 3: RGB; 4: RGBA; of more
///   channels those named R, G, B, A, or else the first three;
/// - colours stay unassociated with alpha where the file has them so, as glTF says, unless the source asks for others.
/// Not for use by several threads at once.
class TextureReader {
 public:
  /// @error SceneError as of ImageReader
  explicit TextureReader(const TextureSource& source);
  ~TextureReader();
  TextureReader(const TextureReader&) = delete;
  TextureReader& operator=(const TextureReader&) = delete;

  const TexelLayout& layout() const;
  /// As of ImageReader.
  int rows_at_once() const;

  /// Reads rows; going from top to bottom is fastest.
  /// @param begin, end  0 <= begin < end <= height
  /// @param texels      (end − begin) rows of texel_row_bytes
  /// @error SceneError: the data is truncated or corrupt
  void read_rows(int begin, int end, unsigned char* texels);

  /// Over all rows read so far.
  const TexelRepairs& repairs() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace relief
