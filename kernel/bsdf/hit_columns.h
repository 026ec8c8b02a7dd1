// Surfaces whose lobes are columns, eight at a time: light that comes from lamps, sampled directions, and what comes from there. All
// that mixture.h does with a hit's list of lobes, by the same operations: figures are the same but for rounding.
//
// Stages ask as they do of any other closure, of a HitLane, once the columns are known.
#pragma once

#include "kernel/bsdf/lobe_lanes.h"

namespace relief {

/// A denoiser is better told of what is behind or mirrored by a surface that scatters less than a quarter of its light by other
/// lobes than those up to this perceptual roughness, a width α of .075. The same bounds as Cycles'.
inline constexpr float kSeenThroughRoughness = 0.27386f;

/// Over all lobes of a hit.
struct alignas(32) LobesSum8 {
  float probability[8];
  float sharp[8];  ///< of those that a denoiser does not see, see kSeenThroughRoughness
  float weight[3][8];
};

RELIEF_KERNEL void lobe_columns_sum(const LobeColumns& c, LobesSum8& sum)
{
  const F8 none = splat8(0.0f);
  F8 probability = none, sharp = none;
  Vec3x8 weight{none, none, none};
  for (int i = 0; i < c.num_lobes; ++i) {
    const LobeColumn& lobe = c.lobes[i];
    const F8 p = load8(lobe.probability);
    probability += p;
    weight = weight + load8(lobe.weight);
    sharp += load8(lobe.roughness) <= kSeenThroughRoughness ? p : none;
  }
  store8(sum.probability, probability);
  store8(sum.sharp, sharp);
  store8(sum.weight, weight);
}

/// What eight such hits are asked, and what they answer: columns, in the order in which they become known.
struct alignas(32) HitColumns {
  LobeColumns lobes;
  alignas(32) float Ng[3][8];                               ///< world, on wo's side
  float side[9][8];                                         ///< frame of the surface, in which wi is
  LobesSum8 sum;                                            ///< of resolved lobes
  float to_lamp[3][8];                                      ///< unit, world
  float lamp_diffuse[3][8], lamp_other[3][8], lamp_pdf[8];  ///< f of diffuse lobes and of others, and density of all
  float u[2][8];
  float wi[3][8], f[3][8], pdf[8], width[8];  ///< as of BsdfSample; width is its roughness
  std::int32_t bits[8];                       ///< likewise, `lobe`
};

/// One of the eight.
struct HitLane {
  HitColumns* hits;
  int lane;
  float gain = 1;                 ///< see Mixture
  bool is_diffuse_alone = false;  ///< other lobes are left out
};

/// Begins hits whose lobes are resolved.
/// @param side  the surfaces' frames
/// @param blur  least width α of microfacets; 0: none. As lobe_blur
[[gnu::noinline]] RELIEF_KERNEL void hit_columns_begin(const MixtureBuildLanes& b,
                                                       const Frame8& side,
                                                       F8 blur,
                                                       HitColumns& h)
{
  store8(h.Ng, b.Ng);
  store8(h.side, side);
  const F8 root = sqrt(blur);
  for (int i = 0; i < h.lobes.num_lobes; ++i) {
    LobeColumn& lobe = h.lobes.lobes[i];
    if (mixture_traits(lobe.is.kind).is_diffuse) continue;
    store8(lobe.is_delta, load8(lobe.is_delta) & (blur < kDeltaAlpha));
    store8(lobe.roughness, max(load8(lobe.roughness), root));
    store8(lobe.shape[0], max(load8(lobe.shape[0]), blur));
    store8(lobe.shape[1], max(load8(lobe.shape[1]), blur));
  }
  lobe_columns_sum(h.lobes, h.sum);
}

/// Says what surface a hit's lobes are taken of.
RELIEF_KERNEL void hit_columns_set_surface(HitColumns& h, int lane, Vec3f Ng, const Frame& side)
{
  store_lane(h.Ng, lane, Ng);
  store_lane(h.side, lane, side.s);
  store_lane(h.side + 3, lane, side.t);
  store_lane(h.side + 6, lane, side.n);
}

/// f of diffuse lobes and of others, and the density of all.
struct HitColumnsEval {
  Vec3x8 diffuse, other;
  F8 pdf;
};

/// On which sides directions are: the lobe's, the surface's, the triangle's.
struct LobeSides8 {
  I8 above, above_Ns, above_Ng;
};

/// For which of them a column's lobes are asked, and found.
struct LobeReach8 {
  I8 asks, finds;
};

/// As mixture_reaches.
/// @param is_own  directions were sampled from the column's lobes, and leave by the true surface
RELIEF_KERNEL LobeReach8 lobe_column_reach(const LobeColumnKind& is, const LobeSides8& at, I8 is_own)
{
  if (!mixture_traits(is.kind).is_microfacet) {
    const I8 asks = is.maths >= Maths::k52 ? at.above & at.above_Ns : at.above;
    return {asks | is_own, (asks & at.above_Ng) | is_own};
  }
  if (is.maths >= Maths::k52) {
    return {(at.above & at.above_Ns) | is_own, (at.above & (at.above_Ns | at.above_Ng)) | is_own};
  }
  const I8 asks = is.maths >= Maths::k43 ? at.above & at.above_Ng : at.above;
  return {asks | is_own, asks | is_own};
}

/// As lobe_eval of a column's kind.
RELIEF_KERNEL F8 lobe_column_eval(const LobeColumn& lobe, const Vec3x8& wo, const Vec3x8& wi, F8& pdf)
{
  pdf = wi.z * kInvPi;
  switch (lobe.is.kind) {
    case MixtureLobeKind::kPrincipledDiffuse:
      return principled_diffuse_eval(load8(lobe.shape[0]), wo, wi);
    case MixtureLobeKind::kPrincipledSheen:
      return schlick_weight(0.5f * length(wo + wi));
    case MixtureLobeKind::kMicrofibre:
      return sheen_microfibre_eval(load8(lobe.shape), wo, wi, pdf);
    case MixtureLobeKind::kGgx:
      return ggx_anisotropic_eval(load8(lobe.shape[0]), load8(lobe.shape[1]), lobe.is.masking, wo, wi, pdf);
    case MixtureLobeKind::kClearcoat:
      return clearcoat_gtr1_eval(load8(lobe.shape[0]), wo, wi, pdf);
    default:
      return splat8(kInvPi);
  }
}

/// As mixture_eval.
/// @param wi      unit, world
/// @param is_own  by column: hits whose wi was sampled from its lobe. Null: none was
[[gnu::noinline]] RELIEF_KERNEL HitColumnsEval hit_columns_eval(const HitColumns& h, const Vec3x8& wi, const I8* is_own)
{
  const F8 none = splat8(0.0f), z_surface = dot(wi, load8(h.side + 6)), cos_surface = abs(z_surface);
  LobeSides8 at{{}, z_surface >= 0.0f, dot(wi, load8(h.Ng)) >= 0.0f};
  I8 is_seen{};
  Vec3x8 wo, wi_lobe;
  F8 projected{}, sum = none;
  Vec3x8 diffuse{none, none, none}, other = diffuse;
  F8 found = none;
  int frame = -1;
  for (int i = 0; i < h.lobes.num_lobes; ++i) {
    const LobeColumn& lobe = h.lobes.lobes[i];
    const LobeFrames& frames = h.lobes.frames[lobe.frame];
    if (lobe.frame != frame) {
      frame = lobe.frame;
      wo = load8(frames.wo);
      wi_lobe = to_local(load_frame8(frames.frame), wi);
      const F8 cos_i = abs(wi_lobe.z);
      is_seen = (cos_surface > kMinCosine) & (cos_i > kMinCosine);
      at.above = wi_lobe.z >= 0.0f;
      projected = cos_i / cos_surface;
    }
    const LobeReach8 reach = lobe_column_reach(lobe.is, at, is_own != nullptr ? is_own[i] : I8{});
    const F8 probability = load8(lobe.probability);
    F8 pdf, f = lobe_column_eval(lobe, wo, wi_lobe, pdf);
    I8 is_there = is_seen & load8(lobe.is_there);
    Vec3x8 weight = load8(lobe.weight);
    const bool is_diffuse = mixture_traits(lobe.is.kind).is_diffuse;
    if (is_diffuse) {
      const I8 is_bent = is_there & at.above & load8(frames.is_bent);
      if (mask_of(is_bent) != 0) {
        const Vec3x8 N = load8(frames.surface_N);
        const F8 fades = lobe.is.maths >= Maths::k52 ? bump_shadowing_ggx(N, wi_lobe) : bump_shadowing(N, wi_lobe);
        f = is_bent ? f * fades : f;
      }
    } else {
      is_there &= (wo.z + wi_lobe.z > 0.0f) & ~load8(lobe.is_delta);
      weight = multiplied(weight, lobe_column_fresnel(lobe, half_angle_cosine(wo, wi_lobe)));
    }
    const Vec3x8 part = select(is_there & reach.asks, weight * (f * projected), Vec3x8{none, none, none});
    if (is_diffuse) {
      diffuse = diffuse + part;
    } else {
      other = other + part;
    }
    found += is_there & reach.finds ? probability * pdf : none;
    sum += probability;
  }
  return {diffuse, other, sum > 0.0f ? found / sum : none};
}

/// Evaluates all hits towards their lamps.
RELIEF_KERNEL void hit_columns_light(HitColumns& h)
{
  const HitColumnsEval e = hit_columns_eval(h, load8(h.to_lamp), nullptr);
  store8(h.lamp_diffuse, e.diffuse);
  store8(h.lamp_other, e.other);
  store8(h.lamp_pdf, e.pdf);
}

/// Which lobes are sampled.
struct LobeChoice8 {
  I8 is_chosen[kMostLobeColumns];  ///< by column
  F8 u;                            ///< what is left of the number that has chosen
  F8 sum;                          ///< of all chances
};

RELIEF_KERNEL LobeChoice8 hit_columns_choose(const LobeColumns& c, F8 u)
{
  LobeChoice8 choice;
  choice.sum = splat8(0.0f);
  for (int i = 0; i < c.num_lobes; ++i) choice.sum += load8(c.lobes[i].probability);
  choice.u = splat8(1.0f);
  I8 is_open = choice.sum > 0.0f;
  for (int i = 0; i < c.num_lobes; ++i) {
    const F8 probability = load8(c.lobes[i].probability) / choice.sum;
    const I8 takes = is_open & (probability > 0.0f) & (u < probability);
    choice.is_chosen[i] = takes;
    choice.u = takes ? u / probability : choice.u;
    is_open &= ~takes;
    u = is_open ? u - probability : u;
  }
  // Rounding may leave a little over behind the last lobe.
  for (int i = c.num_lobes - 1; i >= 0 && mask_of(is_open) != 0; --i) {
    const I8 takes = is_open & (load8(c.lobes[i].probability) > 0.0f);
    choice.is_chosen[i] |= takes;
    is_open &= ~takes;
  }
  choice.u = min(choice.u, splat8(1.0f - kUnitRoundoff));
  return choice;
}

/// Samples all hits by their u, as closure_sample of a Mixture, and evaluates them in the directions found.
[[gnu::noinline]] RELIEF_KERNEL void hit_columns_sample(HitColumns& h)
{
  const F8 none = splat8(0.0f), one = splat8(1.0f), u_y = load8(h.u[1]);
  const LobeChoice8 choice = hit_columns_choose(h.lobes, load8(h.u[0]));
  const Vec3x8 cosine = warp_cosine_hemisphere(choice.u, u_y);
  const auto bits = [](std::uint32_t b) { return I8{} + static_cast<std::int32_t>(kLobeReflect | b); };
  Vec3x8 wi{none, none, none}, mirrored = wi;
  F8 width = one, p_mirror = none;
  I8 lobe_bits = bits(kLobeDiffuse), is_mirror{}, is_lost{}, stays_above{};
  for (int i = 0; i < h.lobes.num_lobes; ++i) {
    const I8 is_chosen = choice.is_chosen[i];
    if (mask_of(is_chosen) == 0) continue;
    const LobeColumn& lobe = h.lobes.lobes[i];
    const LobeFrames& frames = h.lobes.frames[lobe.frame];
    const Vec3x8 wo = load8(frames.wo);
    Vec3x8 local = cosine;
    if (mixture_traits(lobe.is.kind).is_diffuse) {
      if (lobe.is.kind == MixtureLobeKind::kMicrofibre) local = sheen_microfibre_sample(load8(lobe.shape), wo, cosine);
      if (lobe.is.maths >= Maths::k52) stays_above |= is_chosen;
    } else {
      const I8 is_delta = is_chosen & load8(lobe.is_delta);
      const F8 roughness = load8(lobe.roughness);
      local = select(is_delta, Vec3x8{-wo.x, -wo.y, wo.z},
                     ggx_anisotropic_sample(load8(lobe.shape[0]), load8(lobe.shape[1]), wo, choice.u, u_y));
      if (!lobe.is.mirrors_below) is_lost |= is_chosen & (local.z < 0.0f);
      width = is_delta ? none : is_chosen ? roughness * roughness : width;
      lobe_bits = is_delta ? bits(kLobeDelta) : is_chosen ? bits(kLobeGlossy) : lobe_bits;
      if (mask_of(is_delta) != 0) {
        is_mirror |= is_delta;
        mirrored = select(is_delta, multiplied(load8(lobe.weight), lobe_column_fresnel(lobe, wo.z)), mirrored);
        p_mirror = is_delta ? load8(lobe.probability) / choice.sum : p_mirror;
      }
    }
    wi = select(is_chosen, from_local(load_frame8(frames.frame), local), wi);
  }
  const Vec3x8 wi_surface = to_local(load_frame8(h.side), wi);
  const F8 cos_surface = abs(wi_surface.z);
  const I8 is_found = (choice.sum > 0.0f) & (dot(wi, load8(h.Ng)) >= 0.0f) & (cos_surface > kMinCosine) & ~is_lost &
                      (~stays_above | (wi_surface.z >= 0.0f));
  store8(h.wi, wi_surface);
  store8(h.width, width);
  store8(h.bits, lobe_bits);

  const HitColumnsEval e = hit_columns_eval(h, wi, choice.is_chosen);
  store8(h.f, select(is_mirror, mirrored / cos_surface, e.diffuse + e.other));
  store8(h.pdf, is_found ? (is_mirror ? p_mirror : e.pdf) : none);
}

RELIEF_KERNEL HitLane closure_diffuse(HitLane one)
{
  one.is_diffuse_alone = true;
  return one;
}

/// As closure_eval of a Mixture towards the hit's lamp, which has been evaluated.
template <unsigned kFeatures>
RELIEF_KERNEL BsdfEval closure_eval(const HitLane& one, const BsdfTables&, Vec3f)
{
  const HitColumns& h = *one.hits;
  const Vec3f diffuse = load_lane(h.lamp_diffuse, one.lane);
  if (one.is_diffuse_alone) return {diffuse, 0.0f};
  return {diffuse + load_lane(h.lamp_other, one.lane), h.lamp_pdf[one.lane]};
}

/// As closure_sample of a Mixture by the hit's u, which has been sampled.
RELIEF_KERNEL BsdfSample closure_sample(const HitLane& one)
{
  const HitColumns& h = *one.hits;
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
