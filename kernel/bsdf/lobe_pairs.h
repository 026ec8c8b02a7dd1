// Surfaces that scatter by two lobes at most, one diffuse and one a reflection by GGX about the same normal, eight at a time: light that
// comes from lamps, sampled directions, and what comes from there. Most materials are no more. All that mixture.h does with such a
// hit's list of lobes, in columns, by the same operations: figures are the same but for rounding.
//
// Stages ask as they do of any other closure, of a LobePairLane, once the columns are known.
#pragma once

#include "kernel/bsdf/principled3_lanes.h"
#include "kernel/math/lanes_functions.h"

namespace relief {

/// What the lobes of eight hits have in common.
struct LobePairKind {
  Maths maths = Maths::k34;
  bool is_lambert = false;  ///< the diffuse lobe, or else that of Principled
  MixtureFresnel fresnel = MixtureFresnel::kInterpolated;
  SmithMasking masking = SmithMasking::kSeparable;
  bool mirrors_below = true;      ///< see MixtureLobe
  bool reflection_first = false;  ///< it is the first to be sampled
};

RELIEF_KERNEL bool operator==(const LobePairKind& a, const LobePairKind& b)
{
  return a.maths == b.maths && a.is_lambert == b.is_lambert && a.fresnel == b.fresnel && a.masking == b.masking &&
         a.mirrors_below == b.mirrors_below && a.reflection_first == b.reflection_first;
}

/// What eight such hits are asked, and what they answer: columns, in the order in which they become known.
struct alignas(32) LobePairs {
  LobePairKind kind;
  Principled3Columns lobes;  ///< of other closures frame, wo, and numbers of lobes
  alignas(32) std::int32_t has_diffuse[8] = {}, has_reflection[8] = {};  ///< −1: there is such a lobe
  std::int32_t is_delta[8];                                              ///< −1: the reflection is
  std::int32_t is_bent[8];                                               ///< −1: their normal is not the surface's
  float p_diffuse[8], p_reflection[8];  ///< as MixtureLobe::probability; 0 of what is not there
  float reflection[3][8];               ///< weight
  float edge[3][8];                     ///< FresnelF82::B
  float Ng[3][8];                       ///< world, on wo's side
  float side[9][8];                     ///< frame of the surface, in which wi is
  float to_lamp[3][8];                  ///< unit, world
  float lamp_diffuse[3][8], lamp_reflection[3][8], lamp_pdf[8];  ///< f of either lobe, and density of both
  float u[2][8];
  float wi[3][8], f[3][8], pdf[8], width[8];  ///< as of BsdfSample; width is its roughness
  std::int32_t bits[8];                       ///< likewise, `lobe`
};

/// One of the eight.
struct LobePairLane {
  LobePairs* hits;
  int lane;
  float gain = 1;                 ///< see Mixture
  bool is_diffuse_alone = false;  ///< the reflection is left out
};

/// Makes pairs of plain Principled closures that principled3_columns_make has resolved.
/// @param h     has those
/// @param side  the surfaces' frames
/// @param blur  least width α of microfacets; 0: none. As lobe_blur
[[gnu::noinline]] RELIEF_KERNEL void lobe_pairs_make(const MixtureBuildLanes& b,
                                                     const Frame8& side,
                                                     F8 blur,
                                                     LobePairs& h)
{
  Principled3Columns& c = h.lobes;
  h.kind = {};
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
  store8(h.reflection, Vec3x8{weight, weight, weight});
  store8(h.is_bent, ~(load8(c.cos_bend) > kUnbentLobe));
  const F8 roughness = load8(c.roughness);
  store8(h.is_delta, (roughness * roughness < kDeltaAlpha) & (blur < kDeltaAlpha));
  store8(c.roughness, max(roughness, sqrt(blur)));
  store8(c.alpha[0], max(load8(c.alpha[0]), blur));
  store8(c.alpha[1], max(load8(c.alpha[1]), blur));
}

/// Begins pairs of which each is taken from a list.
RELIEF_KERNEL void lobe_pairs_begin(LobePairs& h)
{
  // What the pairs before were would decide which of these are alike.
  h.kind = {};
  for (int k = 0; k < 8; ++k) h.has_diffuse[k] = h.has_reflection[k] = 0;
}

/// Takes the lobes of one hit from their list.
/// @param is_first  no other was taken before
/// @return          false: they are no pair, or not like those before
RELIEF_KERNEL bool lobe_pairs_take(LobePairs& h, int lane, bool is_first, const MixtureLobes& all)
{
  const MixtureLobe *diffuse = nullptr, *reflection = nullptr;
  LobePairKind kind = h.kind;
  for (int i = 0; i < all.size; ++i) {
    const MixtureLobe& lobe = all.lobes[i];
    const bool is_lambert = lobe.kind == MixtureLobeKind::kLambert;
    if (lobe.is_on_curve || (i > 0 && lobe.maths != kind.maths)) return false;
    kind.maths = lobe.maths;
    if (lobe.kind == MixtureLobeKind::kGgx && reflection == nullptr) {
      reflection = &lobe;
      kind.fresnel = lobe.fresnel.kind;
      kind.masking = lobe.shape.ggx.masking;
      kind.mirrors_below = lobe.mirrors_below;
      kind.reflection_first = diffuse == nullptr;
    } else if (diffuse == nullptr &&
               (is_lambert || (lobe.kind == MixtureLobeKind::kPrincipledDiffuse &&
                               lobe.shape.principled_diffuse.part == PrincipledDiffusePart::kAll))) {
      diffuse = &lobe;
      kind.is_lambert = is_lambert;
    } else {
      return false;
    }
  }
  const bool is_known = kind.fresnel == MixtureFresnel::kNone || kind.fresnel == MixtureFresnel::kInterpolated ||
                        kind.fresnel == MixtureFresnel::kF82;
  if (!is_known || (!is_first && kind != h.kind)) return false;
  h.kind = kind;
  Principled3Columns& c = h.lobes;
  h.has_diffuse[lane] = diffuse != nullptr ? -1 : 0;
  h.has_reflection[lane] = reflection != nullptr ? -1 : 0;
  h.p_diffuse[lane] = diffuse != nullptr ? diffuse->probability : 0.0f;
  h.p_reflection[lane] = reflection != nullptr ? reflection->probability : 0.0f;
  const MixtureLobe* const any = reflection != nullptr ? reflection : diffuse;
  if (any == nullptr) return true;
  store_lane(c.frame, lane, any->frame.s);
  store_lane(c.frame + 3, lane, any->frame.t);
  store_lane(c.frame + 6, lane, any->frame.n);
  store_lane(c.wo, lane, any->wo);
  h.is_bent[lane] = any->is_bent ? -1 : 0;
  store_lane(c.surface_N, lane, any->surface_N);
  if (diffuse != nullptr) {
    if (diffuse->frame.n != any->frame.n || diffuse->frame.s != any->frame.s) return false;
    store_lane(c.diffuse, lane, diffuse->weight);
    c.given_roughness[lane] = kind.is_lambert ? 0.0f : diffuse->shape.principled_diffuse.roughness;
  }
  if (reflection == nullptr) return true;
  store_lane(h.reflection, lane, reflection->weight);
  h.is_delta[lane] = reflection->is_delta ? -1 : 0;
  c.alpha[0][lane] = reflection->shape.ggx.alpha.x;
  c.alpha[1][lane] = reflection->shape.ggx.alpha.y;
  c.roughness[lane] = reflection->roughness;
  c.eta[lane] = reflection->fresnel.eta;
  store_lane(c.F0, lane, reflection->fresnel.a);
  store_lane(h.edge, lane, reflection->fresnel.b);
  return true;
}

/// Says what surface a hit's lobes are taken of.
RELIEF_KERNEL void lobe_pairs_set_surface(LobePairs& h, int lane, Vec3f Ng, const Frame& side)
{
  store_lane(h.Ng, lane, Ng);
  store_lane(h.side, lane, side.s);
  store_lane(h.side + 3, lane, side.t);
  store_lane(h.side + 6, lane, side.n);
}

/// f of either lobe, and the density of both.
struct LobePairsEval {
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

/// As bump_shadowing_ggx.
RELIEF_KERNEL F8 bump_shadowing_ggx(const Vec3x8& N, const Vec3x8& wi)
{
  const F8 one = splat8(1.0f), none = splat8(0.0f), cos_N = abs(N.z), cos_i = abs(dot(N, wi));
  const auto tan_squared = [&](F8 cosine) { return max(1.0f / (cosine * cosine) - 1.0f, none); };
  const F8 alpha_squared = min(0.125f * tan_squared(cos_N), one);
  const F8 seen = 2.0f / (1.0f + sqrt(1.0f + alpha_squared * tan_squared(cos_i)));
  return cos_i >= 1e-6f ? seen : cos_N < 1.0f ? none : one;
}

/// As mixture_fresnel.
RELIEF_KERNEL Vec3x8 lobe_pairs_fresnel(const LobePairs& h, F8 cos_d)
{
  const F8 one = splat8(1.0f);
  if (h.kind.fresnel == MixtureFresnel::kNone) return {one, one, one};
  const Vec3x8 F0 = load8(h.lobes.F0);
  if (h.kind.fresnel == MixtureFresnel::kF82) {
    const F8 x = clamp(1.0f - cos_d, 0.0f, 1.0f), x5 = x * x * (x * x) * x, bend = cos_d * x5 * x;
    const Vec3x8 B = load8(h.edge);
    const auto axis = [&](F8 f0, F8 b) { return clamp(f0 * (1.0f - x5) + x5 - b * bend, 0.0f, 1.0f); };
    return {axis(F0.x, B.x), axis(F0.y, B.y), axis(F0.z, B.z)};
  }
  const F8 w = fresnel_dielectric_weight(cos_d, load8(h.lobes.eta));
  return F0 * (1.0f - w) + Vec3x8{w, w, w};
}

/// As ggx_anisotropic_eval.
RELIEF_KERNEL F8
ggx_anisotropic_eval(F8 alpha_x, F8 alpha_y, SmithMasking masking, const Vec3x8& wo, const Vec3x8& wi, F8& pdf)
{
  const Vec3x8 h = wo + wi;
  const F8 hx = h.x / alpha_x, hy = h.y / alpha_y;
  const F8 ratio = dot(h, h) / (hx * hx + hy * hy + h.z * h.z);
  const F8 D = kInvPi / (alpha_x * alpha_y) * (ratio * ratio);
  const auto stretched = [&](const Vec3x8& w) {
    const F8 x = alpha_x * w.x, y = alpha_y * w.y;
    return sqrt(w.z * w.z + x * x + y * y);
  };
  const F8 cos_i = abs(wi.z), o_length = stretched(wo), i_length = stretched(wi);
  pdf = 0.5f * D / (wo.z + o_length);
  return masking == SmithMasking::kSeparable ? D / ((wo.z + o_length) * (cos_i + i_length))
                                             : 0.5f * D / (wo.z * i_length + cos_i * o_length);
}

/// As mixture_eval.
/// @param wi      unit, world
/// @param is_own  lanes in which wi was sampled from the reflection
[[gnu::noinline]] RELIEF_KERNEL LobePairsEval lobe_pairs_eval(const LobePairs& h, const Vec3x8& wi, I8 is_own)
{
  const Principled3Columns& c = h.lobes;
  const Vec3x8 wo = load8(c.wo), wi_lobe = to_local(load_frame8(c.frame), wi);
  const F8 none = splat8(0.0f), cos_i = abs(wi_lobe.z), z_surface = dot(wi, load8(h.side + 6));
  const F8 cos_surface = abs(z_surface);
  const I8 is_seen = (cos_surface > kMinCosine) & (cos_i > kMinCosine);
  // What a lobe is asked for, and what is found by it: see mixture_reaches.
  const I8 above = wi_lobe.z >= 0.0f, above_Ng = dot(wi, load8(h.Ng)) >= 0.0f;
  I8 asks_diffuse = above, asks_reflection = above, finds_diffuse = above & above_Ng, finds_reflection = above;
  if (h.kind.maths >= Maths::k52) {
    const I8 above_Ns = z_surface >= 0.0f;
    asks_diffuse = asks_reflection = above & above_Ns;
    finds_diffuse = asks_diffuse & above_Ng;
    finds_reflection = above & (above_Ns | above_Ng);
  } else if (h.kind.maths >= Maths::k43) {
    asks_reflection = finds_reflection = above & above_Ng;
  }

  const I8 has_diffuse = is_seen & load8(h.has_diffuse);
  F8 f_diffuse = splat8(kInvPi);
  if (!h.kind.is_lambert) f_diffuse = principled_diffuse_eval(load8(c.given_roughness), wo, wi_lobe);
  const I8 is_bent = has_diffuse & above & load8(h.is_bent);
  if (mask_of(is_bent) != 0) {
    const Vec3x8 N = load8(c.surface_N);
    const F8 fades = h.kind.maths >= Maths::k52 ? bump_shadowing_ggx(N, wi_lobe) : bump_shadowing(N, wi_lobe);
    f_diffuse = is_bent ? f_diffuse * fades : f_diffuse;
  }
  const I8 has_reflection = is_seen & (wo.z + wi_lobe.z > 0.0f) & load8(h.has_reflection) & ~load8(h.is_delta);
  F8 pdf_reflection;
  const F8 f_reflection =
      ggx_anisotropic_eval(load8(c.alpha[0]), load8(c.alpha[1]), h.kind.masking, wo, wi_lobe, pdf_reflection);
  const Vec3x8 F = lobe_pairs_fresnel(h, min(splat8(1.0f), 0.5f * length(wo + wi_lobe)));

  const F8 p_diffuse = load8(h.p_diffuse), p_reflection = load8(h.p_reflection), sum = p_diffuse + p_reflection;
  const F8 pdf = (has_diffuse & finds_diffuse ? p_diffuse * (wi_lobe.z * kInvPi) : none) +
                 (has_reflection & (finds_reflection | is_own) ? p_reflection * pdf_reflection : none);
  const F8 projected = cos_i / cos_surface;
  const Vec3x8 dark{}, weight = load8(h.reflection);
  return {select(has_diffuse & asks_diffuse, load8(c.diffuse) * (f_diffuse * projected), dark),
          select(has_reflection & (asks_reflection | is_own),
                 Vec3x8{weight.x * F.x, weight.y * F.y, weight.z * F.z} * (f_reflection * projected), dark),
          sum > 0.0f ? pdf / sum : none};
}

/// Evaluates all hits towards their lamps.
RELIEF_KERNEL void lobe_pairs_light(LobePairs& h)
{
  const LobePairsEval e = lobe_pairs_eval(h, load8(h.to_lamp), I8{});
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
[[gnu::noinline]] RELIEF_KERNEL void lobe_pairs_sample(LobePairs& h)
{
  const Principled3Columns& c = h.lobes;
  const F8 none = splat8(0.0f), one = splat8(1.0f);
  const F8 sum = load8(h.p_diffuse) + load8(h.p_reflection);
  const F8 p_diffuse = load8(h.p_diffuse) / sum, p_reflection = load8(h.p_reflection) / sum;
  const F8 u_x = load8(h.u[0]), u_y = load8(h.u[1]);
  const bool swaps = h.kind.reflection_first;
  const F8 p_first = swaps ? p_reflection : p_diffuse, p_second = swaps ? p_diffuse : p_reflection;
  const I8 is_first = (p_first > 0.0f) & ((u_x < p_first) | ~(p_second > 0.0f));
  const I8 is_diffuse = swaps ? ~is_first : is_first;
  const I8 is_mirror = ~is_diffuse & load8(h.is_delta);
  // Rounding may leave a little over behind the last lobe.
  const F8 within = min(is_first ? u_x / p_first : (u_x - p_first) / p_second, splat8(1.0f - kUnitRoundoff));
  const F8 u = within > 0.0f ? within : none;

  const Frame8 frame = load_frame8(c.frame), side = load_frame8(h.side);
  const Vec3x8 wo = load8(c.wo);
  const F8 roughness = load8(c.roughness);
  const Vec3x8 reflected = select(is_mirror, Vec3x8{-wo.x, -wo.y, wo.z},
                                  ggx_anisotropic_sample(load8(c.alpha[0]), load8(c.alpha[1]), wo, u, u_y));
  const Vec3x8 wi = from_local(frame, select(is_diffuse, warp_cosine_hemisphere(u, u_y), reflected));
  const Vec3x8 wi_surface = to_local(side, wi);
  const F8 cos_surface = abs(wi_surface.z);
  I8 is_found = (sum > 0.0f) & (dot(wi, load8(h.Ng)) >= 0.0f) & (cos_surface > kMinCosine);
  if (h.kind.maths >= Maths::k52) is_found &= ~is_diffuse | (wi_surface.z >= 0.0f);
  if (!h.kind.mirrors_below) is_found &= is_diffuse | (reflected.z >= 0.0f);
  store8(h.wi, wi_surface);
  store8(h.width, is_diffuse ? one : is_mirror ? none : roughness * roughness);
  const auto bits = [](std::uint32_t b) { return I8{} + static_cast<std::int32_t>(kLobeReflect | b); };
  store8(h.bits, is_diffuse ? bits(kLobeDiffuse) : is_mirror ? bits(kLobeDelta) : bits(kLobeGlossy));

  const LobePairsEval e = lobe_pairs_eval(h, wi, ~is_diffuse);
  Vec3x8 f = e.diffuse + e.reflection;
  F8 pdf = e.pdf;
  if (mask_of(is_mirror) != 0) {
    const Vec3x8 F = lobe_pairs_fresnel(h, wo.z), weight = load8(h.reflection);
    f = select(is_mirror, Vec3x8{weight.x * F.x, weight.y * F.y, weight.z * F.z} / cos_surface, f);
    pdf = is_mirror ? p_reflection : pdf;
  }
  store8(h.f, f);
  store8(h.pdf, is_found ? pdf : none);
}

RELIEF_KERNEL LobePairLane closure_diffuse(LobePairLane one)
{
  one.is_diffuse_alone = true;
  return one;
}

/// As closure_eval of a Mixture towards the hit's lamp, which has been evaluated.
template <unsigned kFeatures>
RELIEF_KERNEL BsdfEval closure_eval(const LobePairLane& one, const BsdfTables&, Vec3f)
{
  const LobePairs& h = *one.hits;
  const Vec3f diffuse = load_lane(h.lamp_diffuse, one.lane);
  if (one.is_diffuse_alone) return {diffuse, 0.0f};
  return {diffuse + load_lane(h.lamp_reflection, one.lane), h.lamp_pdf[one.lane]};
}

/// As closure_sample of a Mixture by the hit's u, which has been sampled.
RELIEF_KERNEL BsdfSample closure_sample(const LobePairLane& one)
{
  const LobePairs& h = *one.hits;
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
