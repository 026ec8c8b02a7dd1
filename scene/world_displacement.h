// World-space displacement under transforms that do not keep angles.
#pragma once

#include "kernel/math/affine.h"

namespace relief {

struct Scene;

/// Whether a map keeps angles, up to what rounding leaves of a rotation and a scale.
/// @param scale  receives the factor by which lengths grow, if it does
bool is_similarity(const Affine3& m, float* scale);

/// Gives every instance whose displacement is measured in world space a mesh on which object space is the world's, up to a
/// similarity: metres along the normal there are metres along the world's normal. Meshes under a similarity are left as
/// they are and shared; under another map their instances get a copy with that map applied, and keep its translation.
/// Instances of one mesh under the same map share the copy.
/// @param scene  everything is placed; gains meshes with Mesh::copy_of
/// @cost         a mesh for each such map
void world_displacement_bake(Scene& scene);

}  // namespace relief
