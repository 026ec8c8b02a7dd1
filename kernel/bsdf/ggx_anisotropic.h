// GGX with two roughnesses, along x and y of the lobe's frame, as Cycles' versions have it. Fresnel is the caller's.
//
// Heitz 2014, "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs" [H]; Dupuy and Benyoub 2023,
// "Sampling Visible GGX Normals with Spherical Caps" [DB].
#pragma once

#include "kernel/bsdf/ggx.h"
#include "kernel/bsdf/mixture_traits.h"

namespace relief {

/// How masking of both directions is combined.
enum class SmithMasking : std::uint8_t {
  kSeparable,   ///< G1(wo) G1(wi): Cycles up to 3.6
  kCorrelated,  ///< by height: Cycles from 4.0 on, and relief's own lobes
};

/// Roughnesses along x and y.
struct AnisotropicAlpha {
  float x = 1, y = 1;
};

/// The smaller one counts as at least this, so that a lobe that is sharp one way only stays finite.
RELIEF_KERNEL AnisotropicAlpha anisotropic_alpha_clamp(float x, float y)
{
  return {clamp(x, kDeltaAlpha, 1.0f), clamp(y, kDeltaAlpha, 1.0f)};
}

/// Both at least so wide.
RELIEF_KERNEL AnisotropicAlpha anisotropic_alpha_widened(AnisotropicAlpha alpha, float least)
{
  return {max(alpha.x, least), max(alpha.y, least)};
}

/// Of the Glossy and Metallic nodes.
/// @param anisotropy  (−1, 1), positive: sharper along the tangent
RELIEF_KERNEL AnisotropicAlpha anisotropic_alpha_of_glossy(float roughness, float anisotropy)
{
  const float alpha = sqr(roughness);
  const float a = clamp(anisotropy, -0.99f, 0.99f);
  return a < 0.0f ? anisotropic_alpha_clamp(alpha / (1.0f + a), alpha * (1.0f + a))
                  : anisotropic_alpha_clamp(alpha * (1.0f - a), alpha / (1.0f - a));
}

/// Of the Principled node: wider along the tangent.
/// @param anisotropic  [0, 1]; as it is given up to 3.6: negative is wider across the tangent
RELIEF_KERNEL AnisotropicAlpha anisotropic_alpha_of_principled(float roughness, float anisotropic)
{
  const float alpha = sqr(roughness);
  const float aspect = safe_sqrt(1.0f - 0.9f * anisotropic);
  return anisotropic_alpha_clamp(alpha / aspect, alpha * aspect);
}

/// Cosine between either direction and the microfacet that reflects one into the other.
RELIEF_KERNEL float half_angle_cosine(Vec3f wo, Vec3f wi) { return min(1.0f, 0.5f * length(wo + wi)); }

struct GgxAnisotropic {
  static constexpr MixtureTraits kTraits = kReflectingMicrofacets;
  AnisotropicAlpha alpha;
  SmithMasking masking = SmithMasking::kSeparable;
};

/// Density of microfacet normals per unit of projected area. @param h  any length, h.z > 0
RELIEF_KERNEL float ggx_anisotropic_D(AnisotropicAlpha a, Vec3f h)
{
  // [H] Eq. 86 times both squared lengths: no division by h.z.
  const float q = sqr(h.x / a.x) + sqr(h.y / a.y) + h.z * h.z;
  return kInvPi / (a.x * a.y) * sqr(length_squared(h) / q);
}

/// z times √(1 + alpha² tan²), finite at the horizon: Λ is (this / z − 1) / 2.
/// @source [H] Eq. 80
RELIEF_KERNEL float ggx_anisotropic_length(AnisotropicAlpha a, Vec3f w)
{
  return __builtin_sqrtf(w.z * w.z + sqr(a.x * w.x) + sqr(a.y * w.y));
}

/// f with reflectance 1.
/// @param wo, wi  unit; wo.z > 0. Below the horizon a sampled wi is masked as above it
/// @param pdf     solid angle of wi under ggx_anisotropic_sample
RELIEF_KERNEL float ggx_anisotropic_eval(const GgxAnisotropic& lobe, Vec3f wo, Vec3f wi, float* pdf)
{
  *pdf = 0.0f;
  if (!(wo.z + wi.z > 0.0f)) return 0.0f;
  const float cos_i = __builtin_fabsf(wi.z);
  const float D = ggx_anisotropic_D(lobe.alpha, wo + wi);
  const float o_length = ggx_anisotropic_length(lobe.alpha, wo);
  const float i_length = ggx_anisotropic_length(lobe.alpha, wi);
  *pdf = 0.5f * D / (wo.z + o_length);
  // Masking over the cosines, simplified as in ggx_reflection_eval.
  return lobe.masking == SmithMasking::kSeparable ? D / ((wo.z + o_length) * (cos_i + i_length))
                                                  : 0.5f * D / (wo.z * i_length + cos_i * o_length);
}

/// Normal of the distribution as seen from wo.
/// @return  unit, z >= 0
/// @source  [DB]
RELIEF_KERNEL Vec3f ggx_anisotropic_visible_normal(AnisotropicAlpha a, Vec3f wo, Vec2f u)
{
  const Vec3f wo_std = normalize({wo.x * a.x, wo.y * a.y, wo.z});
  const Vec3f wm_std = direction_from_z(1.0f - u.y * (1.0f + wo_std.z), u.x) + wo_std;
  return normalize({wm_std.x * a.x, wm_std.y * a.y, max(0.0f, wm_std.z)});
}

/// @return unit; z <= 0 is a ray lost among the microfacets
RELIEF_KERNEL Vec3f ggx_anisotropic_sample(const GgxAnisotropic& lobe, Vec3f wo, Vec2f u)
{
  const Vec3f wm = ggx_anisotropic_visible_normal(lobe.alpha, wo, u);
  return 2.0f * dot(wo, wm) * wm - wo;
}

template <TransportMode>
RELIEF_KERNEL BsdfEval lobe_eval(const GgxAnisotropic& lobe, const LobeHit& hit, const BsdfTables&, Vec3f wi, bool)
{
  BsdfEval e;
  e.f = splat3(ggx_anisotropic_eval(lobe, hit.wo, wi, &e.pdf));
  return e;
}

template <TransportMode>
RELIEF_KERNEL LobeSample lobe_sample(const GgxAnisotropic& lobe, const LobeHit& hit, float, Vec2f u)
{
  if (hit.is_delta) return lobe_sample_mirror(hit);
  return lobe_sample_glossy(ggx_anisotropic_sample(lobe, hit.wo, u), false, sqr(hit.roughness));
}

RELIEF_KERNEL bool lobe_widen(GgxAnisotropic& lobe, float, float blur)
{
  lobe.alpha = anisotropic_alpha_widened(lobe.alpha, blur);
  return true;
}

}  // namespace relief
