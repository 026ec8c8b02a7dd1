// Stage: a path met a surface. The heart of the path tracer: what the surface emits (here), what the film is told of it
// (surface_first_hit.h), light that is asked for (surface_light.h), photons (surface_photons.h), the way on (surface_continue.h).
//
// shade_surface is one function for each set of features, with all that it calls inside but what is marked noinline: what is
// seldom met. With that inside too, compiling took twice as long, and nothing was faster.
#pragma once

#include "kernel/counters.h"
#include "kernel/sample/dimensions.h"
#include "kernel/sample/sobol.h"
#include "kernel/stage/enter_surface.h"
#include "kernel/stage/surface_continue.h"
#include "kernel/stage/surface_first_hit.h"
#include "kernel/stage/surface_light.h"
#include "kernel/stage/surface_photons.h"

namespace relief {

/// Density with which the path's last surface would have asked for the light that it has met.
[[gnu::noinline]] RELIEF_KERNEL float
shade_surface_light_pdf(const KernelGlobals& g, const PathState& state, std::uint32_t path, const SurfaceInteraction& at)
{
  const LightRef hit{at.instance->first_light_index + static_cast<std::int32_t>(at.triangle), at.instance->light_copy_index};
  return lights_pdf(g.lights, path_origin(state, path), path_scattered_at(state, path), hit,
                    path_direction(state, path), state.hit_t[path], path_time(state, path));
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
      radiance *= path_bsdf_weight(g.light_technique, pdf, shade_surface_light_pdf(g, state, path, at));
    }
    if (bounce == 0) film_add_emission(g.film, state.pixel[path], throughput * radiance);
    path_add_radiance(g, state, path, bounce, throughput * radiance,
                      (at.instance->flags & kLightGroup) >> kLightGroupShift);
  }
}

/// Tells the film of what is a hole in it: closures that are, and all of an object but what lets rays through. Whatever else there
/// is of the surface, the film gets as well.
/// @return  whether the path ends here unless it is let through
template <unsigned kFeatures>
RELIEF_KERNEL bool shade_surface_holdout(const KernelGlobals& g,
                                         const PathState& state,
                                         std::uint32_t path,
                                         const SurfaceInteraction& at)
{
  if ((state.flags[path] & kPathCovers) != 0) return false;
  const bool is_object = (at.instance->flags & kHoldout) != 0;
  const float opacity = 1.0f - (1.0f - at.params.alpha) * light_scalar(at.passed);
  const float hole = is_object ? opacity : at.holdout;
  if (hole > 0.0f) {
    const float share = hole * light_scalar(path_throughput(state, path));
    film_add_holdout(g.film, state.pixel[path], share);
    film_add_clear(g.film, state.pixel[path], share);
  }
  return is_object || hole == 1.0f;
}

/// How a path goes on from a surface.
enum class SurfaceWay : std::uint8_t {
  kEnds,
  kPasses,    ///< it is let through
  kScatters,  ///< by a sample of the closure, if there is one
};

/// What has come of a path at a surface, before its closure is asked.
struct SurfaceVisit {
  ScatterSamples u;
  Vec3f throughput;        ///< up to the surface
  LightReceiver receiver;  ///< given to lights_choose
  RayCone cone;
  LightsChoice chosen;  ///< the light that is asked for
  SurfaceWay way = SurfaceWay::kEnds;
};

/// Of a resolved surface: what it emits, what the film is told of it, which light is asked for, and whether the path is let
/// through.
/// @param lobes  of a material of closures
/// @param visit  has u, and gets the rest
template <unsigned kFeatures, typename Lobes>
RELIEF_KERNEL void shade_surface_meet(const KernelGlobals& g,
                                      PathState& state,
                                      std::uint32_t path,
                                      SurfaceInteraction& at,
                                      const Lobes& lobes,
                                      SurfaceVisit& visit,
                                      ShadowQueue& shadow,
                                      Counters& counters)
{
  ++counters.surface_hits;
  constexpr bool kMixture = (kFeatures & kFeatureMixture) != 0;
  visit.throughput = path_throughput(state, path);
  visit.cone = at.cone;
  if ((at.instance->flags & kDisplaced) != 0) visit.cone.width = min(visit.cone.width, state.hit_width[path]);
  visit.chosen.probability = 0.0f;
  visit.way = SurfaceWay::kEnds;
  const bool last = path_is_last(g, state, path);
  const bool is_held = shade_surface_holdout<kFeatures>(g, state, path, at);
  // Closures emit, and are lit, whether or not others let the path through.
  if (kMixture && !is_held) {
    shade_surface_emission<kFeatures>(g, state, path, at, visit.throughput);
    if (__builtin_expect(state.light_passes != nullptr, 0)) {
      shade_surface_event_colors<kFeatures>(g, state, path, at, lobes, visit.throughput);
    }
    visit.receiver = surface_receiver(state, at, lobes);
    if (g.has_lights && !last && !lobes_are_delta(lobes)) {
      visit.chosen = lights_choose(g.lights, at.hit.P, visit.receiver, visit.u.light);
    }
  }
  if (!surface_is_met<kFeatures>(state, path, at.params.alpha, path_surface(state, path))) {
    ++counters.transparent_hits;
    visit.way = SurfaceWay::kPasses;
    return;
  }
  if (is_held) {
    if ((state.flags[path] & kPathSawSurface) == 0) film_add_clear(g.film, state.pixel[path], -1.0f);
    return;
  }

  surface_interaction_frame<kFeatures>(g, state, path, -path_direction(state, path), at);
  if ((state.flags[path] & kPathSawSurface) == 0) {
    state.flags[path] |= kPathSawSurface;
    const Vec3f N = g.film.layout.normal >= 0 ? surface_mean_normal<kFeatures>(at, lobes) : at.side.Ns;
    shade_surface_first_hit<kFeatures>(g, state, path, at, N, shadow);
  }
  if constexpr (!kMixture) {
    if (__builtin_expect(state.light_passes != nullptr, 0)) {
      shade_surface_event_colors<kFeatures>(g, state, path, at, lobes, visit.throughput);
    }
    shade_surface_emission<kFeatures>(g, state, path, at, visit.throughput);
  }
  if (g.film.layout.denoising && (state.flags[path] & kPathSawFeature) == 0) {
    shade_surface_denoising<kFeatures>(g, state, path, at, visit.throughput, surface_mean_normal<kFeatures>(at, lobes));
  }
  if (at.params.unlit || last) return;
  visit.way = SurfaceWay::kScatters;
  if constexpr (!kMixture) {
    visit.receiver = surface_receiver(state, at, lobes);
    if (g.has_lights && !surface_is_delta(at.params)) {
      visit.chosen = lights_choose(g.lights, at.hit.P, visit.receiver, visit.u.light);
    }
  }
}

/// Where paths go from surfaces, and what is counted.
struct SurfaceSinks {
  QueueView& next;
  ShadowQueue& shadow;
  Counters& counters;
};

/// Shades one path at a resolved surface, as shade_surface.
/// @param visit  has u
template <unsigned kFeatures>
RELIEF_KERNEL void shade_surface_resolved(const KernelGlobals& g,
                                          PathState& state,
                                          std::uint32_t path,
                                          SurfaceInteraction& at,
                                          const MixtureLobes& lobes,
                                          SurfaceVisit& visit,
                                          const SurfaceSinks& sinks)
{
  constexpr bool kMixture = (kFeatures & kFeatureMixture) != 0;
  const Vec3f wo = -path_direction(state, path);
  QueueView& next = sinks.next;
  ShadowQueue& shadow = sinks.shadow;
  shade_surface_meet<kFeatures>(g, state, path, at, lobes, visit, shadow, sinks.counters);

  const auto ends = [&] {
    if (visit.way == SurfaceWay::kPasses && path_pass_through(g, state, path, at.passed)) queue_push(next, path);
    return visit.way != SurfaceWay::kScatters;
  };
  if constexpr (!kMixture) {
    if (ends()) return;
  }
  const ShadingSide& side = at.side;
  auto closure = [&] {
    if constexpr (kMixture) {
      return mixture_of(lobes, side.frame, side.Ng);
    } else {
      return surface_closure_make<kFeatures>(at.params, *g.bsdf_tables, to_local(side.frame, wo));
    }
  }();
  const ScatterEvent<decltype(closure)> event{at, closure, visit.throughput, visit.receiver, visit.cone};
  const auto light = [&] {
    if (visit.chosen.probability > 0.0f) shade_surface_light<kFeatures>(g, state, path, event, visit.chosen, shadow);
  };
  if constexpr (kMixture) {
    light();
    if (ends()) return;
    closure.gain = 1.0f / at.params.alpha;
  }
  // While the chosen light is on its way from memory, glTF's closures are sampled.
  const BsdfSample bsdf = closure_sample<kFeatures>(closure, *g.bsdf_tables, visit.u.branch, visit.u.bsdf);
  if constexpr (!kMixture) light();
  if constexpr ((kFeatures & kFeatureCaustics) != 0) {
    shade_surface_photons<kFeatures>(g, state, path, event, to_local(side.frame, wo));
  }
  if constexpr (kMixture) {
    if (__builtin_expect((bsdf.lobe & kLobeSubsurface) != 0, 0)) {
      path_enter_surface(state, path, at, lobes.lobes[bsdf.entered], bsdf, visit.throughput);
      return;
    }
  }
  shade_surface_split<kFeatures>(g, state, path, event, bsdf, visit.u, next);
}

/// Shades one path. Reads and writes every column but the hit's.
/// @param at     as surface_interactions_locate has it; is completed
/// @param graph  of the material's program at the hit; null: it has none
/// Next: intersect closest (pushed on `next`), or the path ends; it may fork. At most one ray is added to `shadow`, at a first hit two.
template <unsigned kFeatures>
[[gnu::flatten]] RELIEF_KERNEL void shade_surface(const KernelGlobals& g,
                                                  PathState& state,
                                                  std::uint32_t path,
                                                  SurfaceInteraction& at,
                                                  const SurfaceSinks& sinks,
                                                  const GraphHit* graph = nullptr)
{
  SurfaceVisit visit;
  // Early: nothing waits for them yet.
  visit.u = scatter_samples(state.pixel_hash[path], state.sample_index[path], path_surface(state, path));
  MixtureLobes lobes;
  surface_interaction_resolve<kFeatures>(g, state, path, -path_direction(state, path), at, lobes, graph);
  shade_surface_resolved<kFeatures>(g, state, path, at, lobes, visit, sinks);
}

}  // namespace relief
