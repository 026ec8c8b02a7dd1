// OpenEXR, the format of surroundings and of height maps, so that a scene whose images are EXR, HDR, PNG and JPEG never loads
// OpenImageIO (png_file.h).
#pragma once

#include <memory>
#include <span>
#include <string>

#include "scene/image_io.h"

namespace relief {

/// Values, and what is said of them, are those of OpenImageIO. Threads are those of OpenEXR's own pool.
/// @param file     that will be opened, empty if it is embedded
/// @param encoded  its bytes, where it is embedded; must outlive what is returned
/// @return         null: not one flat part whose channels are some of R, G, B and A, or Y alone, all of them halves or all of them
///                 floats; what that means, or what is wrong with it, is left to OpenImageIO
/// @error std::bad_alloc
/// @source "Technical Introduction to OpenEXR"; the names of channels
std::unique_ptr<ImageFile> exr_file_make(const std::string& file, std::span<const unsigned char> encoded);

}  // namespace relief
