// Surfaces that scatter by a plain Principled closure and nothing else, eight at a time: from the lobes of
// principled3_lanes.h to light that comes from lamps, sampled directions, and what comes from there. All that mixture.h does with such a
// hit's list of lobes, in columns, by the same operations: figures are the same but for rounding.
//
// Stages ask as they do of any other closure, of a Principled3Lane, once the columns are known.
#pragma once

#include "kernel/bsdf/principled3_lanes.h"
#include "kernel/math/lanes_functions.h"

namespace relief {

/// What eight such hits are asked, and what they answer: columns, in the order in which they become known.
struct alignas(32) Principled3Hits {
  Principled3Columns lobes;
  alignas(32) std::int32_t has_diffuse[8], has_reflection[8];  ///< −1: there is such a lobe
  std::int32_t is_delta[8];                                    ///< −1: the reflection is
  float p_diffuse[8], p_reflection[8];                         ///< as MixtureLobe::probability; 0 of what is not there
  float Ng[3][8];                                              ///< world, on wo's side
  float side[9][8];                                            ///< frame of the surface, in which wi is
  float to_lamp[3][8];                                         ///< unit, world
  float lamp_diffuse[3][8], lamp_reflection[3][8], lamp_pdf[8];  ///< f of either lobe, and density of both
  float u[2][8];
  float wi[3][8], f[3][8], pdf[8], width[8];  ///< as of BsdfSample; width is its roughness
  std::int32_t bits[8];                       ///< likewise, `lobe`
};

/// One of the eight.
struct Principled3Lane {
  Principled3Hits* hits;
  int lane;
  float gain = 1;                 ///< see Mixture
  bool is_diffuse_alone = false;  ///< the reflection is left out
};

/// Completes hits whose closures are resolved.
/// @param side  the surfaces' frames
/// @param blur  least width α of microfacets; 0: none. As lobe_blur
[[gnu::noinline]] RELIEF_KERNEL void principled3_hits_make(const MixtureBuildLanes& b,
                                                           const Frame8& side,
                                                           F8 blur,
                                                           Principled3Hits& h)
{
  Principled3Columns& c = h.lobes;
  store8(h.Ng, b.Ng);
  store8(h.side, side);
  const F8 none = splat8(0.0f), weight = load8(c.specular_weight);
  const auto weighs = [](F8 w) { return (w > kLeastClosureWeight) & (w < kInfinity); };
  const I8 is_there = weighs(weight) & (load8(c.wo[2]) > kMinCosine);
  const Vec3x8 diffuse = load8(c.diffuse);
  const F8 p_diffuse = (diffuse.x + diffuse.y + diffuse.z) * (1.0f / 3.0f);
  const I8 has_diffuse = is_there & weighs(p_diffuse);
  const I8 has_reflection = is_there & (load8(c.strength) > kLeastClosureWeight);
  store8(h.has_diffuse, has_diffuse);
  store8(h.has_reflection, has_reflection);
  store8(h.p_diffuse, has_diffuse ? p_diffuse : none);
  store8(h.p_reflection, has_reflection ? weight * load8(c.seen) : none);
  const F8 roughness = load8(c.roughness);
  store8(h.is_delta, (roughness * roughness < kDeltaAlpha) & (blur < kDeltaAlpha));
  store8(c.roughness, max(roughness, sqrt(blur)));
  store8(c.alpha[0], max(load8(c.alpha[0]), blur));
  store8(c.alpha[1], max(load8(c.alpha[1]), blur));
}

/// f of either lobe, and the density of both.
struct Principled3Eval {
  Vec3x8 diffuse, reflection;
  F8 pdf;
};

/// As bump_shadowing of directions above the bent normal.
RELIEF_KERNEL F8 bump_shadowing(const Vec3x8& N, const Vec3x8& wi)
{
  const F8 g = dot(N, wi) / (wi.z * N.z);
  return g >= 1.0f ? splat8(1.0f) : g > 0.0f ? g + g * g * (1.0f - g) : splat8(0.0f);
}

RELIEF_KERNEL F8 schlick_weight(F8 cos_theta)
{
  const F8 x = clamp(1.0f - cos_theta, 0.0f, 1.0f);
  return x * x * (x * x) * x;
}

/// As principled_diffuse_eval.
RELIEF_KERNEL F8 principled_diffuse_eval(F8 roughness, const Vec3x8& wo, const Vec3x8& wi)
{
  const F8 F_o = schlick_weight(wo.z), F_i = schlick_weight(wi.z);
  const F8 retro = roughness * (1.0f + dot(wo, wi));
  const F8 lambert = (1.0f - 0.5f * F_o) * (1.0f - 0.5f * F_i);
  const F8 back = retro * (F_o + F_i + F_o * F_i * (retro - 1.0f));
  return kInvPi * (lambert + back);
}

/// As ggx_anisotropic_eval with separable masking.
RELIEF_KERNEL F8 ggx_anisotropic_eval(F8 alpha_x, F8 alpha_y, const Vec3x8& wo, const Vec3x8& wi, F8& pdf)
{
  const Vec3x8 h = wo + wi;
  const F8 hx = h.x / alpha_x, hy = h.y / alpha_y;
  const F8 ratio = dot(h, h) / (hx * hx + hy * hy + h.z * h.z);
  const F8 D = kInvPi / (alpha_x * alpha_y) * (ratio * ratio);
  const auto stretched = [&](const Vec3x8& w) {
    const F8 x = alpha_x * w.x, y = alpha_y * w.y;
    return sqrt(w.z * w.z + x * x + y * y);
  };
  const F8 seen = wo.z + stretched(wo);
  pdf = 0.5f * D / seen;
  return D / (seen * (abs(wi.z) + stretched(wi)));
}

/// As mixture_eval, of the maths of 3.4.
/// @param wi       unit, world
/// @param is_own   lanes in which wi was sampled from the reflection
[[gnu::noinline]] RELIEF_KERNEL Principled3Eval principled3_eval(const Principled3Hits& h, const Vec3x8& wi, I8 is_own)
{
  const Principled3Columns& c = h.lobes;
  const Frame8 frame = load_frame8(c.frame);
  const Vec3x8 wo = load8(c.wo), wi_lobe = to_local(frame, wi);
  const F8 none = splat8(0.0f), cos_i = abs(wi_lobe.z), cos_surface = abs(dot(wi, load8(h.side + 6)));
  const I8 is_above = wi_lobe.z >= 0.0f;
  const I8 is_seen = (cos_surface > kMinCosine) & (cos_i > kMinCosine);

  const I8 shines_diffuse = is_seen & is_above & load8(h.has_diffuse);
  F8 f_diffuse = principled_diffuse_eval(load8(c.given_roughness), wo, wi_lobe) * cos_i;
  const I8 is_bent = shines_diffuse & ~(load8(c.cos_bend) > kUnbentLobe);
  if (mask_of(is_bent) != 0) {
    f_diffuse = is_bent ? f_diffuse * bump_shadowing(load8(c.surface_N), wi_lobe) : f_diffuse;
  }

  const I8 shines_reflection =
      is_seen & (is_above | is_own) & (wo.z + wi_lobe.z > 0.0f) & load8(h.has_reflection) & ~load8(h.is_delta);
  F8 pdf_reflection;
  const F8 f_reflection =
      ggx_anisotropic_eval(load8(c.alpha[0]), load8(c.alpha[1]), wo, wi_lobe, pdf_reflection) * cos_i;
  const F8 w = fresnel_dielectric_weight(min(splat8(1.0f), 0.5f * length(wo + wi_lobe)), load8(c.eta));
  const Vec3x8 F0 = load8(c.F0);
  const auto reflectance = [&](F8 at_normal) { return at_normal * (1.0f - w) + w; };

  // Directions below the true surface are the diffuse lobe's to be asked for, not to be found.
  const I8 finds_diffuse = shines_diffuse & (dot(wi, load8(h.Ng)) >= 0.0f);
  const F8 p_diffuse = load8(h.p_diffuse), p_reflection = load8(h.p_reflection), sum = p_diffuse + p_reflection;
  const F8 pdf = (finds_diffuse ? p_diffuse * (wi_lobe.z * kInvPi) : none) +
                 (shines_reflection ? p_reflection * pdf_reflection : none);
  const F8 by_diffuse = shines_diffuse ? f_diffuse / cos_surface : none;
  const F8 by_reflection = shines_reflection ? load8(c.specular_weight) * f_reflection / cos_surface : none;
  return {load8(c.diffuse) * by_diffuse,
          Vec3x8{reflectance(F0.x), reflectance(F0.y), reflectance(F0.z)} * by_reflection,
          sum > 0.0f ? pdf / sum : none};
}

/// Evaluates all hits towards their lamps.
RELIEF_KERNEL void principled3_hits_light(Principled3Hits& h)
{
  const Principled3Eval e = principled3_eval(h, load8(h.to_lamp), I8{});
  store8(h.lamp_diffuse, e.diffuse);
  store8(h.lamp_reflection, e.reflection);
  store8(h.lamp_pdf, e.pdf);
}

/// As warp_cosine_hemisphere.
RELIEF_KERNEL Vec3x8 warp_cosine_hemisphere(F8 u_x, F8 u_y)
{
  const F8 x = 2.0f * u_x - 1.0f, y = 2.0f * u_y - 1.0f;
  const I8 is_x = abs(x) > abs(y);
  const F8 radius = is_x ? x : y, other = is_x ? y : x;
  const F8 turn = radius == 0.0f ? radius : 0.25f * kPi * (other / radius);
  const SinCos8 phi = sin_cos_octant(turn, splat8(0.0f));
  const F8 along = radius * phi.cos, across = radius * phi.sin;
  const F8 dx = is_x ? along : across, dy = is_x ? across : along;
  return {dx, dy, safe_sqrt(1.0f - (dx * dx + dy * dy))};
}

/// As ggx_anisotropic_sample.
RELIEF_KERNEL Vec3x8 ggx_anisotropic_sample(F8 alpha_x, F8 alpha_y, const Vec3x8& wo, F8 u_x, F8 u_y)
{
  const Vec3x8 wo_std = normalize(Vec3x8{wo.x * alpha_x, wo.y * alpha_y, wo.z});
  const F8 z = 1.0f - u_y * (1.0f + wo_std.z);
  const F8 r = safe_sqrt((1.0f - z) * (1.0f + z));
  const SinCos8 phi = sin_cos_turn(u_x);
  const Vec3x8 m = Vec3x8{r * phi.cos, r * phi.sin, z} + wo_std;
  const Vec3x8 wm = normalize(Vec3x8{m.x * alpha_x, m.y * alpha_y, max(m.z, splat8(0.0f))});
  return 2.0f * dot(wo, wm) * wm - wo;
}

/// Samples all hits by their u, as closure_sample of a Mixture, and evaluates them in the directions found.
[[gnu::noinline]] RELIEF_KERNEL void principled3_hits_sample(Principled3Hits& h)
{
  const Principled3Columns& c = h.lobes;
  const F8 none = splat8(0.0f), one = splat8(1.0f);
  const F8 sum = load8(h.p_diffuse) + load8(h.p_reflection);
  const F8 p_diffuse = load8(h.p_diffuse) / sum, p_reflection = load8(h.p_reflection) / sum;
  const F8 u_x = load8(h.u[0]), u_y = load8(h.u[1]);
  const I8 is_diffuse = (p_diffuse > 0.0f) & ((u_x < p_diffuse) | ~(p_reflection > 0.0f));
  const I8 is_mirror = ~is_diffuse & load8(h.is_delta);
  // Rounding may leave a little over behind the last lobe.
  const F8 within = min(is_diffuse ? u_x / p_diffuse : (u_x - p_diffuse) / p_reflection, splat8(1.0f - kUnitRoundoff));
  const F8 u = within > 0.0f ? within : none;

  const Frame8 frame = load_frame8(c.frame), side = load_frame8(h.side);
  const Vec3x8 wo = load8(c.wo);
  const F8 roughness = load8(c.roughness);
  const Vec3x8 reflected = select(is_mirror, Vec3x8{-wo.x, -wo.y, wo.z},
                                  ggx_anisotropic_sample(load8(c.alpha[0]), load8(c.alpha[1]), wo, u, u_y));
  const Vec3x8 wi = from_local(frame, select(is_diffuse, warp_cosine_hemisphere(u, u_y), reflected));
  const Vec3x8 wi_surface = to_local(side, wi);
  const F8 cos_surface = abs(wi_surface.z);
  const I8 is_found = (sum > 0.0f) & (dot(wi, load8(h.Ng)) >= 0.0f) & (cos_surface > kMinCosine);
  store8(h.wi, wi_surface);
  store8(h.width, is_diffuse ? one : is_mirror ? none : roughness * roughness);
  const auto bits = [](std::uint32_t b) { return I8{} + static_cast<std::int32_t>(kLobeReflect | b); };
  store8(h.bits, is_diffuse ? bits(kLobeDiffuse) : is_mirror ? bits(kLobeDelta) : bits(kLobeGlossy));

  const Principled3Eval e = principled3_eval(h, wi, ~is_diffuse);
  Vec3x8 f = e.diffuse + e.reflection;
  F8 pdf = e.pdf;
  if (mask_of(is_mirror) != 0) {
    const F8 w = fresnel_dielectric_weight(wo.z, load8(c.eta));
    const Vec3x8 F = load8(c.F0) * (1.0f - w) + Vec3x8{w, w, w};
    f = select(is_mirror, F * (load8(c.specular_weight) / cos_surface), f);
    pdf = is_mirror ? p_reflection : pdf;
  }
  store8(h.f, f);
  store8(h.pdf, is_found ? pdf : none);
}

RELIEF_KERNEL Principled3Lane closure_diffuse(Principled3Lane one)
{
  one.is_diffuse_alone = true;
  return one;
}

/// As closure_eval of a Mixture towards the hit's lamp, which has been evaluated.
template <unsigned kFeatures>
RELIEF_KERNEL BsdfEval closure_eval(const Principled3Lane& one, const BsdfTables&, Vec3f)
{
  const Principled3Hits& h = *one.hits;
  const Vec3f diffuse = load_lane(h.lamp_diffuse, one.lane);
  if (one.is_diffuse_alone) return {diffuse, 0.0f};
  return {diffuse + load_lane(h.lamp_reflection, one.lane), h.lamp_pdf[one.lane]};
}

/// As closure_sample of a Mixture by the hit's u, which has been sampled.
RELIEF_KERNEL BsdfSample closure_sample(const Principled3Lane& one)
{
  const Principled3Hits& h = *one.hits;
  const int k = one.lane;
  BsdfSample s;
  s.wi = load_lane(h.wi, k);
  s.f = load_lane(h.f, k) * one.gain;
  s.pdf = h.pdf[k];
  s.roughness = h.width[k];
  s.lobe = static_cast<std::uint32_t>(h.bits[k]);
  return s;
}

}  // namespace relief
