// A lattice of numbers as kernels see it: see voxels.h.
#pragma once

#include <cstdint>

#include "kernel/math/affine.h"

namespace relief {

inline constexpr int kBrickSize = 8;
inline constexpr std::size_t kBrickVoxels = 512;

/// Least and largest of some values, number by number; one stands in all three.
struct VoxelRange {
  Vec3f low, high;
};

/// Brick 0 is the background. In the table and in a brick z runs fastest.
struct VoxelView {
  const std::uint32_t* bricks = nullptr;  ///< by place: number of its brick
  const std::uint16_t* values = nullptr;  ///< halves of all bricks, one after the other
  const VoxelRange* ranges = nullptr;     ///< by brick
  int first[3] = {}, count[3] = {};       ///< the table's corner and size, in bricks
  int channels = 1;                       ///< 1 or 3
  VoxelRange range = {};                  ///< of all bricks
  Affine3 lattice_from_object = {};
};

}  // namespace relief
