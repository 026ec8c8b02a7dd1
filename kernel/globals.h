// Everything a stage may read: views of the scene, fixed for the whole render.
#pragma once

#include "kernel/bsdf/material.h"
#include "kernel/camera/camera.h"
#include "kernel/film/film_accumulator.h"
#include "kernel/film/mist.h"
#include "kernel/film/pixel_filter.h"
#include "kernel/graph/graph_registers.h"
#include "kernel/graph/graph_scene.h"
#include "kernel/light/light_sampler.h"
#include "kernel/light/light_technique.h"
#include "kernel/math/motion.h"
#include "kernel/photon/photon.h"
#include "kernel/shape/mesh_view.h"
#include "kernel/texture/texture_view.h"
#include "kernel/volume/medium.h"

namespace relief {

struct BounceLimits {
  int total = 12, diffuse = 12, glossy = 12, transmission = 12, transparent = 32, volume = 12;
};

struct BsdfTables;  // kernel/bsdf/energy_tables.h
struct KernelGlobals;
struct MediumState;    // kernel/state/medium_state.h
struct ShadowSurfaces;  // kernel/stage/shadow_surfaces.h
struct ShadowWay;      // kernel/volume/shadow_way.h
struct VaryingMedium;  // kernel/volume/varying_place.h

/// A point of a light and a ray that takes light from there.
struct EmitterPoint {
  Vec3f P;            ///< world; of suns any
  Vec2f barycentric;  ///< on a triangle: weights of vertices 1 and 2
  Vec3f wo;           ///< unit, from the light to where it goes
  GraphRay ray;
};

/// Radiance of a point of a mesh light whose material emits by a graph; of other lights with a graph the factor on their emission.
/// @param emitter   in world space
using EmitterRadiance = Vec3f (*)(const KernelGlobals& g, const Light& emitter, const EmitterPoint& at);

/// What media leave of a part of a shadow ray that lies in the same ones; where some vary, a random number of that mean.
/// @param from,to  metres along the ray
using ShadowTransmittance =
    Vec3f (*)(const KernelGlobals& g, const MediumState& inside, const ShadowWay& way, float from, float to);

/// What surfaces of one material let through of light: see shadow_surfaces_pass.
using ShadowSurfacesPass = void (*)(const KernelGlobals& g, const ShadowSurfaces& surfaces, Vec3f passes[8]);

struct KernelGlobals {
  const MeshView* meshes = nullptr;
  const InstanceView* instances = nullptr;
  std::uint32_t num_instances = 0;
  const Material* materials = nullptr;
  const Medium* media = nullptr;             ///< by Material::medium_index
  std::int32_t world_medium = -1;            ///< into media: what fills all space; −1: nothing
  const VaryingMedium* varying_media = nullptr;  ///< as media, those without a program are even; null: all are
  const GraphProgramView* graphs = nullptr;  ///< by Material::graph_index and Lamp::graph_index
  GraphRun run_graph = nullptr;
  EmitterRadiance emitter_radiance = nullptr;
  ShadowTransmittance shadow_transmittance = nullptr;
  ShadowSurfacesPass shadow_surfaces = nullptr;
  const Lamp* lamps = nullptr;  ///< by Light::lamp_index
  GraphScene graph_scene;
  const TextureView* textures = nullptr;
  const std::uint32_t* area_light_index = nullptr;  ///< light of object num_instances + i
  std::uint32_t num_area_lights = 0;
  LightsView lights;
  const BsdfTables* bsdf_tables = nullptr;
  CausticsView caustics;
  Camera camera;
  MotionView camera_motion;  ///< of `camera`, which stands where it is when the shutter is half done
  Vec3f camera_forward;      ///< unit, world: the axis that depths are measured along
  float pixel_size = 1;      ///< side of a square as large as a pixel, as a fraction of the image's height
  BounceLimits limits;
  float clamp_direct = 0, clamp_indirect = 0;  ///< 0: off
  float filter_glossy = 0;                     ///< see path_blur; 0: off
  LightTechnique light_technique = LightTechnique::kMis;
  bool has_lights = false;  ///< something can be sampled
  bool environment_visible_to_camera = true;
  float clear_alpha =
      -1;  ///< where it is not: of lobes up to this width α what is refracted leaves the film clear; −1: none
  bool has_backdrop = false;
  EnvironmentView backdrop;                   ///< what camera rays see in the environment's place
  std::uint32_t environment_hidden_from = 0;  ///< as Environment::hidden_from
  std::uint32_t environment_light_group = 0;  ///< as Light::light_group
  bool catchers_alone = false;                ///< rays meet shadow catchers and lights only
  Mist mist;
  float occlusion_distance = 10;  ///< metres, for Aov::kAmbientOcclusion
  /// Of instances, materials, and instances' assets: what Cryptomattes call them. Null: not kept.
  const float* cryptomatte_ids[kNumCryptomattes] = {};
  const FilterTable* filter = nullptr;  ///< null: box
  float filter_width = 1;               ///< pixels
  std::uint64_t seed = 0;
  std::uint32_t log2_stream = 0;        ///< of the samples that a pixel gets for sure, see sample_sequence_index
  int full_width = 0, full_height = 0;  ///< of the whole image, pixels
  int crop_x = 0, crop_y = 0;           ///< the film window's corner in it
  FilmAccumulatorView film;
};

}  // namespace relief
