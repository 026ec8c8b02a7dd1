// Next-event estimation at a surface: light is asked for, and a shadow ray queued.
#pragma once

#include "kernel/stage/light_ask.h"
#include "kernel/stage/scatter_event.h"

namespace relief {

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

/// Queues a shadow ray towards a light that answers.
/// @param wi    where it is, in the closure's frame
/// @param bsdf  of the closure there
template <unsigned kFeatures, typename Closure>
RELIEF_KERNEL void shade_surface_lit(const KernelGlobals& g,
                                     const PathState& state,
                                     std::uint32_t path,
                                     const ScatterEvent<Closure>& event,
                                     const LightAnswer& answer,
                                     Vec3f wi,
                                     BsdfEval bsdf,
                                     ShadowQueue& shadow)
{
  const SurfaceInteraction& at = event.at;
  const Closure& closure = event.closure;
  const Vec3f P = at.hit.P;
  const int bounce = path_bounces(state.bounces[path], BounceKind::kAll);
  const LightSample& light = answer.sample;
  const Light* const emitter = answer.emitter;
  // Cycles asks no even surroundings: paths alone find them, which go nowhere below the true surface.
  const bool is_even_sky = emitter == nullptr && !g.lights.environment.has_map;
  const bool is_curve = (at.instance->flags & kCurves) != 0;
  if (is_even_sky && !is_curve) {
    const bool is_above = dot(light.wi, at.side.Ng) > 0.0f;
    if (is_above != (wi.z > 0.0f) || (!is_above && !at.transmits)) return;
  }
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
      bsdf.f = shade_surface_soft<kFeatures>(g, closure, kAllSharp, wi);
    }
  }
  bool is_found_here_alone = light.delta || (emitter != nullptr && !emitter->multiple_importance);
  if (emitter != nullptr && __builtin_expect(emitter->hidden_from != 0, 0)) {
    const LightHides hides = light_hides(*emitter, transmits());
    // Rays that do not see a mesh pass it, each by its own lobe.
    is_found_here_alone = is_found_here_alone || (hides.differs() && emitter->instance_index < 0);
    bsdf.f = shade_surface_seen_by<kFeatures>(g, closure, wi, bsdf.f, hides);
  }
  if (is_zero(bsdf.f)) return;
  if constexpr (kTellsEvents<Closure>) {
    if (__builtin_expect(state.light_passes != nullptr, 0) && bounce == 0) {
      state.light_passes[path].asked = event_shares<kFeatures>(g, closure, wi, bsdf.f, transmits());
    }
  }
  const float cos_i = __builtin_fabsf(wi.z);
  const float weight = path_light_weight(g.light_technique, light.pdf, bsdf.pdf, is_found_here_alone);
  const Vec3f gain = event.throughput * bsdf.f * answer.radiance * (cos_i * weight / light.pdf);
  if (is_zero(gain)) return;

  const Vec3f O = is_even_sky ? surface_ray_origin(at, light.wi) : surface_light_origin(at, light.wi);
  Vec3f D;
  float t_max = 0;
  shadow_ray_aim(light, emitter, P, O, D, t_max);
  shadow_queue_push(shadow, path, O, D, t_max, event.cone, gain,
                    path_shadow_scatterings(state, path, bounce + 1, asked_light_group(g, emitter)));
}

/// Asks a light, and queues a shadow ray towards it.
/// @param chosen  from lights_choose
template <unsigned kFeatures, typename Closure>
RELIEF_KERNEL void shade_surface_light(const KernelGlobals& g,
                                       const PathState& state,
                                       std::uint32_t path,
                                       const ScatterEvent<Closure>& event,
                                       LightsChoice chosen,
                                       ShadowQueue& shadow)
{
  Light storage;
  const LightAnswer answer = light_ask(g, state, path, chosen, event.at.hit.P, event.receiver.N, storage);
  if (!light_answers(answer)) return;
  const Vec3f wi = to_local(event.at.side.frame, answer.sample.wi);
  const BsdfEval bsdf = closure_eval<kFeatures>(event.closure, *g.bsdf_tables, wi);
  shade_surface_lit<kFeatures>(g, state, path, event, answer, wi, bsdf, shadow);
}

}  // namespace relief
