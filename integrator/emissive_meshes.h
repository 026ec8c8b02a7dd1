// Lights of meshes that emit.
#pragma once

#include <span>
#include <vector>

#include "integrator/light_set.h"

namespace relief {

/// Adds the lights of emissive instances to a set.
/// @param textures, globals  as light_set_make
/// @return                   of each light, the mean of its emission texture
std::vector<float> emissive_meshes_add(const Scene& scene,
                                       std::span<const TextureView> textures,
                                       const KernelGlobals* globals,
                                       LightSet& set);

}  // namespace relief
