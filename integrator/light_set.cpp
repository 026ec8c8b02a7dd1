#include "integrator/light_set.h"

#include <tbb/parallel_for.h>

#include <algorithm>

#include "integrator/emissive_meshes.h"
#include "integrator/emitter_graph.h"
#include "integrator/environment_light.h"
#include "integrator/light_tree_build.h"

namespace relief {
namespace {

/// Makes the emission of lights with a graph that of its mean, by which lights are compared.
void lamps_scale(const KernelGlobals& globals, std::span<Light> lights)
{
  tbb::parallel_for(std::size_t{0}, lights.size(), [&](std::size_t i) {
    Light& light = lights[i];
    if (light.lamp_index < 0) return;
    // What was dark wherever the graph was asked may shine elsewhere.
    constexpr float kLeastMean = 1e-3f;
    const float mean = max(emitter_graph_lamp_mean(globals, light), kLeastMean);
    if (is_finite(light.emission * mean)) {
      light.emission *= mean;
      light.lamp_scale = 1.0f / mean;
    }
    if (emitter_graph_asks_for_path(globals.graphs[globals.lamps[light.lamp_index].graph_index])) {
      light.casts_caustics = false;
    }
  });
}

/// Of LightSet::channels. What counts is how much light of a channel there is in the middle of the scene.
Vec3f channel_weights(const Scene& scene, const LightSet& set)
{
  const Vec3f size = scene.bounds_high - scene.bounds_low;
  const float square = size.x >= 0.0f ? max(0.25f * dot(size, size), 1e-20f) : 1.0f;
  Vec3f all = set.environment_color * kPi;
  std::size_t next_shared = 0;
  for (std::size_t i = 0; i < set.lights.size(); ++i) {
    while (next_shared < set.shared.size() &&
           i >= set.shared[next_shared].first_light + set.shared[next_shared].num_lights) {
      ++next_shared;
    }
    const bool is_shared = next_shared < set.shared.size() && i >= set.shared[next_shared].first_light;
    const Light& light = set.lights[i];
    float brings = is_shared ? static_cast<float>(set.shared[next_shared].num_copies) : 1.0f;
    if (!set.emission_scales.empty()) brings *= set.emission_scales[i];
    if (!light_is_sun(light)) brings *= light_bounds(light, 1.0f).intensity / square;
    const Vec3f emitted = abs(light.emission) * brings;
    if (is_finite(emitted)) all += emitted;
  }
  const float mean = light_scalar(all);
  if (!(mean > 0.0f) || !(mean < 1e30f) || (all.x == all.y && all.y == all.z)) return {1, 1, 1};
  // Of which there is next to nothing shows nowhere.
  constexpr float kLittle = 0.05f;
  const Vec3f weights = Vec3f{1, 1, 1} / (all * (1.0f / mean) + splat3(kLittle));
  return weights * (1.0f / light_scalar(weights));
}

}  // namespace

LightSet light_set_make(const Scene& scene,
                        std::span<const TextureView> textures,
                        EnvironmentDensity density,
                        const KernelGlobals* globals)
{
  LightSet set;
  const auto texture_view = [&](int index) {
    return index >= 0 ? &textures[static_cast<std::size_t>(index)] : nullptr;
  };
  const Environment& environment = scene.environment;
  if (environment.graph) {
    const auto computed = std::make_shared<ComputedEnvironment>(
        computed_environment_make(*environment.graph, environment.rotation, globals->run_graph, textures.data()));
    set.environment = environment_tables_make(computed, environment.color, environment.rotation, environment.graph->suns,
                                              environment_graph_image_side(*environment.graph, textures), density);
  } else {
    set.environment = environment_tables_make(texture_view(environment.texture_index), environment.color,
                                              environment.rotation, density);
  }
  environment_integrate(set);
  set.environment_casts_caustics = scene.environment.casts_caustics && scene.environment.hidden_from == 0;
  set.lights = scene.lights;
  // Likewise of lamps: photons come to a surface as no kind of ray. And paths would bring no caustics of one that is only
  // asked for.
  for (Light& light : set.lights) {
    light.casts_caustics = light.casts_caustics && light.hidden_from == 0 && light.multiple_importance;
  }
  if (globals != nullptr) set.motions = globals->lights.motions;
  if (globals != nullptr) lamps_scale(*globals, set.lights);
  emissive_meshes_add(scene, textures, globals, set);
  set.channels = channel_weights(scene, set);
  // Where some kinds of rays alone see it, only a path that goes there knows of which kind it is.
  if (scene.environment.hidden_from == 0) {
    set.environment_irradiance = environment_irradiance(set.environment, set.channels);
  }
  light_tree_build(set);
  // What some rays pass and others not makes light that is asked for another than light that is found. Cycles finds it.
  const bool rays_differ =
      std::any_of(scene.instances.begin(), scene.instances.end(),
                  [](const Instance& instance) {
                    return (instance.flags & kHiddenFrom) != 0 || (instance.flags & kCastsShadow) == 0;
                  }) ||
      std::any_of(scene.materials.begin(), scene.materials.end(),
                  [](const Material& material) { return material.depends_on_ray && material.transparency_index >= 0; });
  // Meshes that shine and are asked for by nobody are for paths to find.
  const auto is_found_alone = [&](std::size_t i) {
    const auto material = static_cast<std::size_t>(scene.instances[i].material_index);
    return set.first_light_index[i] < 0 && !is_zero(scene.materials[material].emission);
  };
  bool any_found_alone = false;
  for (std::size_t i = 0; i < scene.instances.size(); ++i) any_found_alone |= is_found_alone(i);
  if (!rays_differ && !any_found_alone) set.sky_in_media = set.environment_irradiance.mean;
  if (!set.environment.environment.has_map && density == EnvironmentDensity::kExcess) {
    // Where the other lights are weaker than this, leaving the environment to the BSDF costs more variance than it saves:
    // measured under suns of 1.7 to .05 of the environment's irradiance, the two are even at about .15.
    constexpr float kYieldingRatio = 0.125f;
    set.environment_yields_to = kYieldingRatio * set.environment_irradiance.mean;
    float suns = 0;
    for (const std::uint32_t sun : set.suns) suns += light_scalar(set.lights[sun].emission, set.channels);
    // Decided for the whole scene, so that sides turned away from the sun save their shadow rays.
    if (suns > set.environment_yields_to || rays_differ) set.environment_irradiance = {};
  }
  return set;
}

bool LightSet::chooses_among_few() const
{
  if (tree_blocks.size() > static_cast<std::size_t>(kLightTreeMaxBlocks) || !copies.empty()) return false;
  const std::size_t finite = tree_blocks.empty() ? 0 : one_finite() ? 1 : 2;
  return finite + suns.size() + (environment_irradiance.mean > 0.0f ? 1 : 0) > 1;
}

bool LightSet::one_finite() const
{
  return copies.empty() && tree_blocks.size() == 1 && tree_blocks[0].intensity[1] == 0.0f;
}

LightsView LightSet::view() const
{
  LightsView v;
  v.lights = lights.data();
  v.num_lights = static_cast<std::uint32_t>(lights.size());
  v.tree = {tree_blocks.empty() ? nullptr : tree_blocks.data(), tree_root, copies.data()};
  v.light_trails = light_trails.data();
  if (one_finite() && suns.empty() && !(environment_irradiance.mean > 0.0f)) {
    v.only_light = static_cast<std::int32_t>(tree_blocks[0].link[0] & kLightTreeIndexMask);
  }
  v.channels = channels;
  v.suns = suns.data();
  v.num_suns = static_cast<std::uint32_t>(suns.size());
  v.has_sun_disks =
      std::any_of(suns.begin(), suns.end(), [this](std::uint32_t i) { return light_is_sun_disk(lights[i]); });
  v.environment = environment.view();
  v.environment_irradiance = environment_irradiance;
  v.environment_yields_to = environment_yields_to;
  v.sky_in_media = sky_in_media;
  v.environment_casts_caustics = environment_casts_caustics;
  v.motions = motions;
  return v;
}

std::size_t LightSet::bytes() const
{
  return lights.size() * sizeof(Light) + copies.size() * sizeof(LightCopy) + shared.size() * sizeof(SharedLights) +
         (first_light_index.size() + light_copy_index.size()) * sizeof(std::int32_t) +
         (area_lights.size() + suns.size()) * sizeof(std::uint32_t) + emission_scales.size() * sizeof(float) +
         light_trails.size() * sizeof(LightTrail) + tree_blocks.size() * sizeof(LightTreeBlock) + environment.bytes();
}

}  // namespace relief
