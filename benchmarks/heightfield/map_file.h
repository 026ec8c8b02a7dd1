// Height maps of files, as textures of the study.
#pragma once

#include <string>

#include "benchmarks/heightfield/cone_map.h"

namespace relief {

/// An image's heights by means over equal parts of it, brought to 0…1: cones want that range, and maps are seldom calibrated.
/// @param size  texels a side
/// @error SceneError if it cannot be read, or has fewer texels a side
HeightTexture height_texture_load(const std::string& file, int size);

}  // namespace relief
