// A rough or smooth interface between two dielectrics: reflection and refraction by the same GGX microfacets, with
// exact Fresnel, and what leaves after several bounces among them.
//
// Walter, Marschner, Li, Torrance 2007, "Microfacet Models for Refraction through Rough Surfaces" [W].
// Kulla and Conty 2017, "Revisiting Physically Based Shading at Imageworks" [KC].
//
// eta is index transmitted / index incident, seen from wo, which is always at z > 0: the caller mirrors. Refraction
// compresses solid angles. What stays constant along a ray is radiance over the square of the index, and that is what all
// paths carry, as in Cycles: what shines within glass is given so, and glass is white in an even glow from either side of
// it, closed or not. Photons, which bring flux, are scaled by 1/eta² for both to agree.
#pragma once

#include "kernel/bsdf/ggx.h"

namespace relief {

/// What a path carries: radiance over the square of the index, from lights to the camera (traced backwards), or what
/// photons bring.
enum class TransportMode { kRadiance, kImportance };

/// Indices closer than this to each other do not bend light, and the half vector of refraction has no digits left. Such
/// an interface is not there: everything passes straight through.
inline constexpr float kMatchedEta = 1e-3f;
RELIEF_KERNEL bool dielectric_is_matched(float eta) { return __builtin_fabsf(eta - 1.0f) < kMatchedEta; }

/// Factor on f of anything that crosses the interface.
template <TransportMode kMode>
RELIEF_KERNEL float transmission_scale(float eta)
{
  return kMode == TransportMode::kImportance ? 1.0f / (eta * eta) : 1.0f;
}

/// Refracted direction.
/// @param m      unit normal or microfacet with dot(wo, m) = cos_o > 0
/// @param cos_t  refracted_cosine(cos_o, eta), > 0
RELIEF_KERNEL Vec3f refract(Vec3f wo, Vec3f m, float cos_o, float cos_t, float eta)
{
  const float inv_eta = 1.0f / eta;
  return (cos_o * inv_eta - cos_t) * m - wo * inv_eta;
}

/// One scattering by the microfacets.
struct DielectricEval {
  float f = 0;    ///< multiply by transmission_scale where wi.z < 0
  float pdf = 0;  ///< solid angle of wi under dielectric_sample
};

/// @param wo     unit, z > 0
/// @param wi     unit, z != 0; the sign says which side
/// @param alpha  >= kDeltaAlpha
/// @param eta    not matched
/// @source       [W] Eq. 20 and 21, divided by eta² there; Fresnel chooses between the two when sampling
RELIEF_KERNEL DielectricEval dielectric_eval(Vec3f wo, Vec3f wi, float alpha, float eta)
{
  if (wi.z > 0.0f) {
    const GgxReflection r = ggx_reflection_eval(wo, wi, alpha);
    const float F = fresnel_dielectric(r.cos_d, refracted_cosine(r.cos_d, eta), eta);
    return {F * r.f, F * r.pdf};
  }
  // [W] Eq. 16; turned so that it is on the upper side whichever medium is denser.
  Vec3f h = wo + eta * wi;
  if (h.z < 0.0f) h = -h;
  const float inv_length = 1.0f / length(h);
  const float cos_o = dot(wo, h) * inv_length;
  const float cos_i = -dot(wi, h) * inv_length;
  // Microfacets seen from behind by either direction do not connect them.
  if (!(cos_o > 0.0f && cos_i > 0.0f)) return {};
  const float T = 1.0f - fresnel_dielectric(min(1.0f, cos_o), min(1.0f, cos_i), eta);
  const float D = ggx_D(h, alpha);
  const float o_z = wo.z, i_z = -wi.z;
  const float o_length = ggx_stretched_length(o_z, alpha);
  const float i_length = ggx_stretched_length(i_z, alpha);
  // dω_m / dω_i, [W] Eq. 17 with the half vector's own length in the denominator.
  const float jacobian = eta * eta * cos_i * sqr(inv_length);
  const float scaled = 2.0f * T * D * cos_o * jacobian;
  return {scaled / (o_z * i_length + i_z * o_length), scaled / (o_z + o_length)};
}

/// Direction and Fresnel choice of one scattering.
struct DielectricSample {
  Vec3f wi;
  bool transmitted = false;
};

/// @param u_branch  [0, 1): reflect or refract
/// @return          wi.z has the wrong sign where the microfacets lose the ray
RELIEF_KERNEL DielectricSample dielectric_sample(Vec3f wo, float alpha, float eta, float u_branch, Vec2f u)
{
  const Vec3f wm = warp_ggx_visible_normal(wo, alpha, u);
  const float cos_o = min(1.0f, dot(wo, wm));
  const float cos_t = refracted_cosine(cos_o, eta);
  if (u_branch < fresnel_dielectric(cos_o, cos_t, eta)) return {2.0f * cos_o * wm - wo, false};
  return {normalize(refract(wo, wm, cos_o, cos_t, eta)), true};
}

/// How light that was lost among the microfacets is shared out again [KC].
///
/// Both lobes are (1 − E(wo)) (1 − E(wi)) / (π M), M the mean of 1 − E on wi's side; `reflect` and 1 − `reflect` divide
/// the energy. Reciprocity fixes the ratio of what crosses one way to the other; of the shares that satisfy it we take
/// the smooth interface's mean transmittance, cut by min(1, M_far / M_near) on either side.
/// @param eta                index far / near
/// @param mean_near, mean_far  mean of 1 − E on wo's side and on the other, > 0
/// @return                   share that stays on wo's side, [0, 1]
RELIEF_KERNEL float dielectric_multiple_reflect_share(float eta, float mean_near, float mean_far)
{
  const float ior = max(eta, 1.0f / eta);
  const float T_thin = 1.0f - fresnel_dielectric_mean(ior);
  // From the dense side only 1/ior² of the directions escape.
  const float T = eta > 1.0f ? T_thin : T_thin * eta * eta;
  return 1.0f - T * min(1.0f, mean_far / mean_near);
}

}  // namespace relief
