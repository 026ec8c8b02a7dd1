// Intel's Open Image Denoise, if this machine has it: its library is loaded when it is asked for.
#pragma once

#include <string>
#include <vector>

#include "denoise/image.h"

namespace relief {

/// Names under which the library is looked for, the newest version first.
std::vector<std::string> oidn_library_names();

/// Fails now if there is no library to be used.
/// @error as for denoise_oidn
void oidn_require();

/// Denoises a picture by Open Image Denoise, with albedo and normals. To know its error the halves are denoised as well.
/// @error std::runtime_error if there is no such library, with the names that were looked for; if it lacks a function; and
///        with its own words if it fails
/// @source its C API, https://www.openimagedenoise.org/documentation.html
DenoiseResult denoise_oidn(const DenoiseInput& input);

}  // namespace relief
