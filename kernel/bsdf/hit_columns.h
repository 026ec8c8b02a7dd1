// Surfaces whose lobes are columns, eight at a time: light that comes from lamps, sampled directions, and what comes from there. All
// that mixture.h does with a hit's list of lobes, by the same operations: figures are the same but for rounding.
//
// Stages ask as they do of any other closure, of a HitLane, once the columns are known.
#pragma once

#include "kernel/bsdf/facet_lanes.h"

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

/// Directions in which hits are asked.
enum class HitTowards : std::uint8_t {
  kLamp,
  kPhoton,   ///< from where the photons come that have been gathered
  kSampled,  ///< where the path goes on
};

/// What lobes send there: f, and the density of all.
struct alignas(32) HitAnswer {
  float diffuse[3][8], other[3][8], pdf[8];
  float sharp[3][8], soft[3][8];  ///< of all, by HitColumns::most_sharp, where photons are traced
};

/// What eight such hits are asked, and what they answer: columns, in the order in which they become known.
struct alignas(32) HitColumns {
  LobeColumns lobes;
  alignas(32) float Ng[3][8];                 ///< world, on wo's side
  float side[9][8];                           ///< frame of the surface, in which wi is
  LobesSum8 sum;                              ///< of resolved lobes
  float most_sharp[8];                        ///< see SharpLobes::most_roughness; not read where no photons are
  float to[2][3][8];                          ///< unit, world; by HitTowards
  HitAnswer answers[3];                       ///< by HitTowards; of what is sampled the sharp part alone
  float u[3][8];                              ///< of which lobe and where in it, two; of glass, which way
  float wi[3][8], f[3][8], pdf[8], width[8];  ///< as of BsdfSample; width is its roughness
  std::int32_t bits[8];                       ///< likewise, `lobe`
};

/// Lobes of which there is an answer.
enum class HitPart : std::uint8_t { kAll, kDiffuse, kSharp, kSoft };

/// One of the eight, asked in a direction.
struct HitLane {
  HitColumns* hits;
  int lane;
  float gain = 1;  ///< see Mixture; lamps are asked without
  HitTowards towards = HitTowards::kLamp;
  HitPart part = HitPart::kAll;
};

/// Begins hits whose lobes are resolved.
/// @param side  the surfaces' frames
/// @param blur        least width α of microfacets; 0: none. As lobe_blur
/// @param most_sharp  likewise
[[gnu::noinline]] RELIEF_KERNEL void hit_columns_begin(const MixtureBuildLanes& b,
                                                       const Frame8& side,
                                                       F8 blur,
                                                       F8 most_sharp,
                                                       HitColumns& h)
{
  store8(h.Ng, b.Ng);
  store8(h.side, side);
  const F8 least_roughness = sqrt(blur);
  for (int i = 0; i < h.lobes.num_lobes; ++i) {
    LobeColumn& lobe = h.lobes.lobes[i];
    if (mixture_traits(lobe.is.kind).is_diffuse) continue;
    const F8 roughness = load8(lobe.roughness);
    I8 is_blurred = roughness > most_sharp;
    if (lobe.is.kind == MixtureLobeKind::kRefraction) is_blurred &= ~lobe_column_is_matched(lobe);
    const F8 least = is_blurred ? blur : splat8(0.0f);
    store8(lobe.is_delta, load8(lobe.is_delta) & (least < kDeltaAlpha));
    store8(lobe.roughness, is_blurred ? max(roughness, least_roughness) : roughness);
    store8(lobe.shape[0], max(load8(lobe.shape[0]), least));
    store8(lobe.shape[1], max(load8(lobe.shape[1]), least));
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

/// As HitAnswer.
struct HitColumnsEval {
  Vec3x8 diffuse, other;
  F8 pdf;
  Vec3x8 sharp, soft;
};

/// Directions that were sampled.
struct LobesSampled8 {
  I8 of[kMostLobeColumns];  ///< by column: from its lobe
  I8 is_through;            ///< whether it sent them through the surface
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
/// @param on_curves  of LobeColumns
/// @param is_own     directions were sampled from the column's lobes, and leave by the true surface
RELIEF_KERNEL LobeReach8 lobe_column_reach(const LobeColumnKind& is, bool on_curves, const LobeSides8& at, I8 is_own)
{
  const MixtureTraits& traits = mixture_traits(is.kind);
  const I8 by_Ns = ~(at.above ^ at.above_Ns), by_Ng = ~(at.above ^ at.above_Ng);  // on the same side
  const I8 is_meant = traits.sides == LobeSides::kReflect    ? at.above
                      : traits.sides == LobeSides::kTransmit ? ~at.above
                                                             : ~I8{};
  if (on_curves) {
    const I8 asks = is.maths == Maths::k43 && traits.is_microfacet ? is_meant & by_Ng : is_meant;
    return {asks | is_own, is_meant | is_own};
  }
  if (!traits.is_microfacet) {
    const I8 asks = is.maths >= Maths::k52 ? is_meant & by_Ns : is_meant;
    return {asks | is_own, (asks & by_Ng) | is_own};
  }
  if (is.maths >= Maths::k52) return {(is_meant & by_Ns) | is_own, (is_meant & (by_Ns | by_Ng)) | is_own};
  const I8 asks = is.maths >= Maths::k43 ? is_meant & by_Ng : is_meant;
  return {asks | is_own, asks | is_own};
}

/// As lobe_eval of a column's kind that reflects alone.
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
    case MixtureLobeKind::kBeckmann:
      return beckmann_eval(load8(lobe.shape[0]), load8(lobe.shape[1]), lobe.is.masking, wo, wi, pdf);
    case MixtureLobeKind::kClearcoat:
      return clearcoat_gtr1_eval(load8(lobe.shape[0]), wo, wi, pdf);
    default:
      return splat8(kInvPi);
  }
}

/// As mixture_eval.
/// @param kSplits  whether sharp and soft lobes are told apart
/// @param wi       unit, world
/// @param sampled  null: none was
template <bool kSplits>
[[gnu::noinline]] RELIEF_KERNEL HitColumnsEval hit_columns_eval(const HitColumns& h,
                                                                const Vec3x8& wi,
                                                                const LobesSampled8* sampled)
{
  const F8 none = splat8(0.0f), z_surface = dot(wi, load8(h.side + 6)), cos_surface = abs(z_surface);
  LobeSides8 at{{}, z_surface >= 0.0f, dot(wi, load8(h.Ng)) >= 0.0f};
  I8 is_seen{};
  Vec3x8 wo, wi_lobe;
  F8 projected{}, sum = none;
  Vec3x8 diffuse{none, none, none}, other = diffuse, sharp = diffuse, soft = diffuse;
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
    const I8 is_own = sampled != nullptr ? sampled->of[i] : I8{};
    const LobeReach8 reach = lobe_column_reach(lobe.is, h.lobes.on_curves, at, is_own);
    const F8 probability = load8(lobe.probability);
    F8 pdf, f;
    I8 is_there = is_seen & load8(lobe.is_there);
    Vec3x8 weight = load8(lobe.weight);
    const bool is_diffuse = mixture_traits(lobe.is.kind).is_diffuse;
    const bool goes_through = mixture_traits(lobe.is.kind).sides != LobeSides::kReflect;
    if (goes_through) {
      const I8 is_through = is_own ? (sampled != nullptr ? sampled->is_through : I8{}) : ~at.above;
      const ColumnEval8 e = lobe_column_eval_through(lobe, wo, wi_lobe, is_through);
      weight = multiplied(weight, e.f);
      f = splat8(1.0f);
      pdf = e.pdf;
    } else {
      f = lobe_column_eval(lobe, wo, wi_lobe, pdf);
    }
    if (is_diffuse) {
      // In Cycles what is sampled through the surface does not fade.
      const bool may_bend = !(h.lobes.on_curves && lobe.is.maths >= Maths::k52);
      const I8 is_bent =
          !may_bend ? I8{} : is_there & (goes_through ? ~at.above & ~is_own : at.above) & load8(frames.is_bent);
      if (mask_of(is_bent) != 0) {
        const Vec3x8 N = load8(frames.surface_N);
        const F8 fades = lobe.is.maths >= Maths::k52 ? bump_shadowing_ggx(N, wi_lobe) : bump_shadowing(N, wi_lobe);
        f = is_bent ? f * fades : f;
      }
    } else if (goes_through) {
      is_there &= ~load8(lobe.is_delta);
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
    if constexpr (kSplits) {
      // What is sharp of a sampled direction is asked as if it had not been sampled: photons would not be.
      const I8 is_sharp = (load8(lobe.roughness) <= load8(h.most_sharp)) & (load8(lobe.roughness) < kInfinity);
      const I8 is_asked = is_sharp & lobe_column_reach(lobe.is, h.lobes.on_curves, at, I8{}).asks;
      sharp = select(is_asked, sharp + part, sharp);
      soft = select(is_sharp, soft, soft + part);
    }
    found += is_there & reach.finds ? probability * pdf : none;
    sum += probability;
  }
  return {diffuse, other, sum > 0.0f ? found / sum : none, sharp, soft};
}

/// Evaluates all hits towards their lamps, or photons.
template <HitTowards kTowards>
RELIEF_KERNEL void hit_columns_ask(HitColumns& h)
{
  constexpr bool kSplits = kTowards == HitTowards::kPhoton;
  constexpr int kWhich = static_cast<int>(kTowards);
  const HitColumnsEval e = hit_columns_eval<kSplits>(h, load8(h.to[kWhich]), nullptr);
  HitAnswer& answer = h.answers[kWhich];
  store8(answer.diffuse, e.diffuse);
  store8(answer.other, e.other);
  store8(answer.pdf, e.pdf);
  if constexpr (kSplits) store8(answer.soft, e.soft);
}

/// Which lobes are sampled.
struct LobeChoice8 {
  LobesSampled8 sampled;  ///< whether through the surface is not known yet
  F8 u;                   ///< what is left of the number that has chosen
  F8 sum;                 ///< of all chances
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
    choice.sampled.of[i] = takes;
    choice.u = takes ? u / probability : choice.u;
    is_open &= ~takes;
    u = is_open ? u - probability : u;
  }
  // Rounding may leave a little over behind the last lobe.
  for (int i = c.num_lobes - 1; i >= 0 && mask_of(is_open) != 0; --i) {
    const I8 takes = is_open & (load8(c.lobes[i].probability) > 0.0f);
    choice.sampled.of[i] |= takes;
    is_open &= ~takes;
  }
  choice.u = min(choice.u, splat8(1.0f - kUnitRoundoff));
  return choice;
}

/// Samples all hits by their u, as closure_sample of a Mixture, and evaluates them in the directions found.
/// @param kSplits  whether sharp and soft lobes are told apart
template <bool kSplits>
[[gnu::noinline]] RELIEF_KERNEL void hit_columns_sample(HitColumns& h)
{
  const F8 none = splat8(0.0f), one = splat8(1.0f), u_y = load8(h.u[1]);
  LobeChoice8 choice = hit_columns_choose(h.lobes, load8(h.u[0]));
  const Vec3x8 cosine = warp_cosine_hemisphere(choice.u, u_y);
  const auto bits = [](std::uint32_t b) { return I8{} + static_cast<std::int32_t>(b); };
  Vec3x8 wi{none, none, none}, mirrored = wi;
  F8 width = one, p_mirror = none;
  I8 lobe_bits = bits(kLobeDiffuse), is_mirror{}, is_lost{}, by_Ns{}, is_through{}, is_free{};
  for (int i = 0; i < h.lobes.num_lobes; ++i) {
    const I8 is_chosen = choice.sampled.of[i];
    if (mask_of(is_chosen) == 0) continue;
    const LobeColumn& lobe = h.lobes.lobes[i];
    const LobeFrames& frames = h.lobes.frames[lobe.frame];
    const Vec3x8 wo = load8(frames.wo);
    const MixtureTraits& traits = mixture_traits(lobe.is.kind);
    Vec3x8 local = cosine, reflectance;
    F8 chance = one;
    if (traits.sides != LobeSides::kReflect) {
      const ColumnSample8 s = lobe_column_sample_through(lobe, wo, cosine, choice.u, u_y, load8(h.u[2]), is_chosen);
      local = s.wi;
      reflectance = s.reflectance;
      chance = s.probability;
      is_lost |= is_chosen & s.is_lost;
      is_through |= is_chosen & s.is_through;
      if (traits.is_microfacet && lobe.is.maths < Maths::k43) is_free |= is_chosen & s.is_through;
    }
    if (traits.is_diffuse) {
      if (lobe.is.kind == MixtureLobeKind::kMicrofibre) local = sheen_microfibre_sample(load8(lobe.shape), wo, cosine);
      if (lobe.is.maths >= Maths::k52) by_Ns |= is_chosen;
    } else {
      const I8 is_delta = is_chosen & load8(lobe.is_delta);
      const F8 roughness = load8(lobe.roughness);
      if (traits.sides == LobeSides::kReflect) {
        const F8 alpha_x = load8(lobe.shape[0]), alpha_y = load8(lobe.shape[1]);
        local = select(is_delta, Vec3x8{-wo.x, -wo.y, wo.z},
                       lobe.is.kind == MixtureLobeKind::kBeckmann
                           ? beckmann_sample(alpha_x, alpha_y, wo, choice.u, u_y, is_chosen & ~is_delta)
                           : ggx_anisotropic_sample(alpha_x, alpha_y, wo, choice.u, u_y));
        if (!lobe.is.mirrors_below || h.lobes.on_curves) is_lost |= is_chosen & (local.z < 0.0f);
      }
      width = is_delta ? none : is_chosen ? roughness * roughness : width;
      lobe_bits = is_delta ? bits(kLobeDelta) : is_chosen ? bits(kLobeGlossy) : lobe_bits;
      if (mask_of(is_delta) != 0) {
        is_mirror |= is_delta;
        if (traits.sides == LobeSides::kReflect) reflectance = lobe_column_fresnel(lobe, wo.z);
        mirrored = select(is_delta, multiplied(load8(lobe.weight), reflectance), mirrored);
        p_mirror = is_delta ? load8(lobe.probability) / choice.sum * chance : p_mirror;
      }
    }
    wi = select(is_chosen, from_local(load_frame8(frames.frame), local), wi);
  }
  const Vec3x8 wi_surface = to_local(load_frame8(h.side), wi);
  const F8 cos_surface = abs(wi_surface.z);
  const auto agrees = [&](F8 height) { return (height >= 0.0f) ^ is_through; };
  const I8 is_reached =
      h.lobes.on_curves ? ~I8{} : (agrees(dot(wi, load8(h.Ng))) | is_free) & (~by_Ns | agrees(wi_surface.z));
  const I8 is_found = (choice.sum > 0.0f) & is_reached & (cos_surface > kMinCosine) & ~is_lost;
  store8(h.wi, wi_surface);
  store8(h.width, width);
  store8(h.bits, lobe_bits | (is_through ? bits(kLobeTransmit) : bits(kLobeReflect)));

  choice.sampled.is_through = is_through;
  const HitColumnsEval e = hit_columns_eval<kSplits>(h, wi, &choice.sampled);
  if constexpr (kSplits) store8(h.answers[static_cast<int>(HitTowards::kSampled)].sharp, e.sharp);
  store8(h.f, select(is_mirror, mirrored / cos_surface, e.diffuse + e.other));
  store8(h.pdf, is_found ? (is_mirror ? p_mirror : e.pdf) : none);
}

RELIEF_KERNEL HitLane closure_diffuse(HitLane one)
{
  one.part = HitPart::kDiffuse;
  return one;
}

/// @pre  sharp are all that can be, or none, or those of HitColumns::most_sharp
RELIEF_KERNEL HitLane closure_soft(HitLane one, SharpLobes sharp)
{
  one.part = sharp.most_roughness == kInfinity ? HitPart::kDiffuse
             : sharp.most_roughness < 0.0f     ? HitPart::kAll
                                               : HitPart::kSoft;
  return one;
}

/// Those of HitColumns::most_sharp, in the direction that was sampled.
RELIEF_KERNEL HitLane closure_sharp(HitLane one, SharpLobes)
{
  one.towards = HitTowards::kSampled;
  one.part = HitPart::kSharp;
  return one;
}

template <bool kSharp>
RELIEF_KERNEL bool closure_has(const HitLane& one, SharpLobes sharp)
{
  const LobeColumns& c = one.hits->lobes;
  for (int i = 0; i < c.num_lobes; ++i) {
    const float roughness = c.lobes[i].roughness[one.lane];
    const bool is_sharp = roughness < kInfinity && roughness <= sharp.most_roughness;
    if (is_sharp == kSharp && c.lobes[i].probability[one.lane] > 0.0f) return true;
  }
  return false;
}

/// As closure_eval of a Mixture in a direction that has been evaluated.
template <unsigned kFeatures, TransportMode = TransportMode::kRadiance>
RELIEF_KERNEL BsdfEval closure_eval(const HitLane& one, const BsdfTables&, Vec3f)
{
  const HitAnswer& answer = one.hits->answers[static_cast<int>(one.towards)];
  const float gain = one.towards == HitTowards::kLamp ? 1.0f : one.gain;
  if (one.part == HitPart::kSharp) return {load_lane(answer.sharp, one.lane) * gain, 0.0f};
  if (one.part == HitPart::kSoft) return {load_lane(answer.soft, one.lane) * gain, 0.0f};
  const Vec3f diffuse = load_lane(answer.diffuse, one.lane);
  if (one.part == HitPart::kDiffuse) return {diffuse * gain, 0.0f};
  return {(diffuse + load_lane(answer.other, one.lane)) * gain, answer.pdf[one.lane]};
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
