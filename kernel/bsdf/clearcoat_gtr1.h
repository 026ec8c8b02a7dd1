// Clearcoat of Blender's Principled shader up to 3.6: Disney's long-tailed GTR1 distribution, masked as if its roughness
// were 0.25.
//
// Burley 2012, "Physically Based Shading at Disney" [B].
#pragma once

#include "kernel/bsdf/ggx_anisotropic.h"
#include "kernel/bsdf/mixture_traits.h"

namespace relief {

/// Index of the clearcoat, whose reflectance seen from above is 0.04 (fresnel_interpolated).
inline constexpr float kGtr1Ior = 1.5f;
/// What Cycles multiplies the clearcoat's strength by.
inline constexpr float kGtr1Strength = 0.25f;
/// Up to this alpha Cycles mirrors. The default roughness of .03 is wider, and its long tail is most of what a lamp gives.
inline constexpr float kGtr1DeltaAlpha = 3.1622776e-4f;

struct ClearcoatGtr1 {
  static constexpr MixtureTraits kTraits{.is_diffuse = false, .has_fresnel = true, .fading = LobeFading::kNever};
  float alpha = 1e-3f;  ///< roughness², >= kGtr1DeltaAlpha; 1 and more is uniform
};

/// Density of microfacet normals per unit of projected area.
/// @param sine2  squared sine of the microfacet normal
/// @source       [B] Eq. 4 with gamma 1
RELIEF_KERNEL float gtr1_D(float alpha, float sine2)
{
  if (alpha >= 0.999f) return kInvPi;
  const float a2 = alpha * alpha;
  // 1 + (a² − 1) cos² by the sine, which keeps its digits at the peak.
  return (a2 - 1.0f) * kInvPi / (std::log(a2) * (a2 + (1.0f - a2) * sine2));
}

/// f with reflectance 1: times Fresnel, kGtr1Strength and the clearcoat's strength it is the lobe. The masking does not
/// belong to the distribution, so that the albedo before those factors reaches 3.2 at grazing angles.
///
/// As Cycles does, the lobe is sampled as if it were GGX of the same roughness, and weighed by the density that visible
/// normals of GTR1 would have. So it is not the same light that lamps give when they are sampled and when they are met: where
/// the lobe alone finds it (a world, other surfaces) it has GGX's shape, and between the two what multiple importance
/// sampling makes of both.
/// @param wo, wi  unit; wo.z > 0. Below the horizon a sampled wi is masked as above it
/// @param pdf     what counts as the density of wi
RELIEF_KERNEL float clearcoat_gtr1_eval(const ClearcoatGtr1& lobe, Vec3f wo, Vec3f wi, float* pdf)
{
  *pdf = 0.0f;
  const Vec3f h = wo + wi;
  if (!(h.z > 0.0f)) return 0.0f;
  const float D = gtr1_D(lobe.alpha, (h.x * h.x + h.y * h.y) / length_squared(h));
  constexpr float kMaskingAlpha = 0.25f;
  const float masked_o = wo.z + ggx_stretched_length(wo.z, kMaskingAlpha);
  *pdf = 0.5f * D / masked_o;
  return D / (masked_o * (__builtin_fabsf(wi.z) + ggx_stretched_length(wi.z, kMaskingAlpha)));
}

/// @return unit; zero vector or z <= 0 is lost
RELIEF_KERNEL Vec3f clearcoat_gtr1_sample(const ClearcoatGtr1& lobe, Vec3f wo, Vec2f u)
{
  const Vec3f h = warp_ggx_visible_normal(wo, lobe.alpha, u);
  const float cos_d = dot(wo, h);
  if (!(cos_d > 0.0f)) return {};
  return 2.0f * cos_d * h - wo;
}

template <TransportMode>
RELIEF_KERNEL BsdfEval lobe_eval(const ClearcoatGtr1& lobe, const LobeHit& hit, const BsdfTables&, Vec3f wi, bool)
{
  BsdfEval e;
  e.f = splat3(clearcoat_gtr1_eval(lobe, hit.wo, wi, &e.pdf));
  return e;
}

template <TransportMode>
RELIEF_KERNEL LobeSample lobe_sample(const ClearcoatGtr1& lobe, const LobeHit& hit, float, Vec2f u)
{
  if (hit.is_delta) return lobe_sample_mirror(hit);
  return lobe_sample_glossy(clearcoat_gtr1_sample(lobe, hit.wo, u), false, sqr(hit.roughness));
}

RELIEF_KERNEL bool lobe_widen(ClearcoatGtr1& lobe, float, float blur)
{
  lobe.alpha = max(lobe.alpha, blur);
  return true;
}

}  // namespace relief
