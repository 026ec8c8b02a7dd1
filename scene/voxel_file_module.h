// Within the module of image_io.h: makes what reads OpenVDB's files.
#pragma once

#include <memory>

#include "scene/voxel_file.h"

namespace relief {

std::unique_ptr<VoxelFile> voxel_file_make();

}  // namespace relief
