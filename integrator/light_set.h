// All light of a scene in the form the kernel samples: the scene's own lights, one light for every triangle that emits,
// the environment with its tables, and the tree that chooses among them.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "integrator/environment_tables.h"
#include "kernel/light/light_sampler.h"
#include "scene/scene.h"

namespace relief {

struct KernelGlobals;

/// Lights of an emissive mesh, and the instances that share them.
struct SharedLights {
  std::uint32_t first_light = 0, num_lights = 0;
  std::uint32_t first_copy = 0, num_copies = 0;
};

/// Owner of everything a LightsView points to.
struct LightSet {
  /// The scene's, in its order; then emissive triangles, or rectangles of two, each mesh's in one piece: of an instance in
  /// world space, or of several that share them in object space.
  std::vector<Light> lights;
  std::vector<float>
      emission_scales;  ///< one a light, >= 0: mean of the texture that will multiply its emission; empty: all 1
  /// Weights of channels where lights are compared, 1 on average: what few lights send counts for more, as its noise is seen beside that
  /// little light alone.
  Vec3f channels{1, 1, 1};
  std::vector<std::int32_t> first_light_index;  ///< one an instance: light of its triangle 0; −1: does not emit
  std::vector<std::int32_t> light_copy_index;   ///< one an instance: into `copies`; −1: shares its lights with none
  std::vector<LightCopy> copies;
  std::vector<SharedLights> shared;
  std::vector<std::uint32_t> area_lights;  ///< rectangles, disks, balls: what rays can hit besides meshes
  std::vector<std::uint32_t> suns;
  std::vector<LightTrail> light_trails;     ///< one a light
  std::vector<LightTreeBlock> tree_blocks;  ///< empty: no finite light can be chosen
  std::uint32_t tree_root = 0;              ///< as LightTreeBlock::link
  EnvironmentTables environment;
  EnvironmentIrradiance environment_irradiance;  ///< of what next-event estimation samples of it
  float environment_yields_to = kInfinity;       ///< see LightsView
  float sky_in_media = 0;                        ///< likewise
  double environment_flux_density = 0;           ///< π × mean radiance of all of it, W/m²
  Vec3f environment_color;                       ///< of that: mean radiance
  double environment_solid_angle = 0;      ///< (∫L)² / ∫L²: how wide an even light of its contrast would be, sr
  bool environment_casts_caustics = true;  ///< as Light::casts_caustics
  const MotionView* motions = nullptr;     ///< as LightsView::motions

  /// @return false: nothing can be sampled
  bool any() const { return !tree_blocks.empty() || !suns.empty() || environment_irradiance.mean > 0; }
  /// Whether there is more than one thing to sample, and so few lights that the tree is one node. Among more, gloss that is heeded
  /// (light_receiver.h) costs more than it has been seen to save.
  bool chooses_among_few() const;
  /// Whether the tree has a single light.
  bool one_finite() const;
  /// Emissive triangles of all instances.
  std::size_t num_emissive_triangles = 0;
  /// Valid while this object is neither changed nor moved.
  LightsView view() const;
  std::size_t bytes() const;
};

/// Gathers the lights of a scene and builds the tree over the finite ones, in parallel.
///
/// A mesh emits when its material's emission is not zero. Meshes that are displaced are left out (their surface is not where the triangles
/// are), and so are unlit ones (they light nothing in glTF's sense) and those that move or deform while the shutter is open: paths that hit
/// them see their emission all the same. Triangles emit from the side glTF calls front, which a mirroring instance turns with the winding.
/// @param textures  views of scene.textures, for the mean of emission maps
/// @param density   of the environment: kExcess where paths that follow the BSDF find what it leaves out, which for a
///                  constant environment beside suns is all
/// @param globals   what emission by graph is evaluated with, see emitter_graph_means, and surroundings by graph; null: the
///                  scene has none
/// @return          same bits for the same scene, whatever the thread count
/// Instances of one mesh and material share their lights where there are so many lights in the scene that they are chosen in
/// more than one step, and where they keep the mesh's shape: under another map than a similarity its triangles compare
/// differently.
/// @cost            128 bytes a light, and about 80 for its place in the tree; as much for an instance that shares
LightSet light_set_make(const Scene& scene,
                        std::span<const TextureView> textures,
                        EnvironmentDensity density = EnvironmentDensity::kExcess,
                        const KernelGlobals* globals = nullptr);

}  // namespace relief
