// Chooses a light for next-event estimation and samples it. Three groups compete: the environment, the suns, and the
// finite lights (light_tree.h). Each is given an estimate of the irradiance it causes at the point,
//   environment: second-order expansion by the normal;   suns: irradiance × cosine, summed;   finite lights: sum over the
//   tree's root,
// where it is glossy mixed with what the gloss shows of it (light_receiver.h),
// and is chosen with probability  ¾ · estimate / sum + ¼ / number of groups whose estimate is not zero.
// The second term is defensive: none of the estimates knows about shadows, so no group may starve. A finite light that is
// alone in the scene is taken without any estimate.
//
// A constant environment is different: paths that follow the BSDF find it so well that the one shadow ray of a hit is
// better spent on any other light that counts. Under a sun and a constant sky this has a fifth to a half of the variance
// that competing has; a sky that is alone is sampled all the same (1.3 times the efficiency of not doing so).
#pragma once

#include "kernel/light/environment.h"
#include "kernel/light/light_kinds.h"
#include "kernel/light/light_tree.h"
#include "kernel/math/motion.h"
#include "kernel/sample/choice.h"
#include "kernel/sample/warp.h"

namespace relief {

/// Irradiance by direction of the normal: the expansion of the environment's radiance to second order, which carries all
/// but 1 % of it.
/// @source Ramamoorthi and Hanrahan 2001, "An Efficient Representation for Irradiance Environment Maps"; written in
///         Cartesian form, from max(0, x) ≈ 1/4 + x/2 + 5/32 (3x² − 1)
struct EnvironmentIrradiance {
  float mean = 0;           ///< over all normals, of the mean of R, G, B: π × mean radiance; 0: nothing to sample
  float constant = 0;       ///< 3/8 of `mean`: what is left of it when the trace of the quadratic part is in `squares`
  Vec3f linear;             ///< of N
  Vec3f squares, products;  ///< of (x², y², z²) and (xy, yz, zx) of N
};

/// @param N  unit; zero vector: mean over all normals
/// @return   never 0 unless `mean` is: the expansion is up to .16 of a small light's irradiance off, also downwards
RELIEF_KERNEL float environment_irradiance_eval(const EnvironmentIrradiance& irradiance, Vec3f N)
{
  constexpr float kFloor = 0.05f;
  if (is_zero(N)) return irradiance.mean;
  const Vec3f products{N.x * N.y, N.y * N.z, N.z * N.x};
  const float value = irradiance.constant + dot(irradiance.linear, N) + dot(irradiance.squares, N * N) +
                      dot(irradiance.products, products);
  return max(value, kFloor * irradiance.mean);
}

/// All light of a scene; LightSet owns what it points to.
struct LightsView {
  const Light* lights = nullptr;
  std::uint32_t num_lights = 0;
  LightTreeView tree;                        ///< without blocks: no finite light
  const LightTrail* light_trails = nullptr;  ///< one a light
  std::int32_t only_light = -1;              ///< the one finite light, where nothing else can be chosen
  const std::uint32_t* suns = nullptr;       ///< indices into `lights`
  std::uint32_t num_suns = 0;
  Vec3f channels{1, 1, 1};     ///< see LightSet
  bool has_sun_disks = false;  ///< one of them is_sun_disk: rays that meet nothing may see it
  EnvironmentView environment;
  EnvironmentIrradiance environment_irradiance;
  /// Where the other lights' estimates sum to more, the environment is left to paths that follow the BSDF.
  float environment_yields_to = kInfinity;
  /// Irradiance of an environment that may be asked for in media, by where they scatter light to: π × mean radiance. 0: it is not.
  float sky_in_media = 0;
  bool environment_casts_caustics = true;  ///< as Light::casts_caustics
  /// By Light::motion_index: what takes a light's vectors from when the shutter is half done to another time, and where its P
  /// is then. They keep lengths.
  const MotionView* motions = nullptr;
};

/// How likely each group is, and the estimates needed to go on.
struct LightGroups {
  float environment = 0, suns = 0, finite = 0;  ///< probabilities; all 0: nothing can contribute
  float sun_sum = 0;                            ///< estimate summed over the suns
  LightEstimates finite_root;
};

/// @param light_index  −1: environment
RELIEF_KERNEL bool light_casts_caustics(const LightsView& view, std::int32_t light_index)
{
  return light_index < 0 ? view.environment_casts_caustics : view.lights[light_index].casts_caustics;
}

/// A light that moves, as it is at a time.
[[gnu::noinline]] RELIEF_KERNEL void light_move(const LightsView& view, const Light& light, float time, Light& out)
{
  const Affine3 moved = motion_at(view.motions[light.motion_index], time);
  out = light;
  out.P = moved.p;
  out.edge_u = transform_vector(moved, light.edge_u);
  out.edge_v = transform_vector(moved, light.edge_v);
  out.axis = transform_vector(moved, light.axis);
}

/// A light in world space.
/// @param ref      not the environment
/// @param storage  where a copy's is put, and one's that moves
/// @param time     see motion.h
RELIEF_KERNEL const Light& lights_at(const LightsView& view, LightRef ref, Light& storage, float time = 0.0f)
{
  const Light& light = view.lights[ref.light_index];
  if (__builtin_expect(light.motion_index >= 0, 0)) {
    light_move(view, light, time, storage);
    return storage;
  }
  if (ref.copy_index < 0) return light;
  const LightCopy& copy = view.tree.copies[ref.copy_index];
  storage = light;
  storage.P = transform_point(copy.world_from_object, light.P);
  storage.edge_u = transform_vector(copy.world_from_object, light.edge_u);
  storage.edge_v = transform_vector(copy.world_from_object, light.edge_v);
  storage.axis = transform_vector(copy.world_from_object, light.axis) / copy.scale;
  storage.area = light.area * sqr(copy.scale);
  storage.instance_index = copy.instance_index;
  return storage;
}

/// Mean of the three channels, those that take light away as those that give it: the scalar by which lights are compared.
/// @param channels  their weights, 1 on average
RELIEF_KERNEL float light_scalar(Vec3f rgb, Vec3f channels = {1, 1, 1})
{
  return dot(abs(rgb), channels) * (1.0f / 3.0f);
}

/// Estimate of what one sun brings, its irradiance where nothing is glossy; 0 where all of it is below the horizon of N. Its cosine near
/// the horizon is estimated as light_tree_estimate does.
/// @param channels  as LightsView::channels
RELIEF_KERNEL float light_sun_importance(const Light& sun, Vec3f channels, const LightReceiver& at)
{
  const Vec3f N = at.N;
  float cosine = is_zero(N) ? 1.0f : -dot(N, sun.axis);
  if (sun.cone > 0.0f) {
    const float highest = cosine + __builtin_sqrtf(sun.cone * (2.0f - sun.cone));
    cosine = max(cosine, highest > 0.0f ? 0.3f * highest + 0.01f : 0.0f);
  }
  if (!(cosine > 0.0f)) return 0.0f;
  if (const LightGloss& gloss = at.gloss; gloss.share > 0.0f) {
    const float off = max(0.0f, 1.0f + dot(gloss.R, sun.axis));
    const float shown = light_gloss_eval(gloss, off, sun.cone * (2.0f - sun.cone));
    cosine = (1.0f - gloss.share) * cosine + gloss.share * shown;
  }
  return min(light_scalar(sun.emission, channels) * cosine, 1e30f);
}

RELIEF_KERNEL LightGroups light_groups_eval(const LightsView& view, Vec3f P, const LightReceiver& at)
{
  LightGroups groups;
  for (std::uint32_t i = 0; i < view.num_suns; ++i) {
    groups.sun_sum += light_sun_importance(view.lights[view.suns[i]], view.channels, at);
  }
  if (view.tree.blocks != nullptr) light_tree_estimate(view.tree, view.tree.root, P, at, groups.finite_root);

  float environment = 0.0f;
  if (view.environment_irradiance.mean > 0.0f &&
      !(groups.sun_sum + groups.finite_root.sum > view.environment_yields_to)) {
    environment = environment_irradiance_eval(view.environment_irradiance, at.N);
    if (const LightGloss& gloss = at.gloss; gloss.share > 0.0f) {
      environment += gloss.share * (environment_irradiance_eval(view.environment_irradiance, gloss.R) - environment);
    }
  }
  const float sum = environment + groups.sun_sum + groups.finite_root.sum;
  const int num_groups =
      (environment > 0.0f ? 1 : 0) + (groups.sun_sum > 0.0f ? 1 : 0) + (groups.finite_root.sum > 0.0f ? 1 : 0);
  if (num_groups == 0) return groups;
  constexpr float kDefensive = 0.25f;
  const float share = kDefensive / static_cast<float>(num_groups);
  const float scale = (1.0f - kDefensive) / sum;
  if (environment > 0.0f) groups.environment = scale * environment + share;
  if (groups.sun_sum > 0.0f) groups.suns = scale * groups.sun_sum + share;
  if (groups.finite_root.sum > 0.0f) groups.finite = scale * groups.finite_root.sum + share;
  return groups;
}

/// Samples the environment; the choice's probability is not in the pdf.
/// @param N  as in lights_sample: a constant environment is sampled by the cosine to it, if there is one
RELIEF_KERNEL LightSample light_environment_sample(const EnvironmentView& environment, Vec3f N, Vec2f u)
{
  LightSample sample;
  sample.distance = kInfinity;
  if (!environment.has_map && !is_zero(N)) {
    const Vec3f local = warp_cosine_hemisphere(u);
    sample.wi = from_local(frame_from_normal(N), local);
    sample.radiance = environment.color;
    sample.pdf = warp_cosine_hemisphere_pdf(local.z);
    return sample;
  }
  const EnvironmentSample found = environment_sample(environment, u);
  sample.wi = found.wi;
  sample.radiance = found.radiance;
  sample.pdf = found.pdf_solid_angle;
  return sample;
}

/// Density of light_environment_sample.
RELIEF_KERNEL float light_environment_pdf(const EnvironmentView& environment, Vec3f N, Vec3f wi)
{
  if (!environment.has_map && !is_zero(N)) return warp_cosine_hemisphere_pdf(dot(N, wi));
  return environment_pdf(environment, wi);
}

/// A light that lights_choose found.
struct LightsChoice {
  LightRef ref;
  float probability = 0;  ///< 0: none
  Vec2f u;                ///< [0, 1)²: place on it
};

/// Chooses one light or the environment by estimated contribution at P, and starts to fetch it.
/// @param P   world
/// @param at  what is there
/// @param u   both chooses and is the place on what is chosen
RELIEF_KERNEL LightsChoice lights_choose(const LightsView& view, Vec3f P, const LightReceiver& at, ChoicePoint u)
{
  if (view.only_light >= 0) return {{view.only_light}, 1.0f, choice_place(u)};
  const LightGroups groups = light_groups_eval(view, P, at);
  const double p_environment = static_cast<double>(groups.environment);
  const double p_suns = static_cast<double>(groups.suns);
  if (u.x < p_environment) return {{}, groups.environment, choice_place({choice_rest(u.x, p_environment), u.y})};
  const double choice = u.x - p_environment;
  if (choice < p_suns) {
    const double scale = static_cast<double>(groups.sun_sum) / p_suns;
    double target = choice * scale;
    LightsChoice chosen;
    for (std::uint32_t i = 0; i < view.num_suns; ++i) {
      const float importance = light_sun_importance(view.lights[view.suns[i]], view.channels, at);
      if (!(importance > 0.0f)) continue;
      const double width = static_cast<double>(importance);
      chosen = {{static_cast<std::int32_t>(view.suns[i])},
                groups.suns * importance / groups.sun_sum,
                choice_place({choice_rest(target, width), u.y})};
      if (target < width) break;
      target -= width;
    }
    return chosen;
  }
  if (!(groups.finite > 0.0f)) return {};
  const double in_group = choice_rest(choice - p_suns, static_cast<double>(groups.finite));
  const LightChoice chosen = light_tree_sample(view.tree, groups.finite_root, P, at, in_group);
  // Among thousands of lights this one is in no near cache; what the caller does meanwhile hides half of the wait.
  const Light* light = &view.lights[chosen.light_index];
  __builtin_prefetch(light);
  __builtin_prefetch(reinterpret_cast<const char*>(light) + 64);
  return {{static_cast<std::int32_t>(chosen.light_index), chosen.copy_index},
          groups.finite * chosen.probability,
          choice_place({chosen.rest, u.y})};
}

/// Samples a light that lights_choose has chosen.
/// @param light  in world space; null: the environment
/// @param N      of the LightReceiver handed to it
/// @return       pdf includes the choice; see LightSample
RELIEF_KERNEL LightSample
lights_sample_chosen(const LightsView& view, LightsChoice chosen, const Light* light, Vec3f P, Vec3f N)
{
  LightSample sample =
      light == nullptr ? light_environment_sample(view.environment, N, chosen.u) : light_sample(*light, P, chosen.u);
  sample.pdf *= chosen.probability;
  sample.ref = chosen.ref;
  return sample;
}

/// Chooses one light or the environment by estimated contribution at P and samples it.
/// @param P, at, u  as in lights_choose
/// @param time      as in lights_at
RELIEF_KERNEL LightSample
lights_sample(const LightsView& view, Vec3f P, const LightReceiver& at, ChoicePoint u, float time = 0.0f)
{
  const LightsChoice chosen = lights_choose(view, P, at, u);
  if (!(chosen.probability > 0.0f)) return {};
  Light storage;
  const Light* light = chosen.ref.light_index >= 0 ? &lights_at(view, chosen.ref, storage, time) : nullptr;
  return lights_sample_chosen(view, chosen, light, P, at.N);
}

/// Density with which lights_sample, called at P, would have made a ray that hit an area light.
/// @param at        as handed to lights_sample
/// @param ref       rectangle, disk or triangle; the second triangle of a rectangle stands for it
/// @param wi        unit, from P to the light
/// @param distance  metres, of the hit
/// @param time      as in lights_at
/// @return          solid angle × choice, as LightSample::pdf
RELIEF_KERNEL float lights_pdf(const LightsView& view,
                               Vec3f P,
                               const LightReceiver& at,
                               LightRef ref,
                               Vec3f wi,
                               float distance,
                               float time = 0.0f)
{
  Light storage;
  if (view.lights[ref.light_index].whole_index >= 0) ref.light_index = view.lights[ref.light_index].whole_index;
  if (view.only_light >= 0) {
    return view.only_light == ref.light_index ? light_pdf(lights_at(view, ref, storage, time), P, wi, distance) : 0.0f;
  }
  const LightGroups groups = light_groups_eval(view, P, at);
  const float choice = light_tree_pdf(view.tree, groups.finite_root, P, at, static_cast<std::uint32_t>(ref.light_index),
                                      view.light_trails[ref.light_index], ref.copy_index);
  if (!(choice > 0.0f)) return 0.0f;
  return groups.finite * choice * light_pdf(lights_at(view, ref, storage, time), P, wi, distance);
}

/// Density with which lights_sample, called at P, would have chosen a direction of a sun that it meets.
/// @param wi         unit, towards it
/// @param sun_index  in `lights`
RELIEF_KERNEL float lights_sun_pdf(const LightsView& view,
                                   Vec3f P,
                                   const LightReceiver& at,
                                   Vec3f wi,
                                   std::uint32_t sun_index)
{
  const Light& sun = view.lights[sun_index];
  const float importance = light_sun_importance(sun, view.channels, at);
  if (!(importance > 0.0f)) return 0.0f;
  const LightGroups groups = light_groups_eval(view, P, at);
  return groups.suns * (importance / groups.sun_sum) * sun_light_pdf(sun, wi);
}

/// Share of the light that gets to a place in media, as far as it is known, that is the environment's; 0: it is not asked for there.
RELIEF_KERNEL float lights_sky_share(const LightsView& view, Vec3f P)
{
  if (!(view.sky_in_media > 0.0f)) return 0.0f;
  const LightGroups groups = light_groups_eval(view, P, {});
  // From all sides comes four times the irradiance of a surface.
  const float sky = 4.0f * view.sky_in_media;
  return sky / (sky + groups.sun_sum + groups.finite_root.sum);
}

/// Density with which lights_sample, called at P, would have chosen a direction of the environment.
RELIEF_KERNEL float lights_environment_pdf(const LightsView& view, Vec3f P, const LightReceiver& at, Vec3f wi)
{
  if (!(view.environment_irradiance.mean > 0.0f)) return 0.0f;
  const bool alone = view.num_suns == 0 && view.tree.blocks == nullptr;
  const float probability = alone ? 1.0f : light_groups_eval(view, P, at).environment;
  return probability * light_environment_pdf(view.environment, at.N, wi);
}

}  // namespace relief
