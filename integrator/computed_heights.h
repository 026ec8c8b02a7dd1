// Heights that value graphs give, at any point of the meshes that they displace.
//
// What a graph reads there is that of the undisplaced mesh, seen along its normal: of the true normal too the smooth one
// stands for it, so that the two triangles of a side agree.
#pragma once

#include <memory>

#include "displacement/displacement_set.h"
#include "scene/scene.h"

namespace relief {

/// Fills in the heights of all instances whose material has computed ones.
/// @param scene  must outlive the input's heights
/// @param input  with its instances
void computed_heights_add(const Scene& scene, const DisplacementOptions& options, DisplacementInput* input);

}  // namespace relief
