// What relief needs of OpenVDB, behind an interface without its types: one grid of a file, as bricks (kernel/graph/voxels.h).
// The library is in a program of its own, as broken files can make it crash (voxel_process.h).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "kernel/graph/voxel_view.h"

namespace relief {

/// What a grid says of itself.
struct VoxelHeader {
  bool is_known = false;           ///< false: the file has no grid of the name, or one of something else than numbers
  std::vector<std::string> grids;  ///< of those that the file has, each with its type
  std::uint64_t num_voxels = 0;    ///< with values, as the file says; 0: it does not
  int channels = 1;                ///< 1 or 3
  double object_from_lattice[4][3] = {};  ///< images of the three axes and of the origin
  /// From here on known when the tree is: the table's corner and size, in bricks, and how many bricks differ, the background among them.
  std::int64_t first[3] = {}, count[3] = {};
  std::uint64_t num_bricks = 0;
};

/// Not for use by several threads at once. What is wrong is a text; empty: nothing is.
class VoxelFile {
 public:
  virtual ~VoxelFile() = default;

  /// Reads what the file has, and nothing of size.
  virtual std::string open(const std::string& file, const std::string& grid, VoxelHeader& header) = 0;

  /// Reads where the grid has values. After `open` that knew it.
  virtual std::string read_tree(VoxelHeader& header) = 0;

  /// Reads the values. Once, after `read_tree`.
  /// @param bricks  the table, filled with 0
  /// @param values  room for those of all bricks, as halves
  virtual std::string read_values(std::uint32_t* bricks, std::uint16_t* values) = 0;
};

}  // namespace relief
