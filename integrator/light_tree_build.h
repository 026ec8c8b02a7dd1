// Builds the tree by which finite lights are chosen.
#pragma once

#include <span>

#include "integrator/light_set.h"

namespace relief {

/// Fills trails, suns, area_lights, and the tree from `lights`, `copies` and `shared`.
/// @param intensity_scales  one a light, >= 0: mean of the texture that will multiply its emission; empty: all 1. A light
///                          whose emission times scale is zero is never chosen
/// @source Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting"
void light_tree_build(LightSet& set, std::span<const float> intensity_scales);

}  // namespace relief
