// Which corners and edges of a displaced mesh's triangles are at the same place and move along the same normals. Vertices
// do not tell: along a texture seam a mesh has two of each.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "displacement/displaced_triangle.h"

namespace relief {

/// Numbers the distinct (P, N) of all corners.
/// @return  for corner 3 · triangle + k the first corner that is equal to it
std::vector<std::uint32_t> weld_corners(std::span<const DisplacedTriangle> triangles);

/// Numbers the distinct (P, N) of a mesh's vertices.
/// @return  for each the first one that is equal to it
std::vector<std::uint32_t> weld_vertices(std::span<const Vec3f> P, std::span<const Normal3f> N);

/// Numbers the distinct P of all corners.
/// @return  as weld_corners
std::vector<std::uint32_t> weld_positions(std::span<const DisplacedTriangle> triangles);

/// Edges between the same two places, in whichever direction. Edge 3 · triangle + k runs from vertex k to vertex k + 1.
/// @param corners  from weld_corners or weld_positions
/// @return         for every edge the first one of those
std::vector<std::uint32_t> weld_edges(std::span<const std::uint32_t> corners);

/// The corner that an edge leads to.
inline std::uint32_t edge_end(std::uint32_t edge) { return edge % 3 == 2 ? edge - 2 : edge + 1; }

}  // namespace relief
