// What gathered photons (gather_photons.h) bring to a surface.
#pragma once

#include "kernel/photon/gather.h"
#include "kernel/stage/scatter_event.h"

namespace relief {

/// What a rough caster makes of the photon that was gathered, by its soft lobes and by the tails of the sharp ones: each as
/// far as the limits of bounces allow.
/// @param wo, wi    in the closure's frame
/// @param wi_world  the same as wi
template <unsigned kFeatures, typename Closure>
[[gnu::noinline]] RELIEF_KERNEL Vec3f shade_surface_tails(const KernelGlobals& g,
                                                          const PathState& state,
                                                          std::uint32_t path,
                                                          const ScatterEvent<Closure>& event,
                                                          Vec3f wo,
                                                          Vec3f wi,
                                                          Vec3f wi_world)
{
  const Closure& closure = event.closure;
  const auto allowed = [&](BounceKind kind) {
    std::uint32_t left = 0;
    return photon_bounces_left(g.limits, state.bounces[path], kind, &left) &&
           photon_bounces_allowed(state.caustic.bounces[path], left);
  };
  const float pdf = closure_eval<kFeatures>(closure, *g.bsdf_tables, wi).pdf;
  const SharpLobes sharp = path_sharp_lobes(g, state.flags[path], event.at, wi_world, pdf);
  const Vec3f soft = shade_surface_soft<kFeatures>(g, closure, kAllSharp, wi);
  const Vec3f both = shade_surface_soft<kFeatures>(g, closure, sharp, wi);
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
                                         const ScatterEvent<Closure>& event,
                                         Vec3f wo)
{
  const SurfaceInteraction& at = event.at;
  const CausticStateView& caustic = state.caustic;
  const Vec3f irradiance = (*caustic.irradiance)[path];
  if (is_zero(irradiance)) return;
  const Vec3f wi = octahedral_decode(caustic.wi[path]);
  const Vec3f wi_local = to_local(at.side.frame, wi);
  Vec3f f;
  if (path_gathers_tails(state.flags[path], *at.instance)) {
    f = shade_surface_tails<kFeatures>(g, state, path, event, wo, wi_local, wi);
  } else {
    const SharpLobes sharp = sharp_lobes(at.params, (at.instance->flags & kCausticCaster) != 0, g.caustics.roughness);
    f = closure_eval<kFeatures>(closure_soft(event.closure, sharp), *g.bsdf_tables, wi_local).f;
  }
  // Photons count light by the area of the true surface, the BSDF by that of the shaded one. The bound keeps single
  // photons that graze the former from shining where the latter faces them.
  constexpr float kLeastCosine = 0.01f;
  const float by_area =
      __builtin_fabsf(dot(wi, at.side.frame.n)) / max(__builtin_fabsf(dot(wi, at.side.Ng)), kLeastCosine);
  const Vec3f radiance = event.throughput * f * irradiance * by_area;
  const Vec3f light = radiance_clamped(radiance, g.clamp_indirect);
  (*caustic.radiance)[path] = (*caustic.radiance)[path] + light;
  if constexpr (kTellsEvents<Closure>) {
    if (__builtin_expect(state.light_passes != nullptr, 0)) {
      LightPassState& passes = state.light_passes[path];
      const bool is_first = path_bounces(state.bounces[path], BounceKind::kAll) == 0;
      light_passes_add(
          passes,
          is_first ? event_shares<kFeatures>(g, event.closure, wi_local, f, wo.z * wi_local.z < 0.0f) : passes.found,
          true, light);
    }
  }
}

}  // namespace relief
