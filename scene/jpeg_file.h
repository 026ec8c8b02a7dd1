// JPEG, the format of most textures, by libjpeg alone, so that a scene whose images are JPEG and PNG never loads OpenImageIO
// (png_file.h).
#pragma once

#include <memory>

#include "scene/image_io.h"

namespace relief {

/// Values are those that OpenImageIO gives: profiles and the orientation are left alone. Opens encoded bytes alone.
/// @param encoded  of the file that will be opened
/// @return         null: not of one channel or of three, but CMYK; what that means is left to OpenImageIO
std::unique_ptr<ImageFile> jpeg_file_make(std::span<const unsigned char> encoded);

}  // namespace relief
