// Lambert's lobe, and the two lobes shaped like it: what a rough interface lets through to a diffuse base, and what
// leaves a rough interface after several bounces. All are sampled by the cosine.
#pragma once

#include "kernel/bsdf/base_interface.h"
#include "kernel/bsdf/lobe.h"

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

/// The diffuse base, under an interface or not.
struct DiffuseLobe : Lobe {
  static constexpr unsigned kFeatures = 0;
  static constexpr LobeSides kSides = LobeSides::kReflect;
  static constexpr LobeSharpness kSharpness = LobeSharpness::kNever;
  static constexpr bool kIsLayer = false;
  Vec3f f{};  ///< over what the interface lets through towards wi
};

template <TransportMode kMode>
RELIEF_KERNEL BsdfEval lobe_eval(const DiffuseLobe& lobe, const BaseInterface& base, const BsdfTables& tables, Vec3f wi)
{
  float transmits = 1.0f;
  if (base.under_F90 > 0.0f) {
    transmits = 1.0f - ggx_albedo_with(base.under_F0, base.under_F90, ggx_albedo(tables, base.ggx, wi.z));
  }
  return {lobe.f * transmits, diffuse_pdf(wi)};
}

template <TransportMode kMode>
RELIEF_KERNEL LobeSample lobe_sample(const DiffuseLobe&, const BaseInterface&, const BsdfTables&, float, Vec2f u)
{
  return lobe_sample_diffuse(diffuse_sample(u), false);
}

}  // namespace relief
