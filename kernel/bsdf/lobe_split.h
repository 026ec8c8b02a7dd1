// A surface's lobes in two: the sharp ones, which focus light into caustics, and the soft ones, on which caustics are
// seen. f = f_sharp + f_soft exactly, so that a path counts either for the photon pass or for the path tracer.
#pragma once

#include "kernel/bsdf/layered.h"
#include "kernel/film/film_layout.h"

namespace relief {

/// Which of a surface's microfacet lobes are sharp. Diffuse reflection, sheen and what microfacets scatter more than once
/// never are.
struct SharpLobes {
  bool base = false;  ///< reflection, glass and thin wall: all of the same roughness
  bool coat = false;
  float most_roughness = -1;  ///< of mixtures, whose lobes have a roughness each
};

/// All that can be.
inline constexpr SharpLobes kAllSharp{true, true, kInfinity};

/// @param caster     what focuses light by its material or by request does so with all its microfacet lobes: whatever
///                   textures say of their roughness, since photons and camera paths may read other levels of them
/// @param roughness  perceptual; lobes of other surfaces are sharp up to here
RELIEF_KERNEL SharpLobes sharp_lobes(const SurfaceParams& p, bool caster, float roughness)
{
  return {caster || p.roughness <= roughness, caster || p.clearcoat_roughness <= roughness,
          caster ? kInfinity : roughness};
}

template <typename L>
RELIEF_KERNEL bool lobe_is_sharp(SharpLobes sharp)
{
  if constexpr (L::kSharpness == LobeSharpness::kBase) return sharp.base;
  if constexpr (L::kSharpness == LobeSharpness::kCoat) return sharp.coat;
  return false;
}

/// The closure without its soft lobes, or without its sharp ones.
template <bool kSharp>
RELIEF_KERNEL SurfaceClosure closure_without(SurfaceClosure c, SharpLobes sharp)
{
  lobes_visit<kFeatureAll>(c.lobes, [sharp]<typename L>(L& lobe) {
    if (lobe_is_sharp<L>(sharp) == kSharp) lobe.probability = 0.0f;
  });
  return c;
}

/// The closure without its soft lobes. What is left is evaluated and sampled as if it were all; probabilities sum to one
/// where there is anything.
RELIEF_KERNEL SurfaceClosure closure_sharp(const SurfaceClosure& c, SharpLobes sharp)
{
  SurfaceClosure without = closure_without<false>(c, sharp);
  lobes_normalize<kFeatureAll>(without.lobes);
  return without;
}

/// The closure without its sharp lobes, to be evaluated: its pdf means nothing.
RELIEF_KERNEL SurfaceClosure closure_soft(const SurfaceClosure& c, SharpLobes sharp)
{
  return closure_without<true>(c, sharp);
}

/// The closure's diffuse lobes alone, to be evaluated: its pdf means nothing.
RELIEF_KERNEL SurfaceClosure closure_diffuse(const SurfaceClosure& c) { return closure_soft(c, kAllSharp); }

/// Of these what layers of light call diffuse, to be evaluated. What facets scatter more than once is part of their lobe.
RELIEF_KERNEL SurfaceClosure closure_matte(const SurfaceClosure& c)
{
  SurfaceClosure matte = closure_diffuse(c);
  static_cast<MultipleLobe&>(matte.lobes).probability = 0.0f;
  static_cast<ThinMultipleLobe&>(matte.lobes).probability = 0.0f;
  return matte;
}

/// What layers of light call an event that is not diffuse.
RELIEF_KERNEL EventKind closure_other_event(const SurfaceClosure&, bool transmitted)
{
  return transmitted ? EventKind::kTransmission : EventKind::kGlossy;
}

/// Whether a closure has lobes that are sharp, or that are soft.
template <bool kSharp>
RELIEF_KERNEL bool closure_has(const SurfaceClosure& c, SharpLobes sharp)
{
  return lobes_visit_until<kFeatureAll>(c.lobes, [sharp]<typename L>(const L& lobe) {
    return lobe_is_sharp<L>(sharp) == kSharp && lobe.probability > 0.0f;
  });
}

/// What closure_split does where both have a share.
template <unsigned kFeatures, TransportMode kMode, typename Closure>
[[gnu::noinline]] RELIEF_KERNEL bool
closure_split_both(const Closure& closure, const BsdfTables& tables, SharpLobes sharp, float u, BsdfSample& bsdf)
{
  const Vec3f f_sharp = closure_eval<kFeatures, kMode>(closure_sharp(closure, sharp), tables, bsdf.wi).f;
  const Vec3f f_soft = max(bsdf.f - f_sharp, Vec3f{});
  const float of_sharp = max_component(f_sharp), of_both = of_sharp + max_component(f_soft);
  // A black tint leaves nothing of either (test MaterialCorners.GlassThatPassesNoLightIsFinite).
  if (!(of_both > 0.0f)) {
    bsdf.f = {};
    return false;
  }
  const float probability = of_sharp / of_both;
  const bool is_sharp = u < probability;
  bsdf.f = is_sharp ? f_sharp / probability : f_soft / (1.0f - probability);
  return is_sharp;
}

/// Decides whether a sampled event counts as sharp or soft, and weighs it by that part of f alone. Where both have a
/// share, one is chosen by it: a path is either the photon pass's or the path tracer's.
/// @param bsdf  sampled from the closure
/// @param u     [0, 1): chooses
/// @return whether it is sharp
template <unsigned kFeatures, TransportMode kMode = TransportMode::kRadiance, typename Closure>
RELIEF_KERNEL bool closure_split(const Closure& closure,
                                 const BsdfTables& tables,
                                 SharpLobes sharp,
                                 float u,
                                 BsdfSample& bsdf)
{
  if ((bsdf.lobe & kLobeDelta) != 0 || !closure_has<false>(closure, sharp)) return true;
  if (!closure_has<true>(closure, sharp)) return false;
  return closure_split_both<kFeatures, kMode>(closure, tables, sharp, u, bsdf);
}

}  // namespace relief
