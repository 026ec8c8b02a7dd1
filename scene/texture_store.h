// Textures of a scene: read through OpenImageIO, kept as mip chains in memory, or served by OpenImageIO's tile cache
// above a memory budget.
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "kernel/texture/texture_view.h"
#include "scene/diagnostics.h"

namespace relief {

class KeptImages;     // scene/kept_images.h
class TextureFaults;  // scene/texture_faults.h
struct ImageBounds;   // kernel/graph/image_bounds.h

/// How a texture's numbers are to be read. Of floats sRGB means light all the same, encoded sRGB does not.
enum class TextureColor : std::uint8_t {
  kSrgb,
  kLinear,
  kEncodedSrgb,
  /// Associated: colours are multiplied by alpha, as codes, where the file has them apart from it. So Blender reads images whose
  /// alpha is not used.
  kSrgbAssociated,
  kLinearAssociated,
  kEncodedSrgbAssociated,
  /// Divided: look-ups are divided by alpha. It has to make no difference that codes of more than 8 bits are decoded before.
  kSrgbDivided,
  kEncodedSrgbDivided
};

inline constexpr bool texture_color_is_linear(TextureColor color)
{
  return color == TextureColor::kLinear || color == TextureColor::kLinearAssociated;
}
inline constexpr bool texture_color_is_encoded(TextureColor color)
{
  return color == TextureColor::kEncodedSrgb || color == TextureColor::kEncodedSrgbAssociated ||
         color == TextureColor::kEncodedSrgbDivided;
}
inline constexpr bool texture_color_is_associated(TextureColor color)
{
  return color == TextureColor::kSrgbAssociated || color == TextureColor::kLinearAssociated ||
         color == TextureColor::kEncodedSrgbAssociated;
}
inline constexpr bool texture_color_is_divided(TextureColor color)
{
  return color == TextureColor::kSrgbDivided || color == TextureColor::kEncodedSrgbDivided;
}

/// One texture to be loaded: an image (file, or encoded bytes in memory) with its sampler and its reading.
struct TextureRequest {
  std::filesystem::path file;          ///< empty when `encoded` is used
  std::vector<unsigned char> encoded;  ///< PNG, JPEG, … as found in a buffer view or data URI
  std::string label;                   ///< how messages name it, e.g. "scene.gltf: /images/3 (bark.png)"
  std::string scene_file, json_path;   ///< for SceneError
  TextureColor color = TextureColor::kLinear;
  Wrap wrap_u = Wrap::kRepeat, wrap_v = Wrap::kRepeat;
  TexelFilter filter = TexelFilter::kLinear;
  bool is_missing = false;          ///< magenta, which `faults` knows of
  TextureFaults* faults = nullptr;  ///< hears of what cannot be read, which is magenta then; null: it is an error
  bool of_heights = false;  ///< a value graph of heights reads it: in its own precision, and with bounds
  bool of_vectors = false;  ///< it says where points go: with fewer than three channels it is an error
};

class TextureStore {
 public:
  /// Reads all textures (in parallel). Equal (image, colour) pairs share their texels.
  /// @param budget_bytes  of texels that stay in memory; half of what memory is left, if that is less
  /// @param kept          of the frames before, if there are any
  /// @error SceneError naming the file and JSON path of an image that is missing, unreadable or absurdly large, unless its
  ///        request has someone to hear of it
  TextureStore(std::vector<TextureRequest> requests,
               std::size_t budget_bytes,
               Warnings& warnings,
               KeptImages* kept = nullptr);
  ~TextureStore();
  TextureStore(const TextureStore&) = delete;
  TextureStore& operator=(const TextureStore&) = delete;

  /// Adds an image that was computed; it is never served by the tile cache.
  /// @param rgb  linear, rows from the top, 3 × width × height; kept at half precision, unless a value is beyond it
  /// @return     its index
  int add_image(std::string label, int width, int height, std::span<const float> rgb, Wrap wrap_u, Wrap wrap_v);

  std::span<const TextureView> views() const;
  /// What value graphs of heights read in the place of these; others are as there.
  std::span<const TextureView> height_views() const;
  /// Of each texture; those that no heights read have none.
  std::span<const ImageBounds> height_bounds() const;
  std::size_t bytes() const;        ///< resident texels
  bool is_cached(int index) const;  ///< served by the tile cache
  const std::string& label(int index) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace relief
