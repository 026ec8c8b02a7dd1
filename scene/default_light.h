// Light for scenes that bring none. Many files come from programs that light them by themselves: what glows in them glows for
// the eye, and leaves everything else black.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "scene/environment_preset.h"
#include "scene/scene.h"

namespace relief {

/// A mesh at its place.
struct Placement {
  int mesh_index = 0, material_index = 0;
  Affine3 world_from_object;
};

/// See emission_lights_scene.
inline constexpr double kLitRadiance = 0.1, kGlowingRadiance = 0.25, kLitFraction = 0.5, kGlowingFraction = 0.5;

/// Whether emissive surfaces are the scene's lamps, or decoration. They are lamps if half of the surface glows by itself, with
/// a radiance of .25 or more; or if at least half of those points are lit that do not, among 256, the same number on each mesh
/// instance: if they were white and turned to the light, they would have a radiance of .1. Nothing shadows, and 2048 points of
/// the emissive surfaces, chosen by what they may emit, stand for all of them. So a lamp lights what is near, however large
/// the floor it stands on, and lights on a model do not count for the model, whose surface turns away from them.
/// @param textures  of the scene, loaded
/// @cost  some milliseconds
bool emission_lights_scene(const Scene& scene,
                           std::span<const Placement> placements,
                           std::span<const TextureView> textures);

/// Surrounds a scene by what was chosen.
/// @param textures      gets the map
/// @param has_backdrop  cameras see a grey gradient in the studio's place, from dark below to light above, before which dark
///                      things stand out as bright ones do
/// @pre not EnvironmentSource::kFile
void environment_set(Scene& scene, const EnvironmentChoice& choice, bool has_backdrop, TextureStore& textures);

/// Surrounds a scene in which nothing is lit by the soft studio, with a warning.
/// @param has_backdrop  as for environment_set
/// @param placements  of all meshes at rest, whatever the frame: else light would come and go with what moves
/// @param emission_shows  whether the picture shows the scene by what glows, where emission_lights_scene finds so; empty: it does
/// @pre the scene has neither lights nor an environment, be it a black one
void default_light_add(Scene& scene,
                       std::span<const Placement> placements,
                       bool has_backdrop,
                       const std::function<bool()>& emission_shows,
                       TextureStore& textures,
                       Warnings& warnings);

}  // namespace relief
