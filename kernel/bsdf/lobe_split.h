// A surface's lobes in two: the sharp ones, which focus light into caustics, and the soft ones, on which caustics are
// seen. f = f_sharp + f_soft exactly, so that a path counts either for the photon pass or for the path tracer.
#pragma once

#include "kernel/bsdf/layered.h"

namespace relief {

/// Which of a surface's microfacet lobes are sharp. Diffuse reflection, sheen and what microfacets scatter more than once
/// never are.
struct SharpLobes {
  bool base = false;  ///< reflection, glass and thin wall: all of the same roughness
  bool coat = false;
};

/// @param caster     what focuses light by its material or by request does so with all its microfacet lobes: whatever
///                   textures say of their roughness, since photons and camera paths may read other levels of them
/// @param roughness  perceptual; lobes of other surfaces are sharp up to here
RELIEF_KERNEL SharpLobes sharp_lobes(const SurfaceParams& p, bool caster, float roughness)
{
  return {caster || p.roughness <= roughness, caster || p.clearcoat_roughness <= roughness};
}

/// The closure without its soft lobes. What is left is evaluated and sampled as if it were all; probabilities sum to one
/// where there is anything.
RELIEF_KERNEL SurfaceClosure closure_sharp(SurfaceClosure c, SharpLobes sharp)
{
  LobeProbabilities& p = c.probability;
  p.diffuse = p.multiple = p.thin_multiple = p.sheen = 0.0f;
  if (!sharp.base) p.specular = p.thin = p.glass = 0.0f;
  if (!sharp.coat) p.coat = 0.0f;
  const float sum = (p.specular + p.thin) + (p.glass + p.coat);
  const float scale = sum > 0.0f ? 1.0f / sum : 0.0f;
  p.specular *= scale;
  p.thin *= scale;
  p.glass *= scale;
  p.coat *= scale;
  return c;
}

/// The closure without its sharp lobes, to be evaluated: its pdf means nothing.
RELIEF_KERNEL SurfaceClosure closure_soft(SurfaceClosure c, SharpLobes sharp)
{
  LobeProbabilities& p = c.probability;
  if (sharp.base) p.specular = p.thin = p.glass = 0.0f;
  if (sharp.coat) p.coat = 0.0f;
  return c;
}

RELIEF_KERNEL bool closure_has_sharp(const SurfaceClosure& c, SharpLobes sharp)
{
  const LobeProbabilities& p = c.probability;
  return (sharp.base && (p.specular > 0.0f || p.thin > 0.0f || p.glass > 0.0f)) || (sharp.coat && p.coat > 0.0f);
}

RELIEF_KERNEL bool closure_has_soft(const SurfaceClosure& c, SharpLobes sharp)
{
  const LobeProbabilities& p = c.probability;
  return p.diffuse > 0.0f || p.multiple > 0.0f || p.thin_multiple > 0.0f || p.sheen > 0.0f ||
         (!sharp.base && (p.specular > 0.0f || p.thin > 0.0f || p.glass > 0.0f)) || (!sharp.coat && p.coat > 0.0f);
}

/// Decides whether a sampled event counts as sharp or soft, and weighs it by that part of f alone. Where both have a
/// share, one is chosen by it: a path is either the photon pass's or the path tracer's.
/// @param bsdf  sampled from the closure
/// @param u     [0, 1): chooses
/// @return whether it is sharp
template <unsigned kFeatures, TransportMode kMode = TransportMode::kRadiance>
RELIEF_KERNEL bool closure_split(const SurfaceClosure& closure,
                                 const BsdfTables& tables,
                                 SharpLobes sharp,
                                 float u,
                                 BsdfSample& bsdf)
{
  if ((bsdf.lobe & kLobeDelta) != 0 || !closure_has_soft(closure, sharp)) return true;
  if (!closure_has_sharp(closure, sharp)) return false;
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

}  // namespace relief
