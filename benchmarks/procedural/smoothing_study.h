// How much the normals of a mesh jump across the sides of its triangles: of the flat triangles, and of the smooth surface
// through the mesh's vertices that is displaced with `curved`. Smits, Shirley and Stark 2000, section 4 and Fig. 8.
#pragma once

#include <cstddef>
#include <string>

#include "kernel/shape/mesh_view.h"

namespace relief {

/// Angle between the normals on either side of a side, degrees, over several points of all sides.
struct NormalJumps {
  double largest = 0, mean = 0;
};

struct SmoothingResult {
  std::string mesh;
  std::size_t num_triangles = 0;
  std::size_t num_sides = 0;     ///< that two triangles have in common, with the same normals at both ends
  std::size_t num_left_out = 0;  ///< of those, where normals are so far apart that no smooth surface is known
  NormalJumps flat, curved;      ///< over the others
  double steps_share = 0;        ///< points where the smooth surface's normals jump by more than a tenth of a degree
};

/// @param mesh  object space, with normals
SmoothingResult smoothing_study(const std::string& name, const MeshView& mesh);
/// An icosahedron with the normals of its ball.
SmoothingResult smoothing_study_of_icosahedron();

}  // namespace relief
