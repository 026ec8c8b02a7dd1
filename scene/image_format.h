// Which format an image has. Its content decides, never its name: among OpenImageIO's readers are some that crash on damaged
// files, and one that makes pictures out of nothing; a name must not lead to them.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>

namespace relief {

/// What the ends of an image's bytes tell.
struct ImageEnds {
  static constexpr std::size_t kHeadBytes = 18, kTailBytes = 18;
  std::span<const unsigned char> head;  ///< kHeadBytes from the start, fewer if there are no more
  std::span<const unsigned char> tail;  ///< likewise at the end
};

/// The formats that are read, for messages.
inline constexpr const char* kImageFormats = "a PNG, JPEG, OpenEXR, HDR, TIFF, BMP, TGA or WebP image";

/// A format, or why there is none.
struct ImageFormat {
  const char* reader = nullptr;  ///< OpenImageIO's name of it; null: not one of kImageFormats
  std::string found;             ///< what it is then: "a GIF image"
};

/// @param name  of the file, empty for embedded bytes: TGA of the first version has no signature, so a file is taken for one
///              if its name ends in .tga and its header makes sense
ImageFormat image_format(const ImageEnds& ends, const std::filesystem::path& name);

}  // namespace relief
