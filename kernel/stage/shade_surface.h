// Stage: a path met a surface. Emission, next-event estimation, continuation: the heart of the path tracer.
#pragma once

#include "kernel/bsdf/glass_branches.h"
#include "kernel/bsdf/lobe_split.h"
#include "kernel/bsdf/mixture.h"
#include "kernel/counters.h"
#include "kernel/photon/gather.h"
#include "kernel/sample/dimensions.h"
#include "kernel/sample/sobol.h"
#include "kernel/shape/material_lookup.h"
#include "kernel/stage/emitter.h"
#include "kernel/stage/enter_surface.h"
#include "kernel/stage/surface_interaction.h"

namespace relief {

/// The part of a surface's f that is diffuse.
/// @param wi  in the closure's frame
template <unsigned kFeatures, typename Closure>
[[gnu::noinline]] RELIEF_KERNEL Vec3f shade_surface_diffuse(const KernelGlobals& g, const Closure& closure, Vec3f wi)
{
  return closure_eval<kFeatures>(closure_diffuse(closure), *g.bsdf_tables, wi).f;
}

/// The part of a surface's f that a light is not hidden from.
/// @param wi  in the closure's frame
/// @param f   of all
template <unsigned kFeatures, typename Closure>
[[gnu::noinline]] RELIEF_KERNEL Vec3f
shade_surface_seen_by(const KernelGlobals& g, const Closure& closure, Vec3f wi, Vec3f f, LightHides hides)
{
  if (!hides.differs()) return hides.diffuse ? Vec3f{} : f;
  const Vec3f diffuse = shade_surface_diffuse<kFeatures>(g, closure, wi);
  return hides.diffuse ? max(f - diffuse, Vec3f{}) : diffuse;
}

/// Queues a shadow ray towards a light sample taken at the hit.
/// @param chosen, light_N  from and given to lights_choose
template <unsigned kFeatures, typename Closure>
RELIEF_KERNEL void shade_surface_light(const KernelGlobals& g,
                                       const PathState& state,
                                       std::uint32_t path,
                                       const SurfaceInteraction& at,
                                       const Closure& closure,
                                       LightsChoice chosen,
                                       Vec3f light_N,
                                       RayCone cone,
                                       ShadowQueue& shadow)
{
  const Vec3f P = at.hit.P;
  const int bounce = path_bounces(state.bounces[path], BounceKind::kAll);
  Light storage;
  const Light* emitter =
      chosen.ref.light_index >= 0 ? &lights_at(g.lights, chosen.ref, storage, path_time(state, path)) : nullptr;
  const LightSample light = lights_sample_chosen(g.lights, chosen, emitter, P, light_N);
  if (!(light.pdf > 0.0f)) return;
  Vec3f radiance = light.radiance;
  // Any kernel may sample a textured or transparent emitter, so this is not a feature of the surface that is lit.
  if (emitter != nullptr && !emitter->is_even) {
    radiance = emitter_radiance(
        g, *emitter, radiance,
        {P + light.wi * light.distance, light.barycentric, -light.wi, path_light_ray(state, path, light.distance)});
  }
  if (is_zero(radiance)) return;
  const Vec3f wi = to_local(at.side.frame, light.wi);
  BsdfEval bsdf = closure_eval<kFeatures>(closure, *g.bsdf_tables, wi);
  const auto transmits = [&] { return (wi.z < 0.0f) != (dot(at.side.frame.n, path_direction(state, path)) > 0.0f); };
  if constexpr ((kFeatures & kFeatureMixture) == 0) {
    const std::uint32_t without = path_does_without(g, state.flags[path]);
    if (__builtin_expect(without != 0, 0) && events_have(without, transmits())) {
      bsdf.f = shade_surface_diffuse<kFeatures>(g, closure, wi);
    }
  }
  if constexpr ((kFeatures & kFeatureCaustics) != 0) {
    if (light_casts_caustics(g.lights, light.ref.light_index) && path_caustic_after(state.flags[path], *at.instance) &&
        shading_is_reversible(at.side, light.wi) && !path_crosses_facets(state, path, light.wi) &&
        !path_is_alone(g, state.flags[path], transmits())) {
      bsdf.f = closure_eval<kFeatures>(closure_soft(closure, kAllSharp), *g.bsdf_tables, wi).f;
    }
  }
  bool is_found_here_alone = light.delta;
  if (emitter != nullptr && __builtin_expect(emitter->hidden_from != 0, 0)) {
    const LightHides hides = light_hides(*emitter, transmits());
    is_found_here_alone = light.delta || hides.differs();
    bsdf.f = shade_surface_seen_by<kFeatures>(g, closure, wi, bsdf.f, hides);
  }
  if (is_zero(bsdf.f)) return;
  const float cos_i = __builtin_fabsf(wi.z);
  const float weight = path_light_weight(g.light_technique, light.pdf, bsdf.pdf, is_found_here_alone);
  Vec3f gain = path_throughput(state, path) * bsdf.f * radiance * (cos_i * weight / light.pdf);
  // A lamp that stands in the path's medium; on the other side of a surface there is another.
  if (const Vec3f sigma_a = path_sigma_a(state, path); __builtin_expect(!is_zero(sigma_a), 0)) {
    const bool is_here = light.distance < kInfinity && (dot(light.wi, at.side.Ng) > 0.0f);
    if (is_here) gain *= path_transmittance(sigma_a, light.distance);
  }
  if (is_zero(gain)) return;

  const Vec3f O = surface_ray_origin(at, light.wi);
  Vec3f D;
  float t_max = 0;
  shadow_ray_aim(light, emitter, P, O, D, t_max);
  shadow_queue_push(shadow, path, O, D, t_max, cone, gain, static_cast<std::uint32_t>(bounce + 1));
}

/// Which lobes are sharp for this path towards a direction. What cannot be gone back stays sharp, as photons end there, and
/// what grazes the facet, where single photons would count for too much.
/// @param wi   unit, world
/// @param pdf  of the closure
RELIEF_KERNEL SharpLobes
path_sharp_lobes(const KernelGlobals& g, std::uint32_t flags, const SurfaceInteraction& at, Vec3f wi, float pdf)
{
  constexpr float kLeastCosine = 0.05f;
  SharpLobes sharp = sharp_lobes(at.params, (at.instance->flags & kCausticCaster) != 0, g.caustics.roughness);
  if (path_gathers_tails(flags, *at.instance) && pdf < kTailDensity &&
      __builtin_fabsf(dot(wi, at.side.Ng)) > kLeastCosine && shading_is_reversible(at.side, wi)) {
    sharp.base = false;
    sharp.most_roughness = -1.0f;
  }
  return sharp;
}

/// What a rough caster makes of the photon that was gathered, by its soft lobes and by the tails of the sharp ones: each as
/// far as the limits of bounces allow.
/// @param wo, wi    in the closure's frame
/// @param wi_world  the same as wi
template <unsigned kFeatures, typename Closure>
RELIEF_KERNEL Vec3f shade_surface_tails(const KernelGlobals& g,
                                        const PathState& state,
                                        std::uint32_t path,
                                        const SurfaceInteraction& at,
                                        const Closure& closure,
                                        Vec3f wo,
                                        Vec3f wi,
                                        Vec3f wi_world)
{
  const auto allowed = [&](BounceKind event) {
    std::uint32_t left = 0;
    return photon_bounces_left(g.limits, state.bounces[path], event, &left) &&
           photon_bounces_allowed(state.caustic.bounces[path], left);
  };
  const float pdf = closure_eval<kFeatures>(closure, *g.bsdf_tables, wi).pdf;
  const SharpLobes sharp = path_sharp_lobes(g, state.flags[path], at, wi_world, pdf);
  const Vec3f soft = closure_eval<kFeatures>(closure_soft(closure, kAllSharp), *g.bsdf_tables, wi).f;
  const Vec3f both = closure_eval<kFeatures>(closure_soft(closure, sharp), *g.bsdf_tables, wi).f;
  Vec3f f;
  if (allowed(BounceKind::kDiffuse)) f += soft;
  if (allowed(wo.z * wi.z > 0.0f ? BounceKind::kGlossy : BounceKind::kTransmission)) f += max(both - soft, Vec3f{});
  return f;
}

/// Adds what the photons around the hit bring to it.
/// @param wo  in the closure's frame
template <unsigned kFeatures, typename Closure>
RELIEF_KERNEL void shade_surface_photons(const KernelGlobals& g,
                                         PathState& state,
                                         std::uint32_t path,
                                         const SurfaceInteraction& at,
                                         const Closure& closure,
                                         Vec3f wo)
{
  const CausticStateView& caustic = state.caustic;
  const Vec3f irradiance = (*caustic.irradiance)[path];
  if (is_zero(irradiance)) return;
  const Vec3f wi = octahedral_decode(caustic.wi[path]);
  const Vec3f wi_local = to_local(at.side.frame, wi);
  Vec3f f;
  if (path_gathers_tails(state.flags[path], *at.instance)) {
    f = shade_surface_tails<kFeatures>(g, state, path, at, closure, wo, wi_local, wi);
  } else {
    const SharpLobes sharp = sharp_lobes(at.params, (at.instance->flags & kCausticCaster) != 0, g.caustics.roughness);
    f = closure_eval<kFeatures>(closure_soft(closure, sharp), *g.bsdf_tables, wi_local).f;
  }
  // Photons count light by the area of the true surface, the BSDF by that of the shaded one. The bound keeps single
  // photons that graze the former from shining where the latter faces them.
  constexpr float kLeastCosine = 0.01f;
  const float by_area =
      __builtin_fabsf(dot(wi, at.side.frame.n)) / max(__builtin_fabsf(dot(wi, at.side.Ng)), kLeastCosine);
  const Vec3f radiance = path_throughput(state, path) * f * irradiance * by_area;
  (*caustic.radiance)[path] = (*caustic.radiance)[path] + radiance_clamped(radiance, g.clamp_indirect);
}

/// Continuations into which a path splits where it enters rough glass, or leaves rough metal, that the camera sees. What shines there of lamps is met by a
/// small part of the lobe: of the squared error on benchmarks/caustics' `rough`, glass on a seventh of the picture had two
/// thirds, and of what photons then left, metal on a fourteenth half. With 2, 4 and 8 of them into glass error times processor time
/// was 0.84, 0.75 and 0.75 of what it is with one.
inline constexpr std::uint32_t kSplitsAtRough = 4;

RELIEF_KERNEL std::uint32_t path_splits_on(const PathState& state,
                                           std::uint32_t path,
                                           const SurfaceInteraction& at,
                                           const SurfaceClosure& closure)
{
  const bool seen_first = path_bounces(state.bounces[path], BounceKind::kAll) == 0;
  const GlassLobe& glass = closure.lobes;
  const bool rough_glass = glass.probability == 1.0f && !glass.delta && at.side.front;
  const bool rough_metal =
      lobe_of<SpecularLobe>(closure.lobes).probability > 0.5f && (at.instance->flags & kGathersTails) != 0;
  return seen_first && (rough_glass || rough_metal) && path_has_room(state, kSplitsAtRough) ? kSplitsAtRough : 1;
}

/// Lobes of mixtures do not fork.
RELIEF_KERNEL std::uint32_t path_splits_on(const PathState&, std::uint32_t, const SurfaceInteraction&, const Mixture&)
{
  return 1;
}

/// Whether a path may follow what glass reflects and what it refracts. By chance it takes the first one time in 25, and lamps
/// that it finds so are 25 times too bright.
RELIEF_KERNEL bool path_forks_at_glass(const PathState& state, std::uint32_t path, const SurfaceClosure& closure)
{
  return path_bounces(state.bounces[path], BounceKind::kAll) <= 1 &&
         path_bounces(state.bounces[path], BounceKind::kDiffuse) == 0 &&
         lobe_of<GlassLobe>(closure.lobes).probability == 1.0f && path_has_room(state, 2);
}

/// Russian roulette: a path goes on with the chance of this times what it carries beside what it carried behind its first surface.
/// That is about what its light is worth beside the pixel's: where the first surface is dark, so is the pixel, and errors weigh more.
/// By the square root of what is carried alone, squared errors were 1.3 to 1.5 times as large in scenes of dark things under a
/// sky. Rates from 2 to 4 differ by 5 % in error times processor time.
/// @source Vorba and Křivánek 2016, "Adjoint-Driven Russian Roulette and Splitting in Light Transport Simulation": here the
///         light that waits ahead counts as the same everywhere
inline constexpr float kSurvivalRate = 3.0f;

/// Sends a path on by a sample of its surface's BSDF, or ends it.
/// @param bsdf        pdf 0: none
/// @param share       of a fork, 1 else
/// @param throughput  up to the surface
/// @param cone        at the surface
template <unsigned kFeatures, typename Closure>
RELIEF_KERNEL void shade_surface_continue(const KernelGlobals& g,
                                          PathState& state,
                                          std::uint32_t path,
                                          const SurfaceInteraction& at,
                                          const Closure& closure,
                                          BsdfSample bsdf,
                                          float share,
                                          const ScatterSamples& u,
                                          Vec3f throughput,
                                          Vec3f light_N,
                                          RayCone cone,
                                          QueueView& next)
{
  const ShadingSide& side = at.side;
  const std::uint32_t bounces = state.bounces[path];
  if (!(bsdf.pdf > 0.0f)) return;
  const Vec3f wi = from_local(side.frame, bsdf.wi);
  const bool transmitted = (bsdf.lobe & kLobeTransmit) != 0;
  bool is_diffuse_alone = false;
  if constexpr ((kFeatures & kFeatureMixture) == 0) {
    const std::uint32_t without = path_does_without(g, state.flags[path]);
    is_diffuse_alone = __builtin_expect(without != 0, 0) && events_have(without, transmitted);
    if (is_diffuse_alone) {
      if ((bsdf.lobe & kLobeDelta) != 0) return;
      bsdf.f = shade_surface_diffuse<kFeatures>(g, closure, bsdf.wi);
    }
  }
  if constexpr ((kFeatures & kFeatureCaustics) != 0) {
    const SharpLobes sharp = path_sharp_lobes(g, state.flags[path], at, wi, bsdf.pdf);
    const bool is_sharp =
        !is_diffuse_alone && closure_split<kFeatures>(closure, *g.bsdf_tables, sharp, u.sharpness, bsdf);
    const bool is_alone = !shading_is_reversible(side, wi) || path_is_alone(g, state.flags[path], transmitted);
    const bool is_paths = (is_sharp && is_alone) || path_crosses_facets(state, path, wi);
    state.flags[path] = is_paths ? path_flags_left_to_paths(state.flags[path])
                                 : path_caustic_flags(state.flags[path], *at.instance, is_sharp);
  }
  throughput *= bsdf.f * (share * __builtin_fabsf(bsdf.wi.z) / bsdf.pdf);

  const bool first = path_bounces(bounces, BounceKind::kAll) == 0;
  const float carried = max_component(throughput);
  const float at_first = state.first_throughput[path] * (first ? min(1.0f, carried) : share);
  state.first_throughput[path] = at_first;
  if (!first) {
    const float survival = min(1.0f, kSurvivalRate * carried / at_first);
    if (!(u.roulette < survival)) return;
    throughput *= 1.0f / survival;
  }
  if (is_zero(throughput)) return;

  path_set_ray(state, path, surface_ray_origin(at, wi), wi);
  state.throughput[path] = throughput;
  const bool delta = (bsdf.lobe & kLobeDelta) != 0;
  state.pdf[path] = delta ? 0.0f : bsdf.pdf;
  if (!delta) state.least_pdf[path] = min(state.least_pdf[path], bsdf.pdf);
  state.scatter_N[path] = light_N;
  const bool diffuse = (bsdf.lobe & kLobeDiffuse) != 0;
  const BounceKind kind = transmitted ? BounceKind::kTransmission
                          : diffuse   ? BounceKind::kDiffuse
                                      : BounceKind::kGlossy;
  state.bounces[path] = bounces + 1u + (1u << static_cast<int>(kind));
  state.flags[path] = path_flags_after(state.flags[path], transmitted ? PathEvent::kTransmission
                                                          : diffuse   ? PathEvent::kDiffuse
                                                                      : PathEvent::kGlossy);
  const bool is_clear = transmitted && !diffuse && bsdf.roughness <= g.clear_alpha;
  if (!is_clear) state.flags[path] |= kPathCovers;
  if constexpr ((kFeatures & kFeatureTransmission) != 0) {
    if (transmitted && at.params.transmission > 0.0f && !at.params.thin) {
      const Vec3f inside = side.front ? at.params.sigma_a : Vec3f{};
      state.sigma_a[path] = inside;
    }
  }
  cone = ray_cone_scatter(cone, bsdf.roughness);
  state.cone_width[path] = cone.width;
  state.cone_spread[path] = cone.spread;
  queue_push(next, path);
}

/// Sends a path on as shade_surface_continue does, or in both ways that glass has, but where photons bring what it reflects.
/// @param bsdf  sampled with u
template <unsigned kFeatures, typename Closure>
RELIEF_KERNEL void shade_surface_scatter(const KernelGlobals& g,
                                         PathState& state,
                                         std::uint32_t path,
                                         const SurfaceInteraction& at,
                                         const Closure& closure,
                                         BsdfSample bsdf,
                                         float share,
                                         const ScatterSamples& u,
                                         Vec3f throughput,
                                         Vec3f light_N,
                                         RayCone cone,
                                         QueueView& next)
{
  if constexpr ((kFeatures & kFeatureCaustics) != 0 && (kFeatures & kFeatureTransmission) != 0 &&
                (kFeatures & kFeatureMixture) == 0) {
    if (path_forks_at_glass(state, path, closure)) {
      const GlassBranches branches = glass_branches_sample<kFeatures>(closure, *g.bsdf_tables, u.bsdf);
      const bool by_photons =
          path_gathers_tails(state.flags[path], *at.instance) && branches.reflected.pdf < kTailDensity;
      if (branches.reflectance < 1.0f && !by_photons) {
        shade_surface_continue<kFeatures>(g, state, path_fork(state, path), at, closure, branches.reflected,
                                          share * branches.reflectance, u, throughput, light_N, cone, next);
        bsdf = branches.refracted;
        share *= 1.0f - branches.reflectance;
      }
    }
  }
  shade_surface_continue<kFeatures>(g, state, path, at, closure, bsdf, share, u, throughput, light_N, cone, next);
}

/// Shading normal of all that scatters at a surface: of a mixture the mean of its lobes', each of which may be bumped, by
/// what they weigh, as in Cycles.
/// @return  at most unit length; shorter where lobes disagree
template <unsigned kFeatures>
RELIEF_KERNEL Vec3f surface_mean_normal(const SurfaceInteraction& at, const MixtureLobes& lobes)
{
  if (!has_mixture<kFeatures>(at)) return at.side.Ns;
  Vec3f sum;
  float total = 0;
  for (int i = 0; i < lobes.size; ++i) {
    const Vec3f weight = lobes.lobes[i].weight;
    const float share = __builtin_fabsf(weight.x + weight.y + weight.z);
    sum += share * lobes.lobes[i].frame.n;
    total += share;
  }
  return is_zero(sum) ? at.side.Ns : sum / total;
}

/// Queues a ray that sees whether the surroundings of a first hit are open.
RELIEF_KERNEL void shade_surface_ambient(const KernelGlobals& g,
                                         const PathState& state,
                                         std::uint32_t path,
                                         const SurfaceInteraction& at,
                                         ShadowQueue& shadow)
{
  const Vec2f u = sample_2d(state.pixel_hash[path], state.sample_index[path], kAmbientDimension);
  const Vec3f D = from_local(frame_from_normal(at.side.Ns), warp_cosine_hemisphere(u));
  if (!(dot(D, at.side.Ng) > 0.0f)) return;
  const Vec3f O = surface_ray_origin(at, D);
  shadow_queue_push(shadow, path, O, D, g.occlusion_distance, ray_cone_scatter(at.cone, 1.0f), {}, kAmbientRay);
}

/// Writes what the film keeps of a path's first hit.
/// @param N  see surface_mean_normal
RELIEF_KERNEL void shade_surface_first_hit(const KernelGlobals& g,
                                           const PathState& state,
                                           std::uint32_t path,
                                           const SurfaceInteraction& at,
                                           Vec3f N,
                                           ShadowQueue& shadow)
{
  const AccumulatorLayout& layout = g.film.layout;
  FirstHit first;
  first.P = at.hit.P;
  first.N = normalize(N);
  first.albedo = surface_albedo(at.params);
  first.uv = at.hit.uv[0];
  const Vec3f from_camera = at.hit.P - g.camera.world_from_camera.p;
  first.depth = dot(from_camera, g.camera_forward);
  const bool is_perspective = g.camera.projection == Projection::kPerspective;
  if (layout.mist >= 0) first.mist = mist_eval(g.mist, is_perspective ? length(from_camera) : first.depth);
  first.ray_length = state.hit_t[path];
  first.instance_index = state.hit_object[path];
  first.material_index = static_cast<std::uint32_t>(at.instance->material_index);
  for (int i = 0; i < kNumCryptomattes; ++i) {
    const bool by_material = kFirstCryptomatte + i == static_cast<int>(Aov::kCryptoMaterial);
    if (layout.cryptomatte[i] >= 0)
      first.cryptomatte_ids[i] = g.cryptomatte_ids[i][by_material ? first.material_index : first.instance_index];
  }
  first.is_first_sample = state.sample_index[path] == 0;
  first.is_even_sample = sample_is_even(state.sample_index[path], g.log2_stream);
  film_add_first_hit(g.film, state.pixel[path], first);
  if (layout.ambient_occlusion >= 0) shade_surface_ambient(g, state, path, at, shadow);
}

/// Whether a denoiser is better told of what is behind or mirrored by a surface. The same bounds as Cycles': a width of the
/// lobe α of .075, and less than a quarter of the light scattered otherwise.
RELIEF_KERNEL bool surface_is_seen_through(const SurfaceParams& p)
{
  constexpr float kLeastReflection = 0.04f;
  if (p.unlit || p.roughness > kSeenThroughRoughness) return false;
  const float base = max_component(p.base_color);
  const float diffuse = (1.0f - p.metallic) * (1.0f - p.transmission) * base;
  const float sharp = p.metallic * base + (1.0f - p.metallic) * (p.specular * kLeastReflection + p.transmission * base);
  return 4.0f * diffuse < diffuse + sharp;
}

/// Writes what a denoiser is told of a path, unless that is to be found further on.
/// @param N  see surface_mean_normal
RELIEF_KERNEL void shade_surface_denoising(const KernelGlobals& g,
                                           PathState& state,
                                           std::uint32_t path,
                                           const SurfaceInteraction& at,
                                           Vec3f N)
{
  if (surface_is_seen_through(at.params)) return;
  state.flags[path] |= kPathSawFeature;
  const Affine3& camera = g.camera.world_from_camera;
  const Vec3f N_camera{dot(N, normalize(camera.x)), dot(N, normalize(camera.y)), dot(N, g.camera_forward)};
  film_add_denoising(g.film, state.pixel[path], sample_is_even(state.sample_index[path], g.log2_stream),
                     path_throughput(state, path) * surface_albedo(at.params), N_camera);
}

/// Adds what a surface emits to a path that has met it.
/// @param throughput  up to the surface
template <unsigned kFeatures>
RELIEF_KERNEL void shade_surface_emission(const KernelGlobals& g,
                                          PathState& state,
                                          std::uint32_t path,
                                          const SurfaceInteraction& at,
                                          Vec3f throughput)
{
  const int bounce = path_bounces(state.bounces[path], BounceKind::kAll);
  const Vec3f wi = path_direction(state, path);
  bool emits = !is_zero(at.params.emission) && (at.side.front || at.material->double_sided || at.params.unlit);
  if constexpr ((kFeatures & kFeatureCaustics) != 0) {
    const bool is_light = at.instance->first_light_index >= 0;
    emits = emits && !(is_light && path_leaves_to_photons(g, state.flags[path], at.instance->first_light_index));
  }
  if (emits) {
    Vec3f radiance = at.params.emission;
    if (!at.params.unlit) path_add_denoising(g, state, path, throughput * radiance);
    const float pdf = state.pdf[path];
    if (pdf > 0.0f && at.instance->first_light_index >= 0) {
      const LightRef hit{at.instance->first_light_index + static_cast<std::int32_t>(at.triangle),
                         at.instance->light_copy_index};
      const float pdf_light = lights_pdf(g.lights, path_origin(state, path), path_scatter_N(state, path), hit, wi,
                                         state.hit_t[path], path_time(state, path));
      radiance *= path_bsdf_weight(g.light_technique, pdf, pdf_light);
    }
    if (bounce == 0) film_add_emission(g.film, state.pixel[path], throughput * radiance);
    path_add_radiance(g, state, path, bounce, throughput * radiance);
  }
}

/// Tells the film of what is a hole in it: closures that are, and all of an object but what lets rays through. Whatever else there
/// is of the surface, the film gets as well.
/// @param transmittance  of the path's ray
/// @return               whether the path ends here unless it is let through
template <unsigned kFeatures>
RELIEF_KERNEL bool shade_surface_holdout(const KernelGlobals& g,
                                         const PathState& state,
                                         std::uint32_t path,
                                         const SurfaceInteraction& at,
                                         Vec3f transmittance)
{
  if ((state.flags[path] & kPathCovers) != 0) return false;
  const bool is_object = (at.instance->flags & kHoldout) != 0;
  const float opacity = 1.0f - (1.0f - at.params.alpha) * light_scalar(at.passed);
  const float hole = is_object ? opacity : at.holdout;
  if (hole > 0.0f) {
    const float share = hole * light_scalar(path_throughput(state, path) * transmittance);
    film_add_holdout(g.film, state.pixel[path], share);
    film_add_clear(g.film, state.pixel[path], share);
  }
  return is_object || hole == 1.0f;
}

/// Shades one path. Reads and writes every column but the hit's.
/// @param graph  of the material's program at the hit; null: it has none
/// Next: intersect closest (pushed on `next`), or the path ends; it may fork. At most one ray is added to `shadow`, at a first hit two.
template <unsigned kFeatures>
[[gnu::flatten]] RELIEF_KERNEL void shade_surface(const KernelGlobals& g,
                                                  PathState& state,
                                                  std::uint32_t path,
                                                  QueueView& next,
                                                  ShadowQueue& shadow,
                                                  Counters& counters,
                                                  const GraphHit* graph = nullptr)
{
  ++counters.surface_hits;
  const Vec3f wo = -path_direction(state, path);
  const std::uint32_t sample = state.sample_index[path];
  const std::uint32_t bounces = state.bounces[path];
  const int bounce = path_bounces(bounces, BounceKind::kAll);
  const int surface = path_surface(state, path);
  // Early: nothing waits for them yet.
  const ScatterSamples u = scatter_samples(state.pixel_hash[path], sample, surface);

  constexpr bool kMixture = (kFeatures & kFeatureMixture) != 0;
  MixtureLobes lobes;
  SurfaceInteraction own;
  if (graph == nullptr) own = surface_interaction_locate<kFeatures>(g, state, path, wo);
  SurfaceInteraction& at = graph != nullptr ? *graph->at : own;
  surface_interaction_resolve<kFeatures>(g, state, path, wo, at, lobes, graph);
  // Whatever stands in a medium, of glass or not.
  const auto transmittance = [&] {
    const Vec3f sigma_a = path_sigma_a(state, path);
    return is_zero(sigma_a) ? Vec3f{1, 1, 1} : path_transmittance(sigma_a, path_ray_length(g, state, path));
  };
  const ShadingSide& side = at.side;
  RayCone cone = at.cone;
  if ((at.instance->flags & kDisplaced) != 0) cone.width = min(cone.width, state.hit_width[path]);
  const bool last = bounce > g.limits.total || path_bounces(bounces, BounceKind::kDiffuse) > g.limits.diffuse ||
                    path_bounces(bounces, BounceKind::kGlossy) > g.limits.glossy ||
                    path_bounces(bounces, BounceKind::kTransmission) > g.limits.transmission ||
                    (state.flags[path] & kPathLast) != 0;
  const bool is_held = shade_surface_holdout<kFeatures>(g, state, path, at, transmittance());
  // Closures emit, and are lit, whether or not others let the path through.
  if (kMixture && !is_held) {
    const Vec3f before = path_throughput(state, path);
    state.throughput[path] = before * transmittance();
    shade_surface_emission<kFeatures>(g, state, path, at, path_throughput(state, path));
    const Mixture closure = mixture_of(lobes, side.frame, side.Ng);
    if (g.has_lights && !last && !mixture_is_delta(closure)) {
      const Vec3f light_N = at.params.transmission > 0.0f ? Vec3f{} : side.Ns;
      const LightsChoice chosen = lights_choose(g.lights, at.hit.P, light_N, u.light);
      if (chosen.probability > 0.0f) {
        shade_surface_light<kFeatures>(g, state, path, at, closure, chosen, light_N, cone, shadow);
      }
    }
    state.throughput[path] = before;
  }
  if (!surface_is_met<kFeatures>(state, path, at.params.alpha, surface)) {
    ++counters.transparent_hits;
    if (path_pass_through(g, state, path, at.passed)) queue_push(next, path);
    return;
  }
  if (is_held) {
    if ((state.flags[path] & kPathSawSurface) == 0) film_add_clear(g.film, state.pixel[path], -1.0f);
    return;
  }

  Vec3f throughput = path_throughput(state, path);
  if (!is_zero(path_sigma_a(state, path))) {
    throughput *= transmittance();
    state.throughput[path] = throughput;
  }

  surface_interaction_frame<kFeatures>(g, state, path, wo, at);
  const SurfaceParams& params = at.params;
  const Vec3f wo_local = to_local(side.frame, wo);

  if ((state.flags[path] & kPathSawSurface) == 0) {
    state.flags[path] |= kPathSawSurface;
    const Vec3f N = g.film.layout.normal >= 0 ? surface_mean_normal<kFeatures>(at, lobes) : side.Ns;
    shade_surface_first_hit(g, state, path, at, N, shadow);
  }

  if constexpr (!kMixture) shade_surface_emission<kFeatures>(g, state, path, at, throughput);
  if (g.film.layout.denoising && (state.flags[path] & kPathSawFeature) == 0) {
    shade_surface_denoising(g, state, path, at, surface_mean_normal<kFeatures>(at, lobes));
  }
  if (params.unlit || last) return;

  const Vec3f light_N = params.transmission > 0.0f ? Vec3f{} : side.Ns;
  LightsChoice chosen;
  if constexpr (!kMixture) {
    if (g.has_lights && !surface_is_delta(params)) {
      chosen = lights_choose(g.lights, at.hit.P, light_N, u.light);
    }
  }

  // While the chosen light is on its way from memory, the BSDF is sampled.
  const auto closure = [&] {
    if constexpr (kMixture) {
      return mixture_of(lobes, side.frame, side.Ng, 1.0f / params.alpha);
    } else {
      return surface_closure_make<kFeatures>(params, *g.bsdf_tables, wo_local);
    }
  }();
  const BsdfSample bsdf = closure_sample<kFeatures>(closure, *g.bsdf_tables, u.branch, u.bsdf);

  if (chosen.probability > 0.0f) {
    shade_surface_light<kFeatures>(g, state, path, at, closure, chosen, light_N, cone, shadow);
  }

  if constexpr ((kFeatures & kFeatureCaustics) != 0) {
    shade_surface_photons<kFeatures>(g, state, path, at, closure, wo_local);
  }

  if constexpr (kMixture) {
    if (__builtin_expect((bsdf.lobe & kLobeSubsurface) != 0, 0)) {
      path_enter_surface(state, path, at, lobes.lobes[bsdf.entered], bsdf, throughput);
      return;
    }
  }

  if constexpr ((kFeatures & kFeatureCaustics) != 0 && (kFeatures & kFeatureTransmission) != 0) {
    const std::uint32_t splits = path_splits_on(state, path, at, closure);
    if (splits > 1) {
      for (std::uint32_t k = splits; k-- > 0;) {
        // The continuations of all samples share one stratified set of points; ahead, each has numbers of its own.
        const ScatterSamples v = scatter_samples(state.pixel_hash[path], sample * splits + k, surface);
        const std::uint32_t copy = k > 0 ? path_fork(state, path) : path;
        if (k > 0) state.pixel_hash[copy] = hash_mix_32(state.pixel_hash[path] + k);
        shade_surface_scatter<kFeatures>(g, state, copy, at, closure,
                                         closure_sample<kFeatures>(closure, *g.bsdf_tables, v.branch, v.bsdf),
                                         1.0f / static_cast<float>(splits), v, throughput, light_N, cone, next);
      }
      return;
    }
  }
  shade_surface_scatter<kFeatures>(g, state, path, at, closure, bsdf, 1.0f, u, throughput, light_N, cone, next);
}

}  // namespace relief
