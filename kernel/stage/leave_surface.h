// Stage: a path has walked below a surface (enter_surface.h) and leaves it. What it leaves by is diffuse.
#pragma once

#include "kernel/stage/surface_continue.h"
#include "kernel/stage/surface_light.h"
#include "kernel/stage/surface_photons.h"

namespace relief {

/// Mean normal of the lobes by which paths would enter, as far as they weigh: what is bumped there is bumped for those that leave.
RELIEF_KERNEL Vec3f subsurface_normal(const MixtureLobes& lobes, Vec3f otherwise)
{
  Vec3f sum;
  for (int i = 0; i < lobes.size; ++i) {
    const MixtureLobe& lobe = lobes.lobes[i];
    if (lobe.kind == MixtureLobeKind::kSubsurface) sum += mean_component(lobe.weight) * lobe.frame.n;
  }
  return is_zero(sum) ? otherwise : normalize(sum);
}

/// Lights and scatters one path that has got out.
/// Next: intersect closest (pushed on `next`), or the path ends. At most one ray is added to `shadow`.
/// @param at     where, located
/// @param graph  see surface_interaction_resolve
template <unsigned kFeatures>
[[gnu::flatten]] RELIEF_KERNEL void leave_surface(const KernelGlobals& g,
                                                  PathState& state,
                                                  std::uint32_t path,
                                                  SurfaceInteraction& at,
                                                  const GraphHit* graph,
                                                  QueueView& next,
                                                  ShadowQueue& shadow)
{
  const Vec3f wo = -path_direction(state, path);
  const ScatterSamples u = scatter_samples(state.pixel_hash[path], state.sample_index[path], path_surface(state, path));
  MixtureLobes lobes;
  surface_interaction_resolve<kFeatures>(g, state, path, wo, at, lobes, graph);
  surface_interaction_frame<kFeatures>(g, state, path, wo, at);
  const Vec3f N = subsurface_normal(lobes, at.side.Ns);
  at.params = {};
  at.transmits = false;

  const SubsurfaceState& below = state.subsurface.entries[path];
  lobes.size = 0;
  MixtureBuild build{wo, at.side.Ng, at.side.Ns, at.side.front, g.bsdf_tables, &lobes};
  build.maths = below.maths;
  MixtureLobe* const lobe = mixture_add(build, {1, 1, 1}, frame_from_normal(N), true);
  if (lobe == nullptr) return;
  if (below.surface.leaves_by_fresnel) {
    lobe->kind = MixtureLobeKind::kPrincipledDiffuse;
    lobe->shape.principled_diffuse.part = PrincipledDiffusePart::kLeaving;
  }
  const Mixture closure = mixture_of(lobes, at.side.frame, at.side.Ng);
  const LightReceiver receiver{at.side.Ns};
  const ScatterEvent<Mixture> event{at, closure, path_throughput(state, path), receiver, at.cone};
  if (g.has_lights) {
    const LightsChoice chosen = lights_choose(g.lights, at.hit.P, receiver, u.light);
    if (chosen.probability > 0.0f) shade_surface_light<kFeatures>(g, state, path, event, chosen, shadow);
  }
  if constexpr ((kFeatures & kFeatureCaustics) != 0) {
    shade_surface_photons<kFeatures>(g, state, path, event, to_local(at.side.frame, wo));
  }
  const BsdfSample bsdf = closure_sample<kFeatures>(closure, *g.bsdf_tables, u.branch, u.bsdf);
  shade_surface_continue<kFeatures>(g, state, path, event, bsdf, 1.0f, u, next);
}

}  // namespace relief
