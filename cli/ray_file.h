// Rays in a file, one 'ox oy oz dx dy dz [tmin tmax]' a line.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "integrator/trace.h"

namespace relief {

/// Kinds of rays, as `relief trace --pixel` prints them in front of a line and a file may have them.
inline constexpr std::string_view kPathRay = "path", kShadowRay = "shadow";

/// @error InputError: a file that cannot be read, or a line with something else in it
std::vector<TraceRay> read_rays(const std::string& file);

}  // namespace relief
