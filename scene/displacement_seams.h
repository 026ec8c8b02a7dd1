// Texture seams of displaced meshes: edges whose triangles read the height map at different places. Where the heights
// differ too, the displaced surface has a gap, which is in the model and not in how it is traced.
#pragma once

#include <cstddef>

#include "scene/scene.h"

namespace relief {

struct SeamExtent {
  std::size_t num_edges = 0;  ///< whose two sides ask for different heights somewhere
  double length = 0;          ///< of the parts of these edges where they do, object space, before displacement
  double largest_gap = 0;     ///< between displaced points, metres in the space of the displacement
};

struct DisplacementSeams {
  SeamExtent all;
  SeamExtent split;            ///< those whose normals differ too, so that welding leaves them open
  std::size_t num_points = 0;  ///< at which heights were compared
};

SeamExtent seam_extent_sum(const SeamExtent& a, const SeamExtent& b);

/// Compares the heights along every edge that triangles share by position, exactly, whether by the same vertices or not.
/// Heights closer than a thousandth of the map's range count as equal: on a steep map, rounded texture coordinates are
/// enough to make that difference.
/// @param range  of the map's heights
/// @return       zero if the mesh lacks the texture coordinates
/// @cost         a sort of the edges; on seams two heights a texel of length, at least 16 and at most 4096 an edge: the
///               largest gap is the largest of these. Where the edges of a mesh would come to more than four million, each
///               has its share, 16 at least
DisplacementSeams displacement_seams(const Mesh& mesh,
                                     const DisplacementSettings& settings,
                                     const HeightMapView& map,
                                     HeightRange range);

}  // namespace relief
