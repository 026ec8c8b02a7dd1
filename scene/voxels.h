// Grids of numbers, of OpenVDB's files or of images, in memory as value graphs read them (kernel/graph/voxels.h).
#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "kernel/graph/voxel_view.h"
#include "scene/image_reader.h"

namespace relief {

/// Owner of what a VoxelView looks at.
struct Voxels {
  std::vector<std::uint32_t> bricks;
  std::unique_ptr<std::uint16_t[]> values;
  std::vector<VoxelRange> ranges;
  VoxelView view;  ///< values stand where the lattice's whole numbers are, as OpenVDB has it
};

/// Reads one grid. Values are kept as halves: what is beyond 65504 counts as that.
/// @param scene_file, json_path  who asks, for messages
/// @error SceneError: no such grid, a truncated file, a transform without an inverse; OutOfMemory; what is wrong with the module
/// @cost  1 KiB for 8 × 8 × 8 values, some of which the file has, and 4 bytes for each such cube in the box of all
std::shared_ptr<const Voxels> voxels_load(const std::filesystem::path& file,
                                          const std::string& grid,
                                          const std::string& scene_file,
                                          const std::string& json_path);

/// Reads a grid from an image of slices: each of a size in its first two numbers, as many as the third one says. They follow one
/// another from left to right and row by row from the bottom; so do values in them. Values stand where the lattice's whole numbers
/// are, and object space reaches from 0 to 1 over as many of them as there are.
/// @param source  of the image, whose values are taken as they are, of one channel or of the first three
/// @error SceneError: as ImageReader; an image that does not hold these slices; OutOfMemory
std::shared_ptr<const Voxels> voxels_load_slices(const ImageSource& source, const std::array<int, 3>& size);

/// Those of a view whose values stand in the middle of the lattice's cells instead, as in Blender before 5.0.
VoxelView voxels_centered(const VoxelView& view);

}  // namespace relief
