#include "integrator/scene_context.h"

#include <algorithm>
#include <utility>

#include "integrator/emitter_graph.h"
#include "integrator/environment_tables.h"
#include "integrator/graph_rays.h"
#include "integrator/light_sides.h"
#include "integrator/shadow_stage.h"
#include "integrator/surface_kernels.h"
#include "kernel/bsdf/energy_tables.h"
#include "scene/texture_store.h"

namespace relief {

namespace {

/// Whether photons are to be traced, and why.
struct CausticsDecision {
  bool enabled = false;
  std::string reason;
};

/// Perceptual roughness of the sharpest lobes that photons are gathered for: sharper ones would meet few of them.
constexpr float kSharpestGathered = 0.25f;

/// Perceptual roughness from which on casters show photons by the tails of their lobes. Tails of sharper lobes reach nowhere.
constexpr float kSharpestTails = 0.12f;

/// A light that covers more of the sky than this, steradians, is found by paths that leave a caster often enough.
constexpr double kWideLight = 1.0;

/// Whether a material has soft lobes besides what its microfacets scatter more than once.
bool has_wide_lobes(const Material& m, bool caster, float roughness)
{
  if (m.has_closures) return true;
  const bool textured = m.metallic_roughness_texture.texture_index >= 0 || m.transmission_texture.texture_index >= 0 ||
                        m.graph_index >= 0;
  const bool diffuse = m.metallic < 1.0f && m.transmission < 1.0f;
  const bool rough = !caster && (m.roughness > roughness || (m.clearcoat > 0.0f && m.clearcoat_roughness > roughness));
  return !m.unlit && (textured || diffuse || rough || !is_zero(m.sheen_color));
}

/// Whether photons can show on a material at all, rather than be sent on by sharp lobes alone.
bool has_soft_lobes(const Material& m, bool caster, float roughness)
{
  // Microfacets scatter light more than once on all but smooth metal and thin walls.
  const bool multiple = m.roughness > 0.0f && (m.metallic > 0.0f || m.thickness == 0.0f);
  return has_wide_lobes(m, caster, roughness) || (multiple && !m.unlit);
}

/// Whether photons show on a material by the tails of its sharp lobes, see path_gathers_tails. Not among bumps, which are
/// narrower than the radius that photons are spread over.
bool has_tails(const Material& m, bool caster)
{
  return caster && m.displacement_index < 0 && !m.unlit && !m.has_closures && m.roughness >= kSharpestTails;
}

/// See CausticsView.
std::uint32_t events_switched_off(CausticKinds kinds)
{
  constexpr std::uint32_t kReflection = 1u << static_cast<int>(PathEvent::kGlossy);
  constexpr std::uint32_t kRefraction = 1u << static_cast<int>(PathEvent::kTransmission);
  constexpr std::uint32_t kOff[] = {0, kRefraction, kReflection, kReflection | kRefraction};
  return kOff[static_cast<int>(kinds)];
}

/// Leaves to paths the caustics of what shines from infinitely far away through a medium that fills all space. Where photons would start
/// from, and what would be left of them, cannot be said.
void leave_what_is_far_to_paths(LightSet& lights)
{
  lights.environment_casts_caustics = false;
  for (Light& light : lights.lights) {
    if (light.kind == LightKind::kSun) light.casts_caustics = false;
  }
}

CausticsDecision caustics_decide(const Scene& scene, LightSet& lights, const CausticSettings& settings)
{
  const CausticsMode mode = settings.mode;
  if (mode == CausticsMode::kOff) return {false, "off"};
  if (settings.kinds == CausticKinds::kNone) return {false, "there are to be none"};
  bool any_caster = false, any_receiver = shows_photons_in_media(scene);
  for (const Instance& instance : scene.instances) {
    const Material& material = scene.materials[static_cast<std::size_t>(instance.material_index)];
    const bool caster = (instance.flags & kCausticCaster) != 0;
    any_caster |= caster;
    if ((instance.flags & kCausticReceiver) == 0) continue;
    // Alone, what metal's microfacets scatter more than once is not worth a photon. With glass paths fork, which is.
    any_receiver |= mode == CausticsMode::kOn || material.transmission > 0.0f ||
                    has_wide_lobes(material, caster, kSharpestGathered) || has_tails(material, caster);
  }
  if (!any_caster) return {false, "nothing casts caustics"};
  if (!any_receiver) return {false, "nothing receives caustics"};
  if (scene.environment.medium) leave_what_is_far_to_paths(lights);
  if (mode == CausticsMode::kAuto && lights.environment_solid_angle > kWideLight) {
    lights.environment_casts_caustics = false;
  }
  const bool any_light = std::any_of(lights.lights.begin(), lights.lights.end(), [](const Light& light) {
    return light.casts_caustics && !is_zero(light.emission);
  });
  const bool environment = lights.environment_flux_density > 0 && lights.environment_casts_caustics;
  if (!any_light && !environment) return {false, "no light casts caustics"};
  return {true, std::string(any_light ? "lights" : "") + (any_light && environment ? " and " : "") +
                    (environment ? "the environment" : "") + " on casters"};
}

/// Nothing gets through what fills all space from infinitely far away: asking for it would be in vain.
void leave_out_what_is_far(const Medium& world, KernelGlobals& g)
{
  if (!(world.sigma_t.x > 0.0f && world.sigma_t.y > 0.0f && world.sigma_t.z > 0.0f)) return;
  g.lights.environment_irradiance.mean = 0.0f;
  g.lights.num_suns = 0;
  g.lights.has_sun_disks = false;
  g.has_lights = g.lights.tree.blocks != nullptr || g.lights.only_light >= 0;
}

}  // namespace

bool shows_photons_in_media(const Scene& scene)
{
  const auto scatters = [](const Medium& medium) {
    return std::any_of(medium.phases, medium.phases + medium.num_phases,
                       [](const Phase& phase) { return max_component(phase.sigma_s) > 0.0f; });
  };
  const auto varies = [](const VolumeProgram& volume) { return !volume.closures.empty(); };
  return std::any_of(scene.media.begin(), scene.media.end(), scatters) ||
         std::any_of(scene.varying_media.begin(), scene.varying_media.end(), varies) ||
         (scene.environment.medium && scatters(*scene.environment.medium)) || varies(scene.environment.varying_medium);
}

namespace {

/// Lights, of which those that are not of the footage are hidden from whatever asks for them or meets them.
std::vector<Light> only_of_footage(std::vector<Light> lights)
{
  for (Light& light : lights) {
    if (light.in_footage) continue;
    light.visible_to_camera = false;
    light.hidden_from = static_cast<std::uint8_t>(kHiddenFrom >> kHiddenFromShift);
  }
  return lights;
}

}  // namespace

SceneContext::~SceneContext() = default;

SceneContext::SceneContext(const Scene& loaded,
                           const DisplacementOptions& displacement,
                           EnvironmentDensity environment_density,
                           const CausticSettings& caustics,
                           std::shared_ptr<KeptTrees> trees)
    : SceneViews(loaded),
      scene(loaded),
      bsdf_tables(std::make_unique<BsdfTables>()),
      displacements(scene_displacement(loaded, displacement))
{
  make_views();
  lights = light_set_make(scene, scene.textures->views(), environment_density, &globals);

  CausticsDecision decision = caustics_decide(scene, lights, caustics);
  caustics_reason = std::move(decision.reason);
  globals.caustics.enabled = decision.enabled;
  globals.caustics.roughness = kSharpestGathered;
  globals.caustics.switched_off = events_switched_off(caustics.kinds);
  for (std::size_t i = 0; i < instances.size(); ++i) {
    InstanceView& view = instances[i];
    view.first_light_index = lights.first_light_index[i];
    view.light_copy_index = lights.light_copy_index[i];
    const bool caster = (view.flags & kCausticCaster) != 0;
    const Material& material = scene.materials[static_cast<std::size_t>(view.material_index)];
    if (decision.enabled && (view.flags & kCausticReceiver) != 0) {
      if (has_soft_lobes(material, caster, kSharpestGathered)) view.flags |= kGathersPhotons;
      if (has_tails(material, caster)) view.flags |= kGathersTails;
    }
  }
  unsigned features = 0;
  for (const Material& material : scene.materials) {
    features |= feature_mask_of(material);
    surface_kernel.push_back(static_cast<std::uint8_t>(surface_kernel_index(material, decision.enabled)));
    surface_kernel_of_paths.push_back(static_cast<std::uint8_t>(surface_kernel_index(material, false)));
  }
  bsdf_tables_make(*bsdf_tables, features);
  accel = std::make_unique<Accel>(scene, lights.lights, lights.area_lights, displacements, *this, shadow_filter,
                                  std::move(trees));
  // Where lights alone are sampled, each has to be.
  if (environment_density == EnvironmentDensity::kExcess) light_sides_find(*this);

  varying_media.make(*this);
  globals.varying_media = varying_media.view();
  globals.graph_scene.rays = graph_rays_make(*this);
  globals.area_light_index = lights.area_lights.data();
  globals.num_area_lights = static_cast<std::uint32_t>(lights.area_lights.size());
  globals.lights = lights.view();
  globals.has_lights = lights.any();
  has_catchers = std::any_of(instances.begin(), instances.end(),
                             [](const InstanceView& instance) { return (instance.flags & kShadowCatcher) != 0; });
  if (has_catchers) lights_of_footage = only_of_footage(lights.lights);
  // What shines in space is found by paths alone.
  const bool media_shine =
      std::any_of(media.begin(), media.end(), [](const Medium& medium) { return !is_zero(medium.emission); }) ||
      varying_media.shines();
  if (media_shine) globals.lights.sky_in_media = 0.0f;
  if (globals.world_medium >= 0) leave_out_what_is_far(media.back(), globals);
  globals.bsdf_tables = bsdf_tables.get();
  globals.environment_visible_to_camera = scene.environment.visible_to_camera;
  const std::optional<float>& clear = scene.environment.clear_roughness;
  globals.clear_alpha = clear && !scene.environment.visible_to_camera ? *clear * *clear : -1.0f;
  globals.environment_hidden_from = scene.environment.hidden_from;
  globals.environment_light_group = scene.environment.light_group;
  if (const std::optional<Surroundings>& seen = scene.environment.backdrop) {
    globals.has_backdrop = true;
    if (seen->graph) {
      backdrop =
          computed_environment_make(*seen->graph, seen->rotation, globals.run_graph, scene.textures->views().data());
      globals.backdrop = environment_view_make(backdrop, seen->color, seen->rotation);
    } else {
      const int map = seen->texture_index;
      globals.backdrop = environment_view_make(
          map < 0 ? nullptr : &scene.textures->views()[static_cast<std::size_t>(map)], seen->color, seen->rotation);
    }
  }
}

WavefrontColumns SceneContext::columns(bool photons, bool light_passes, bool catchers) const
{
  const bool goes_below = std::any_of(scene.materials.begin(), scene.materials.end(),
                                      [](const Material& material) { return material.scatters_below; });
  const bool has_closures = std::any_of(scene.materials.begin(), scene.materials.end(),
                                        [](const Material& material) { return material.has_closures; });
  return {photons,
          motion.is_open(),
          displacements.has_facets(),
          !media.empty(),
          goes_below,
          light_passes,
          has_closures && lights.chooses_among_few(),
          catchers};
}

void SceneContext::make_views()
{
  for (const MovedMesh& moved : displacements.moved()) {
    const MeshView mesh = meshes[static_cast<std::size_t>(moved.mesh_index)];
    meshes.push_back(moved.view(mesh));
    std::vector<MeshShape> shapes;
    for (const MovedShape& step : moved.steps)
      shapes.push_back({step.P.data(), step.N.empty() ? nullptr : step.N.data()});
    motion.add_mesh(std::move(shapes));
  }
  for (std::size_t i = 0; i < instances.size(); ++i) {
    const int moved = displacements.moved_index(i);
    if (moved >= 0) instances[i].mesh_index = static_cast<std::int32_t>(scene.meshes.size()) + moved;
  }
  for (std::size_t i = 0; i < instances.size(); ++i) {
    if (displacements.geometry_index(i) < 0) continue;
    instances[i].flags |= kDisplaced | kTracedInObjectSpace;
  }
  globals.meshes = meshes.data();
  globals.instances = instances.data();
  globals.num_instances = static_cast<std::uint32_t>(instances.size());
  for (const GraphProgram& graph : scene.graphs) graphs.push_back(graph.view());
  globals.graph_scene.columns = instance_columns.data();
  globals.graph_scene.num_columns = static_cast<std::uint32_t>(instance_columns.size());
  globals.materials = scene.materials.data();
  media = scene.media;
  if (scene.environment.medium) {
    globals.world_medium = static_cast<std::int32_t>(media.size());
    media.push_back(*scene.environment.medium);
  }
  globals.media = media.data();
  globals.graphs = graphs.data();
  globals.run_graph = stage_table_select().run_graph;
  globals.emitter_radiance = emitter_graph_radiance;
  globals.shadow_transmittance = stage_table_select().shadow_transmittance;
  globals.shadow_surfaces = stage_table_select().shadow_surfaces;
  globals.lamps = scene.lamps.data();
  globals.lights.motions = motion.views();
  globals.textures = scene.textures->views().data();
}

void SceneContext::fill(Statistics& stats) const
{
  for (const Mesh& mesh : scene.meshes) stats.mesh_bytes += mesh.bytes();
  stats.mesh_bytes += instances.size() * sizeof(InstanceView);
  stats.texture_bytes = scene.textures->bytes();
  stats.mesh_bytes += motion.bytes();
  stats.light_bytes = lights.bytes();
  stats.bvh_bytes = accel->bytes();
  const DisplacementSet::TileTally tiles = displacements.tiles();
  stats.displacement = {displacements.method_names(),
                        displacements.size() + displacements.moved().size(),
                        displacements.num_triangles(),
                        displacements.bytes(),
                        height_map_bytes(scene.height_maps),
                        0,
                        tiles.made,
                        tiles.evicted,
                        tiles.bytes,
                        displacements.reasons()};
}

}  // namespace relief
