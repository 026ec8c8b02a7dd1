// Texture seams of displaced meshes: edges whose triangles read the height map at different places. Where the heights
// differ too, the displaced surface has a gap, which is in the model and not in how it is traced. One finder serves the walls
// that close seams (seam_walls.h) and the report of how wide they gape.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "displacement/displaced_triangle.h"

namespace relief {

/// Walls for all seams whose triangles share the two ends' positions and normals, whatever the heights are there: maps
/// change, seams do not. Each side of a seam has one; where more than two triangles meet, each has one to the next and one
/// to the last. Edges whose normals differ stay open.
/// @return  in the order of their edges
/// @cost    linear; some 40 bytes a corner in passing
std::vector<SeamWall> seam_walls_make(std::span<const DisplacedTriangle> triangles, const HeightFieldView& field);

struct SeamExtent {
  std::size_t num_edges = 0;  ///< whose sides ask for different heights somewhere
  double length = 0;          ///< of the parts of these edges where they do, object space, before displacement
  double largest_gap = 0;     ///< between displaced points, metres of object space
};

struct SeamReport {
  SeamExtent all;
  SeamExtent split;            ///< those whose normals differ too, so that welding leaves them open
  std::size_t num_points = 0;  ///< at which heights were compared
};

SeamExtent seam_extent_sum(const SeamExtent& a, const SeamExtent& b);

/// Compares the heights along all edges that triangles share by position, whatever their normals are. Heights closer than a
/// thousandth of the map's range count as equal: on a steep map, rounded texture coordinates are enough to make that
/// difference.
/// @cost  that of the walls; on seams two heights a texel of length, at least 16 and at most 4096 an edge: the largest gap is
///        the largest of these. Where the edges of a mesh would come to more than four million, each has its share, 16 at
///        least
SeamReport seam_report(const DisplacedMeshView& mesh);

}  // namespace relief
