// The way on from a surface: a direction by its lobes, roulette, and what the path carries from there. Where photons are traced it
// may be more ways than one.
#pragma once

#include "kernel/bsdf/glass_branches.h"
#include "kernel/photon/gather.h"
#include "kernel/stage/path_end.h"
#include "kernel/stage/scatter_event.h"

namespace relief {

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

/// Sends a path on by a sample of its surface's BSDF, or ends it.
/// @param bsdf   pdf 0: none
/// @param share  of a fork, 1 else
template <unsigned kFeatures, typename Closure>
RELIEF_KERNEL void shade_surface_continue(const KernelGlobals& g,
                                          PathState& state,
                                          std::uint32_t path,
                                          const ScatterEvent<Closure>& event,
                                          BsdfSample bsdf,
                                          float share,
                                          const ScatterSamples& u,
                                          QueueView& next)
{
  const SurfaceInteraction& at = event.at;
  const ShadingSide& side = at.side;
  const std::uint32_t bounces = state.bounces[path];
  if (!(bsdf.pdf > 0.0f)) return;
  const Vec3f wi = from_local(side.frame, bsdf.wi);
  const bool transmitted = (bsdf.lobe & kLobeTransmit) != 0;
  // As closures are sampled: ribbons are shaded as if they were round.
  const bool is_curve = (at.instance->flags & kCurves) != 0;
  if (!at.material->has_closures && !transmitted && !is_curve && dot(wi, side.Ng) < 0.0f) return;
  bool is_diffuse_alone = false, is_sharp = (bsdf.lobe & kLobeDelta) != 0;
  if constexpr ((kFeatures & kFeatureMixture) == 0) {
    const std::uint32_t without = path_does_without(g, state.flags[path]);
    is_diffuse_alone = __builtin_expect(without != 0, 0) && events_have(without, transmitted);
    if (is_diffuse_alone) {
      if ((bsdf.lobe & kLobeDelta) != 0) return;
      bsdf.f = shade_surface_diffuse<kFeatures>(g, event.closure, bsdf.wi);
    }
  }
  if constexpr ((kFeatures & kFeatureCaustics) != 0) {
    const SharpLobes sharp = path_sharp_lobes(g, state.flags[path], at, wi, bsdf.pdf);
    is_sharp = !is_diffuse_alone && closure_split<kFeatures>(event.closure, *g.bsdf_tables, sharp, u.sharpness, bsdf);
    const bool is_alone = !shading_is_reversible(side, wi) || path_is_alone(g, state.flags[path], transmitted);
    const bool is_paths = (is_sharp && is_alone) || path_crosses_facets(state, path, wi);
    state.flags[path] = is_paths ? path_flags_left_to_paths(state.flags[path])
                                 : path_caustic_flags(state.flags[path], *at.instance, is_sharp);
  }
  Vec3f throughput = event.throughput * (bsdf.f * (share * __builtin_fabsf(bsdf.wi.z) / bsdf.pdf));

  const bool first = path_bounces(bounces, BounceKind::kAll) == 0;
  if constexpr (kTellsEvents<Closure>) {
    if (__builtin_expect(state.light_passes != nullptr, 0) && first) {
      state.light_passes[path].found = is_sharp
                                           ? event_shares_sharp(event.closure, transmitted)
                                           : event_shares<kFeatures>(g, event.closure, bsdf.wi, bsdf.f, transmitted);
    }
  }
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
  path_set_scattered_at(state, path, event.receiver);
  const bool diffuse = (bsdf.lobe & kLobeDiffuse) != 0;
  const BounceKind kind = transmitted ? BounceKind::kTransmission
                          : diffuse   ? BounceKind::kDiffuse
                                      : BounceKind::kGlossy;
  state.bounces[path] = bounces + 1u + (1u << static_cast<int>(kind));
  state.flags[path] = path_flags_after(state.flags[path], transmitted ? PathEvent::kTransmission
                                                          : diffuse   ? PathEvent::kDiffuse
                                                                      : PathEvent::kGlossy);
  if (transmitted && diffuse) state.flags[path] |= kPathTranslucent;
  const bool is_clear = transmitted && !diffuse && bsdf.roughness <= g.clear_alpha;
  if (!is_clear) state.flags[path] |= kPathCovers;
  const RayCone cone = ray_cone_scatter(event.cone, bsdf.roughness);
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
                                         const ScatterEvent<Closure>& event,
                                         BsdfSample bsdf,
                                         float share,
                                         const ScatterSamples& u,
                                         QueueView& next)
{
  if constexpr ((kFeatures & kFeatureCaustics) != 0 && (kFeatures & kFeatureTransmission) != 0 &&
                (kFeatures & kFeatureMixture) == 0) {
    if (path_forks_at_glass(state, path, event.closure)) {
      const GlassBranches branches = glass_branches_sample<kFeatures>(event.closure, *g.bsdf_tables, u.bsdf);
      const bool by_photons =
          path_gathers_tails(state.flags[path], *event.at.instance) && branches.reflected.pdf < kTailDensity;
      if (branches.reflectance < 1.0f && !by_photons) {
        shade_surface_continue<kFeatures>(g, state, path_fork(state, path), event, branches.reflected,
                                          share * branches.reflectance, u, next);
        bsdf = branches.refracted;
        share *= 1.0f - branches.reflectance;
      }
    }
  }
  shade_surface_continue<kFeatures>(g, state, path, event, bsdf, share, u, next);
}

/// Sends a path on as several, each as shade_surface_scatter does.
template <unsigned kFeatures, typename Closure>
[[gnu::noinline]] RELIEF_KERNEL void shade_surface_scatter_as_several(const KernelGlobals& g,
                                                                      PathState& state,
                                                                      std::uint32_t path,
                                                                      const ScatterEvent<Closure>& event,
                                                                      std::uint32_t splits,
                                                                      QueueView& next)
{
  const std::uint32_t sample = state.sample_index[path];
  const int surface = path_surface(state, path);
  for (std::uint32_t k = splits; k-- > 0;) {
    // The continuations of all samples share one stratified set of points; ahead, each has numbers of its own.
    const ScatterSamples v = scatter_samples(state.pixel_hash[path], sample * splits + k, surface);
    const std::uint32_t copy = k > 0 ? path_fork(state, path) : path;
    if (k > 0) state.pixel_hash[copy] = hash_mix_32(state.pixel_hash[path] + k);
    shade_surface_scatter<kFeatures>(g, state, copy, event,
                                     closure_sample<kFeatures>(event.closure, *g.bsdf_tables, v.branch, v.bsdf),
                                     1.0f / static_cast<float>(splits), v, next);
  }
}

/// Sends a path on by several samples of a first surface where path_splits_on says so, else by one.
/// @param bsdf  sampled with u
template <unsigned kFeatures, typename Closure>
RELIEF_KERNEL void shade_surface_split(const KernelGlobals& g,
                                       PathState& state,
                                       std::uint32_t path,
                                       const ScatterEvent<Closure>& event,
                                       const BsdfSample& bsdf,
                                       const ScatterSamples& u,
                                       QueueView& next)
{
  if constexpr ((kFeatures & kFeatureCaustics) != 0 && (kFeatures & kFeatureTransmission) != 0) {
    const std::uint32_t splits = path_splits_on(state, path, event.at, event.closure);
    if (splits > 1) {
      shade_surface_scatter_as_several<kFeatures>(g, state, path, event, splits, next);
      return;
    }
  }
  shade_surface_scatter<kFeatures>(g, state, path, event, bsdf, 1.0f, u, next);
}

}  // namespace relief
