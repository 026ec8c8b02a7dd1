// What a stage knows of a surface at which a path is scattered. What a path's lobes make of it is in files of their own:
// light that is asked for (surface_light.h), photons (surface_photons.h), the way on (surface_continue.h).
#pragma once

#include "kernel/bsdf/lobe_split.h"
#include "kernel/bsdf/mixture.h"
#include "kernel/photon/gather.h"
#include "kernel/stage/surface_interaction.h"

namespace relief {

/// A path at a surface whose closure is known.
template <typename SurfaceClosure>
struct ScatterEvent {
  using Closure = SurfaceClosure;
  const SurfaceInteraction& at;
  const Closure& closure;
  Vec3f throughput;               ///< up to the surface
  const LightReceiver& receiver;  ///< given to lights_choose
  RayCone cone;                   ///< at the surface
};

/// By what lights are chosen. Where light comes from both sides no normal counts, nor gloss.
/// @param lobes  of a material of closures; gloss of others does not count
template <typename Lobes>
RELIEF_KERNEL LightReceiver surface_receiver(const PathState& state, const SurfaceInteraction& at, const Lobes& lobes)
{
  if (at.transmits) return Vec3f{};
  return state.scatter_gloss != nullptr ? LightReceiver{at.side.Ns, lobes_gloss(lobes)} : LightReceiver{at.side.Ns};
}

/// The part of a surface's f that is diffuse.
/// @param wi  in the closure's frame
template <unsigned kFeatures, typename Closure>
[[gnu::noinline]] RELIEF_KERNEL Vec3f shade_surface_diffuse(const KernelGlobals& g, const Closure& closure, Vec3f wi)
{
  return closure_eval<kFeatures>(closure_diffuse(closure), *g.bsdf_tables, wi).f;
}

/// Whether a closure has parts to tell events apart by. Columns of eight hits have none: where layers ask for them, each hit is
/// shaded by itself.
template <typename Closure>
inline constexpr bool kTellsEvents = requires(const Closure& closure) { closure_matte(closure); };

/// Shares of f towards a direction by kinds of event, for the layers that tell light apart by them.
/// @param wi           in the closure's frame
/// @param f            of what counts: all, or the soft lobes
/// @param transmitted  wi goes through the surface
template <unsigned kFeatures, typename Closure>
[[gnu::noinline]] RELIEF_KERNEL EventShares
event_shares(const KernelGlobals& g, const Closure& closure, Vec3f wi, Vec3f f, bool transmitted)
{
  const Vec3f matte = closure_eval<kFeatures>(closure_matte(closure), *g.bsdf_tables, wi).f;
  const auto share = [](float part, float all) { return all > 0.0f ? clamp(part / all, 0.0f, 1.0f) : 0.0f; };
  EventShares shares{};
  Vec3f& diffuse = shares.of[static_cast<int>(EventKind::kDiffuse)];
  diffuse = {share(matte.x, f.x), share(matte.y, f.y), share(matte.z, f.z)};
  shares.of[static_cast<int>(closure_other_event(closure, transmitted))] = splat3(1.0f) - diffuse;
  return shares;
}

/// The same of an event that is not diffuse.
template <typename Closure>
RELIEF_KERNEL EventShares event_shares_sharp(const Closure& closure, bool transmitted)
{
  EventShares shares{};
  shares.of[static_cast<int>(closure_other_event(closure, transmitted))] = {1, 1, 1};
  return shares;
}

/// The part of a surface's f that is not sharp.
/// @param wi  in the closure's frame
template <unsigned kFeatures, typename Closure>
[[gnu::noinline]] RELIEF_KERNEL Vec3f
shade_surface_soft(const KernelGlobals& g, const Closure& closure, SharpLobes sharp, Vec3f wi)
{
  return closure_eval<kFeatures>(closure_soft(closure, sharp), *g.bsdf_tables, wi).f;
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

}  // namespace relief
