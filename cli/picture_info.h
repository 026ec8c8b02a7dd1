// What `relief info` prints of a picture.
#pragma once

#include <string>

namespace relief {

/// Whether a file begins as OpenEXR does.
bool is_exr_file(const std::string& file);

/// Prints a picture's size, its layers and all that is written down in it. @return exit code @error InputError
int picture_info(const std::string& file);

}  // namespace relief
