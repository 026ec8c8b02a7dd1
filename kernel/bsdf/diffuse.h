// Lambert's lobe, and the two lobes shaped like it: what a rough interface lets through to a diffuse base, and what
// leaves a rough interface after several bounces. All are sampled by the cosine.
#pragma once

#include "kernel/sample/warp.h"

namespace relief {

/// f of a lobe that hides behind factors of both directions: color · a(wo) a(wi) / (π · mean of a).
///
/// With a = 1 it is Lambert's. With a = 1 − E, E the directional albedo of what lies on top, it is reciprocal and the
/// sum of both albedos is 1 for white: what is not reflected is scattered, exactly.
/// @param a_o, a_i  [0, 1]
/// @param a_mean    mean of a over the cosine-weighted hemisphere, > 0
/// @source          Kelemen and Szirmay-Kalos 2001 (diffuse base), Kulla and Conty 2017 (microfacets)
RELIEF_KERNEL Vec3f diffuse_coupled_eval(Vec3f color, float a_o, float a_i, float a_mean)
{
  return color * (kInvPi * a_o * a_i / a_mean);
}

RELIEF_KERNEL Vec3f diffuse_eval(Vec3f color) { return color * kInvPi; }
RELIEF_KERNEL Vec3f diffuse_sample(Vec2f u) { return warp_cosine_hemisphere(u); }
/// @return solid angle
RELIEF_KERNEL float diffuse_pdf(Vec3f wi) { return warp_cosine_hemisphere_pdf(wi.z); }

}  // namespace relief
