// Within the program relief_voxels: makes what reads OpenVDB's files (voxel_process.h).
#pragma once

#include <memory>

#include "scene/voxel_file.h"

namespace relief {

std::unique_ptr<VoxelFile> openvdb_file_make();

}  // namespace relief
