// PNG, the format of most height maps, by libpng alone: a scene whose images are all PNG or JPEG never loads OpenImageIO, which
// costs a process a quarter of a second and 100 MiB (image_io.h).
#pragma once

#include <memory>

#include "scene/image_io.h"

namespace relief {

/// Values are those that OpenImageIO gives: palettes and depths below 8 bits are expanded to 8, transparent colours become
/// an alpha channel, gamma and profiles are left alone.
std::unique_ptr<ImageFile> png_file_make();

}  // namespace relief
