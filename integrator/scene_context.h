// Everything built from a scene that a query or a render needs: views, lights, acceleration structure, kernel globals.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "integrator/accel.h"
#include "integrator/light_set.h"
#include "integrator/scene_displacement.h"
#include "integrator/scene_views.h"
#include "integrator/varying_media.h"
#include "integrator/wavefront.h"
#include "kernel/globals.h"
#include "kernel/statistics.h"
#include "scene/scene.h"

namespace relief {

/// Owner of what KernelGlobals points to. Camera, film, limits and seed are left for the render to fill in.
struct SceneContext : SceneViews {
  /// @param loaded               must outlive the context
  /// @param environment_density  kRadiance for LightTechnique::kLightSampling, which has no other way to the light
  /// @param trees                see Accel
  /// @error std::runtime_error out of memory and the like
  explicit SceneContext(const Scene& loaded,
                        const DisplacementOptions& displacement = {},
                        EnvironmentDensity environment_density = EnvironmentDensity::kExcess,
                        const CausticSettings& caustics = {CausticsMode::kOff},
                        std::shared_ptr<KeptTrees> trees = nullptr);
  ~SceneContext();

  /// @param photons       the render has a photon pass
  /// @param light_passes  it has layers that tell light apart by its first event
  /// @param catchers      it tells what shadow catchers have of light when they are alone
  WavefrontColumns columns(bool photons, bool light_passes, bool catchers = false) const;
  const std::vector<std::uint8_t>& surface_kernels(bool photons) const
  {
    return photons ? surface_kernel : surface_kernel_of_paths;
  }

  /// Bytes by part.
  void fill(Statistics& stats) const;

  const Scene& scene;
  std::vector<GraphProgramView> graphs;
  std::vector<Medium> media;  ///< the scene's, then what fills all space
  VaryingMedia varying_media;
  LightSet lights;
  std::vector<std::uint8_t> surface_kernel, surface_kernel_of_paths;  ///< a material; the latter's know no photons
  std::unique_ptr<BsdfTables> bsdf_tables;
  DisplacementSet displacements;
  std::unique_ptr<Accel> accel;
  ComputedEnvironment backdrop;              ///< if the scene has such a one
  std::vector<Light> lights_of_footage;  ///< as lights.lights where shadow catchers are alone; empty: nothing is one
  bool has_catchers = false;
  std::string caustics_reason;  ///< why globals.caustics is enabled, or not
  KernelGlobals globals;

 private:
  /// Fills in what light that meshes emit by graphs is evaluated with, and all else that asks for no lights.
  void make_views();
};

/// Whether something fills space in which photons may show.
bool shows_photons_in_media(const Scene& scene);

}  // namespace relief
