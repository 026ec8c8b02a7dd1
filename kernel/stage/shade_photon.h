// Stage: a photon met a surface. It is kept where soft lobes can show it, or tails of sharp ones, and goes on by sharp lobes
// of casters. By soft lobes it goes on from where they show it, if a caster is next: a bright caustic is a lamp to the
// glass above it.
#pragma once

#include "kernel/bsdf/lobe_split.h"
#include "kernel/photon/sources.h"
#include "kernel/sample/dimensions.h"
#include "kernel/sample/sobol.h"
#include "kernel/stage/photon_queue.h"
#include "kernel/stage/surface_interaction.h"

namespace relief {

/// Scatters a photon.
/// @param closure  of the surface for wo
/// @param soft     the map has it, for soft lobes to show: they scatter as well
/// @return false: its path ends
template <typename Closure>
RELIEF_KERNEL bool shade_photon_scatter(const KernelGlobals& g,
                                        PathState& state,
                                        std::uint32_t path,
                                        const SurfaceInteraction& at,
                                        Vec3f wo,
                                        Vec3f throughput,
                                        Closure closure,
                                        bool soft)
{
  const ShadingSide& side = at.side;
  const Vec3f wo_local = to_local(side.frame, wo);
  const bool caster = (at.instance->flags & kCausticCaster) != 0;
  if (!soft) closure = closure_sharp(closure, kAllSharp);
  const int surface = path_surface(state, path);
  const ScatterSamples u = scatter_samples(state.pixel_hash[path], state.sample_index[path], surface);
  BsdfSample bsdf = closure_sample<kFeatureAll, TransportMode::kImportance>(closure, *g.bsdf_tables, u.branch, u.bsdf);
  if (!(bsdf.pdf > 0.0f)) return false;
  const bool sharp = closure_split<kFeatureAll, TransportMode::kImportance>(
      closure, *g.bsdf_tables, sharp_lobes(at.params, caster, g.caustics.roughness), u.sharpness, bsdf);
  if (sharp && !caster) return false;
  const bool transmitted = (bsdf.lobe & kLobeTransmit) != 0;
  const PathEvent event = transmitted ? PathEvent::kTransmission : PathEvent::kGlossy;
  const bool is_first = (state.flags[path] & kPathCaustic) == 0;
  if (is_first && (state.flags[path] >> kPathHiddenShift >> static_cast<int>(event) & 1u) != 0) return false;
  const Vec3f wi = from_local(side.frame, bsdf.wi);
  if (!shading_is_reversible(side, wi) || path_crosses_facets(state, path, wi)) return false;
  // The adjoint of a BSDF with shading normals is not symmetric (Veach 1997, Eq. 5.19).
  const float cos_o = __builtin_fabsf(dot(wo, side.Ng));
  if (!(cos_o > 0.0f)) return false;
  const float adjoint = __builtin_fabsf(wo_local.z) * __builtin_fabsf(dot(wi, side.Ng)) / cos_o;
  const Vec3f scattered = throughput * bsdf.f * (adjoint / bsdf.pdf);

  // Roulette by what the surface takes: photons keep their power. What transmission_scale takes on the way into glass comes
  // back on the way out.
  const float survival = min(1.0f, max_component(abs(scattered)) * sqr(bsdf.eta) / max_component(abs(throughput)));
  if (!(u.roulette < survival)) return false;
  const Vec3f power = scattered / survival;
  if (is_zero(power) || !is_finite(power)) return false;

  path_set_ray(state, path, surface_ray_origin(at, wi), wi);
  state.throughput[path] = power;
  // A camera path counts the event next to the light, but no surface asks for that count any more.
  if ((state.flags[path] & kPathCaustic) != 0) {
    const BounceKind kind = transmitted                       ? BounceKind::kTransmission
                            : (bsdf.lobe & kLobeDiffuse) != 0 ? BounceKind::kDiffuse
                                                              : BounceKind::kGlossy;
    state.bounces[path] += 1u + (1u << static_cast<int>(kind));
  }
  const std::uint32_t flags = path_flags_after(state.flags[path], event);
  state.flags[path] = sharp ? (flags | kPathCaustic) & ~std::uint32_t{kPathAfterSoft} : flags | kPathAfterSoft;
  return path_bounces(state.bounces[path], BounceKind::kAll) - 1 <= g.limits.total;
}

/// Next: intersect closest (pushed on `next`), or the path ends. At most one photon is added to `photons`.
RELIEF_KERNEL void shade_photon(const KernelGlobals& g,
                                const PhotonSourcesView& sources,
                                PathState& state,
                                std::uint32_t path,
                                QueueView& next,
                                PhotonQueueView& photons)
{
  const Vec3f wo = -path_direction(state, path);
  constexpr unsigned kFeatures = kFeatureAll | kFeatureGraphs | kFeatureMixture;
  MixtureLobes lobes;
  SurfaceInteraction at = surface_interaction_locate<kFeatures>(g, state, path, wo);
  surface_interaction_resolve<kFeatures>(g, state, path, wo, at, lobes);
  if (!surface_is_met<kFeatures>(state, path, at.params.alpha, path_surface(state, path))) {
    if (path_pass_through(g, state, path, at.passed)) queue_push(next, path);
    return;
  }
  const bool has_scattered = (state.flags[path] & kPathCaustic) != 0;
  const std::uint32_t flags = at.instance->flags;
  const bool aimed_at = sources.target_of[state.hit_object[path]] == static_cast<std::int32_t>(state.pixel[path]);
  if (at.params.unlit || !(has_scattered || aimed_at)) return;

  const Vec3f throughput = path_throughput(state, path);
  if (is_zero(throughput)) return;
  surface_interaction_frame<kFeatures>(g, state, path, wo, at);
  const bool caster = (flags & kCausticCaster) != 0;
  // From one facet to the next light is the paths' to bring: a search would have to know the heights of both.
  const bool arrived = has_scattered && (state.flags[path] & kPathAfterSoft) == 0 &&
                       (g.caustics.switched_off >> path_event(state.flags[path]) & 1u) == 0 &&
                       !path_is_among_facets(state, path);
  const bool soft = arrived && (flags & kGathersPhotons) != 0;
  if (soft || (arrived && (flags & kGathersTails) != 0)) {
    // Along the ray, as gather_photons: on a triangle that is large against the caustic, at.hit is less exact.
    const Vec3f P = path_origin(state, path) - wo * state.hit_t[path];
    photons.photons[photons.size++] = {
        P,
        {throughput, octahedral_encode(wo), octahedral_encode(path_level_normal(state, path, at.side.Ng)),
         state.bounces[path] - 1u}};
  }
  if (!caster && !soft) return;
  const bool goes_on =
      has_mixture<kFeatures>(at)
          ? shade_photon_scatter(g, state, path, at, wo, throughput,
                                 mixture_of(lobes, at.side.frame, at.side.Ng, 1.0f / at.params.alpha), soft)
          : shade_photon_scatter(
                g, state, path, at, wo, throughput,
                surface_closure_make<kFeatureAll>(at.params, *g.bsdf_tables, to_local(at.side.frame, wo)), soft);
  if (goes_on) queue_push(next, path);
}

}  // namespace relief
