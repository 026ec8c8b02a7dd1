// What follows from a material as it is read.
#pragma once

#include <array>

#include "kernel/bsdf/material.h"

namespace relief {

/// Every texture reference of a material, absent ones included.
std::array<const TextureRef*, 12> material_textures(const Material& material);

/// Whether a mesh of this material is among the scene's lights, see light_set_make.
bool material_is_light(const Material& material);

/// Whether light is bent or mirrored sharply enough by a material for its caustics to be worth photons: transmission or
/// metal whose roughness factor is at most one half, beyond which light is spread and paths find it.
bool material_casts_caustics(const Material& material);

/// Whether light gets through a material into what its meshes bound: it is glass, and no thin wall.
bool material_lets_light_in(const Material& material);

/// Whether nothing of a surface is there, whatever its meshes bound.
bool material_has_no_surface(const Material& material);

}  // namespace relief
