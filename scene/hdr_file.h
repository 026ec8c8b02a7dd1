// Radiance's HDR, the format of most surroundings, so that a scene whose images are HDR, PNG and JPEG never loads OpenImageIO
// (png_file.h).
#pragma once

#include <memory>

#include "scene/image_io.h"

namespace relief {

/// Values are those that OpenImageIO gives, but for the last bit of some of its powers of two; exposure and primaries of the header
/// are left alone. Opens encoded bytes alone.
/// @param encoded  of the file that will be opened
/// @return         null: not RGBE from the top to the bottom and from left to right, or a header without an end; what that means is
///                 left to OpenImageIO
/// @source Ward 1991, "Real Pixels"; the RGBE format and run lengths of Radiance 2.0
std::unique_ptr<ImageFile> hdr_file_make(std::span<const unsigned char> encoded);

}  // namespace relief
