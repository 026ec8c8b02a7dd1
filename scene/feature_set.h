// What a scene needs, found once at load.
#pragma once

#include <array>

#include "scene/scene.h"

namespace relief {

/// Every texture reference of a material, absent ones included.
std::array<const TextureRef*, 12> material_textures(const Material& material);

/// Perceptual roughness up to which microfacet lobes are sharp: they focus light, and photons cannot show on them.
inline constexpr float kCausticRoughness = 0.25f;

/// Whether light is bent or mirrored sharply enough by a material for its caustics to be worth photons: transmission or
/// metal whose roughness factor is at most a quarter.
bool material_casts_caustics(const Material& material);

/// Looks at what instances use; materials and meshes that nothing places do not count. `many_lights` means more emitters
/// (lights, emissive triangles, the environment) than are worth asking one by one.
FeatureSet feature_set_detect(const Scene& scene);

}  // namespace relief
