// Finds the texture seams of a displaced mesh that walls can close.
#pragma once

#include <span>
#include <vector>

#include "displacement/displaced_triangle.h"

namespace relief {

/// Walls for all edges whose triangles share the two ends' positions and normals and read the map at different places,
/// whatever its heights are there: maps change, seams do not. Each side of a seam has one; where more than two triangles
/// meet, each has one to the next and one to the last. Edges whose normals differ stay open.
/// @return  in the order of their edges
/// @cost    linear; some 40 bytes a corner in passing
std::vector<SeamWall> seam_walls_make(std::span<const DisplacedTriangle> triangles, const HeightFieldView& field);

}  // namespace relief
