// What a scene needs, found once at load.
#pragma once

#include <array>

#include "scene/scene.h"

namespace relief {

/// Every texture reference of a material, absent ones included.
std::array<const TextureRef*, 12> material_textures(const Material& material);

/// Whether light is bent or mirrored sharply enough by a material for its caustics to be worth photons: transmission or
/// metal whose roughness factor is at most one half, beyond which light is spread and paths find it.
bool material_casts_caustics(const Material& material);

/// Looks at what instances use; materials and meshes that nothing places do not count. `many_lights` means more emitters
/// (lights, emissive triangles, the environment) than are worth asking one by one.
FeatureSet feature_set_detect(const Scene& scene);

}  // namespace relief
