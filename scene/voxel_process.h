// Grids of .vdb files, read by a program of its own, relief_voxels. Bytes that were changed within such a file can make OpenVDB write
// where it must not: it trusts sizes and masks that it reads, and one byte of 300 crashes it. What crashes then is that program, and
// relief says in a line which file is to blame. It is started for a grid and ends with it; without .vdb files there is none.
#pragma once

#include <memory>

#include "scene/voxel_file.h"

namespace relief {

/// A reader of .vdb files. Its program is started by `open`; if there is none, that is what `open` says.
std::unique_ptr<VoxelFile> voxel_process_make();

}  // namespace relief
