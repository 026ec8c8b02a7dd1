// What decoders of images allocate, told by the first bytes of a file before any of them sees it: three hundred bytes can
// announce 65535 x 65535 texels, and some decoders allocate for all of them when they open a file.
#pragma once

#include <cstdint>
#include <fstream>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "scene/image_io.h"

namespace relief {

/// Any bytes of a file, or of an image in memory.
class ImageBytes {
 public:
  virtual ~ImageBytes() = default;
  /// @return  false: there are no such bytes
  virtual bool read(std::uint64_t offset, std::span<unsigned char> bytes) = 0;
};

/// Those of a file.
class BytesOfFile final : public ImageBytes {
 public:
  explicit BytesOfFile(const std::string& file) : stream_(file, std::ios::binary) {}
  bool read(std::uint64_t offset, std::span<unsigned char> bytes) override;

 private:
  std::ifstream stream_;
  std::uint64_t position_ = 0;
};

/// Upper bound, up to small change, for what a decoder allocates while an image is open.
/// @param reader  OpenImageIO's name of the format; of TIFF see below
/// @return        0 for headers that make no sense: their decoders refuse them. Nothing: an OpenEXR file that ends before its
///                headers do. Its decoder would allocate the gigabytes that a text in them claims before it says so
/// @source JPEG: ITU T.81, annex B. PNG: W3C PNG, section 11.2.1. OpenEXR: "OpenEXR File Layout". WebP: RFC 9649, section 2.
///         TGA, BMP: their specifications. What is allocated: libjpeg-turbo 2.1, libpng 1.6, OpenEXR 3.1, OpenImageIO 2.4.
std::optional<std::uint64_t> decoder_bytes(std::string_view reader, ImageBytes& bytes);

/// Likewise for formats that open without allocating much, by what they say then: tiles and strips of TIFF.
std::uint64_t decoder_block_bytes(const ImageHeader& header);

}  // namespace relief
