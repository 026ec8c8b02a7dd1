// Where displaced meshes meet others, which have heights of their own or none: parts of one mesh with several materials. Like
// texture seams these borders may gape, but nothing welds them.
#pragma once

#include <vector>

#include "displacement/displacement_set.h"
#include "scene/scene.h"

namespace relief {

/// Compares displaced points along edges that meshes with one place in the world share by position. Computed heights are not
/// compared.
/// @return  by displacement of the scene: the borders of its meshes with meshes of other materials. A border of two
///          displacements counts for both
/// @cost    sorting of all edges of meshes that have their place in common with displaced ones
std::vector<SeamExtent> border_seams(const Scene& scene, const DisplacementSet& displacements);

}  // namespace relief
