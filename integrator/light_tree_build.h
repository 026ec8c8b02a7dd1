// Builds the tree by which finite lights are chosen.
#pragma once

#include "integrator/light_set.h"

namespace relief {

/// Fills trails, suns, area_lights, and the tree from `lights`, `emission_scales`, `copies` and `shared`.
/// A light whose emission times scale is zero is never chosen.
/// @source Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting"
void light_tree_build(LightSet& set);

}  // namespace relief
