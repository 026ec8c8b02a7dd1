// Where displaced meshes meet others, which have heights of their own or none: parts of one mesh with several materials. Like
// texture seams these borders may gape.
#pragma once

#include <vector>

#include "displacement/displacement_set.h"
#include "scene/scene.h"

namespace relief {

/// The borders of meshes with meshes of other materials.
struct BorderReport {
  SeamExtent all;
  SeamExtent open;  ///< those that no walls close
};

/// Compares displaced points along edges that meshes with one place in the world share by position. Heights that are computed where
/// rays ask are not compared, nor those of divided meshes.
/// @return  by displacement of the scene; a border of two displacements counts for both
/// @cost    sorting of all edges of meshes that have their place in common with displaced ones
std::vector<BorderReport> border_seams(const Scene& scene, const DisplacementSet& displacements);

}  // namespace relief
