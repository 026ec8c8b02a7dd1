// Lights of meshes that emit.
#pragma once

#include <span>

#include "integrator/light_set.h"

namespace relief {

/// Adds the lights of emissive instances to a set, and of all its lights the means of their emission textures.
/// @param textures, globals  as light_set_make
void emissive_meshes_add(const Scene& scene,
                         std::span<const TextureView> textures,
                         const KernelGlobals* globals,
                         LightSet& set);

}  // namespace relief
