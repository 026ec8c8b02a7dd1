// Both ways that light can go on from glass, where sampling chooses one.
#pragma once

#include "kernel/bsdf/layered.h"
#include "kernel/math/rounding.h"

namespace relief {

/// What a microfacet of glass reflects and what it refracts.
struct GlassBranches {
  BsdfSample reflected, refracted;
  float reflectance = 1;  ///< of the microfacet: probability of the first where one is chosen; 1: there is no second
};

/// Samples a surface of nothing but glass, as closure_sample with the same numbers would, but for the choice between the
/// two: weighed by reflectance and what it leaves, both together have its expectation.
/// @param u  as closure_sample's
/// @return   reflectance 1 as well where microfacets scatter more than once
template <unsigned kFeatures>
RELIEF_KERNEL GlassBranches glass_branches_sample(const SurfaceClosure& c, const BsdfTables& tables, Vec2f u)
{
  GlassBranches branches;
  const GlassLobe& glass = c.lobes;
  const float eta = glass.eta;
  if (u.x < glass.lost || dielectric_is_matched(eta)) return branches;
  const Vec2f rest{choice_rest(u.x - glass.lost, 1.0f - glass.lost), u.y};
  const Vec3f wm = glass.delta ? Vec3f{0, 0, 1} : warp_ggx_visible_normal(c.base.wo, c.base.ggx.alpha, rest);
  const float cos_o = min(1.0f, dot(c.base.wo, wm));
  const float F = fresnel_dielectric(cos_o, refracted_cosine(cos_o, eta), eta);
  if (!(F < 1.0f)) return branches;
  constexpr float kLargestBelowOne = 1.0f - kUnitRoundoff;
  branches.reflectance = F;
  branches.reflected = closure_sample<kFeatures>(c, tables, 0.0f, u);
  branches.refracted = closure_sample<kFeatures>(c, tables, kLargestBelowOne, u);
  return branches;
}

}  // namespace relief
