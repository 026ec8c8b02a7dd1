// The Principled closure of Blender 4.0 and later, of eight hits at once: sheen, coat, metal, reflection and diffuse base, each of
// which takes from those below. The numbers are those of principled4.h, by the same operations in the same order.
#pragma once

#include "kernel/bsdf/lobe_lanes.h"

namespace relief {

/// Inputs of eight hits. What is not here is nothing: see closure_has_columns.
struct Principled4Lanes {
  Maths maths = Maths::k43;
  bool gives_back = true;  ///< see lobe_give_back
  F8 weight;
  Vec3x8 base_color;
  F8 metallic, roughness, ior, specular_ior_level;
  Vec3x8 specular_tint;
  F8 anisotropic;
  Vec3x8 normal;  ///< Z up; 0: the surface's
  bool has_sheen = false;
  F8 sheen, sheen_roughness;
  Vec3x8 sheen_tint;
  bool has_coat = false;
  F8 coat, coat_roughness, coat_ior;
  Vec3x8 coat_normal;  ///< likewise
};

/// What its reflections have in common.
struct Principled4Facets {
  int frame;
  F8 cos_o, roughness;
  F8 alpha_x, alpha_y, width;  ///< perceptual, of both
};

RELIEF_KERNEL LobeColumnKind principled4_reflection(const Principled4Lanes& in, MixtureFresnel fresnel)
{
  return {MixtureLobeKind::kGgx, in.maths, fresnel, SmithMasking::kCorrelated, in.maths < Maths::k52};
}

/// As layered_weight, where a layer is.
RELIEF_KERNEL Vec3x8 layered_weight(const Vec3x8& weight, const Vec3x8& albedo, const LobeColumn& layer)
{
  return select(load8(layer.is_there), weight * saturated(1.0f - max_component(albedo)), weight);
}

/// As lobe_give_back, of what distributions give back.
/// @param ggx  of the lobes
RELIEF_KERNEL Vec3x8 lobe_column_give_back(LobeColumn& lobe, const GgxLost8& ggx, const Vec3x8& F_mean)
{
  const I8 gives = ~load8(lobe.is_delta);
  const Vec3x8 white = splat8(Vec3f{1, 1, 1});
  const Vec3x8 factor = select(gives, ggx_energy_factor(F_mean, ggx), white);
  lobe_column_scale(lobe, factor);
  const F8 first_share = gives ? 1.0f - ggx.lost : splat8(1.0f);
  store8(lobe.first_share, first_share);
  return factor * first_share;
}

/// Its sheen. @return  what that leaves of the weight for what lies below
RELIEF_KERNEL Vec3x8 principled4_sheen_add(LobeColumns& columns,
                                           const MixtureBuildLanes& b,
                                           const Principled4Lanes& in,
                                           const Vec3x8& weight)
{
  const Vec3x8 tint = not_negative(in.sheen_tint);
  const Vec3x8 middle = lerp(saturated(not_negative(in.coat)), closure_normal_as_given(b, in.normal),
                             closure_normal_as_given(b, in.coat_normal));
  const F8 squared = dot(middle, middle);
  const Vec3x8 N = select(squared > 0.0f, middle / sqrt(squared), closure_normal(b, in.normal));
  const int frame = lobe_frames_add(columns, b, N, true);
  LobeColumn* const lobe = lobe_column_add(columns, {MixtureLobeKind::kMicrofibre, in.maths}, frame,
                                           multiplied(weight, tint) * in.sheen, in.sheen > kLeastClosureWeight);
  if (lobe == nullptr) return weight;
  const Vec3x8 fibres = sheen_microfibre_make(load8(columns.frames[frame].wo[2]), saturated(in.sheen_roughness));
  const F8 albedo = fibres.z;
  store8(lobe->shape, fibres);
  const I8 is_there = load8(lobe->is_there) & (albedo > 0.0f);
  store8(lobe->is_there, is_there);
  store8(lobe->weight, select(is_there, load8(lobe->weight), Vec3x8{}));
  lobe_column_favour(*lobe, albedo);
  return layered_weight(weight, tint * (in.sheen * albedo), *lobe);
}

/// Its coat, without a tint. @return  likewise
RELIEF_KERNEL Vec3x8 principled4_coat_add(LobeColumns& columns,
                                          const MixtureBuildLanes& b,
                                          const Principled4Lanes& in,
                                          const Vec3x8& weight)
{
  const F8 coat = not_negative(in.coat), eta = max(in.coat_ior, splat8(1.0f)), F0 = fresnel_F0(eta);
  const int frame = lobe_frames_add(columns, b, closure_normal(b, in.coat_normal));
  LobeColumn* const lobe = lobe_column_add(columns, principled4_reflection(in, MixtureFresnel::kDielectric), frame,
                                           weight * coat, in.coat > kLeastClosureWeight);
  if (lobe == nullptr) return weight;
  const F8 roughness = saturated(in.coat_roughness), cos_o = load8(columns.frames[frame].wo[2]);
  const F8 alpha = clamp(roughness * roughness, kDeltaAlpha, 1.0f);
  lobe_column_set_microfacets(*lobe, roughness, alpha, alpha, eta, {F0, F0, F0});
  F8 F = fresnel_dielectric_at(cos_o, eta);
  Vec3x8 given_back = splat8(Vec3f{1, 1, 1});
  if (in.maths >= Maths::k52) {
    F = eta > 1.0f ? lerp(reflected_share(*b.tables, roughness, eta, cos_o), F0, splat8(1.0f)) : F;
    lobe_column_favour(*lobe, F);
    const F8 F_mean = (eta - 1.0f) / (4.08567f + 1.00071f * eta);
    given_back =
        lobe_column_give_back(*lobe, ggx_lost(*b.tables, sqrt(sqrt(alpha * alpha)), cos_o), {F_mean, F_mean, F_mean});
  } else {
    lobe_column_favour(*lobe, F);
  }
  return layered_weight(weight, given_back * (coat * F), *lobe);
}

/// Its metal.
RELIEF_KERNEL void principled4_metal_add(LobeColumns& columns,
                                         const Principled4Lanes& in,
                                         const Principled4Facets& facets,
                                         const GgxLost8& ggx,
                                         const Vec3x8& weight)
{
  const I8 is_wanted = in.metallic > kLeastClosureWeight;
  LobeColumn* const lobe =
      lobe_column_add(columns, principled4_reflection(in, MixtureFresnel::kF82), facets.frame, weight, is_wanted);
  if (lobe == nullptr) return;
  // As fresnel_f82_make.
  constexpr float kFifth = 0.46266436f, kInvPeak = 17.651384f;
  const F8 one = splat8(1.0f);
  const Vec3x8 F0 = saturated(not_negative(in.base_color));
  const auto bend = [&](F8 f0, F8 tint) {
    return (f0 * (1.0f - kFifth) + kFifth) * (1.0f - min(not_negative(tint), one)) * kInvPeak;
  };
  const Vec3x8 tint = in.specular_tint, B{bend(F0.x, tint.x), bend(F0.y, tint.y), bend(F0.z, tint.z)};
  lobe_column_set_microfacets(*lobe, facets.roughness, facets.alpha_x, facets.alpha_y, one, F0);
  store8(lobe->edge, B);
  lobe_column_favour(*lobe, mean_component(fresnel_f82(F0, B, facets.cos_o)));
  if (!in.gives_back) return;
  const F8 twenty_first = splat8(1.0f / 21.0f);
  lobe_column_give_back(
      *lobe, ggx,
      F0 * splat8(20.0f / 21.0f) + Vec3x8{twenty_first, twenty_first, twenty_first} - B * splat8(1.0f / 126.0f));
}

/// What a dielectric reflects. @return  what that leaves of the weight for what lies below
RELIEF_KERNEL Vec3x8 principled4_reflection_add(LobeColumns& columns,
                                                const MixtureBuildLanes& b,
                                                const Principled4Lanes& in,
                                                const Principled4Facets& facets,
                                                const GgxLost8& ggx,
                                                const Vec3x8& weight)
{
  const F8 ior = max(in.ior, splat8(1e-5f)), F0_ior = fresnel_F0(ior);
  const F8 F0_level = F0_ior * (2.0f * not_negative(in.specular_ior_level)), eta_level = ior_of_F0(F0_level);
  const I8 is_as_ior = in.specular_ior_level == 0.5f;
  const F8 F0 = is_as_ior ? F0_ior : F0_level;
  const F8 eta = is_as_ior ? ior : ior < 1.0f ? 1.0f / eta_level : eta_level;
  LobeColumn* const lobe = lobe_column_add(columns, principled4_reflection(in, MixtureFresnel::kInterpolated),
                                           facets.frame, weight, eta != 1.0f);
  if (lobe == nullptr) return weight;
  const Vec3x8 white = splat8(Vec3f{1, 1, 1}), tinted = saturated(not_negative(in.specular_tint) * F0);
  lobe_column_set_microfacets(*lobe, facets.roughness, facets.alpha_x, facets.alpha_y, eta, tinted);
  const Vec3x8 albedo = lerp(reflected_share(*b.tables, facets.width, eta, facets.cos_o), tinted, white);
  lobe_column_favour(*lobe, mean_component(fresnel_interpolated(tinted, facets.cos_o, eta)));
  Vec3x8 given_back = white;
  if (in.gives_back) {
    given_back = lobe_column_give_back(*lobe, ggx, saturated(fresnel_interpolated_mean(tinted, eta)));
  }
  return layered_weight(weight, multiplied(albedo, given_back), *lobe);
}

/// Resolves the closure.
[[gnu::noinline]] RELIEF_KERNEL void principled4_columns_make(const MixtureBuildLanes& b,
                                                              const Principled4Lanes& in,
                                                              LobeColumns& columns)
{
  const I8 is_there = (in.weight > kLeastClosureWeight) & (in.weight < kInfinity);
  const F8 start = is_there ? in.weight : splat8(0.0f);
  Vec3x8 weight{start, start, start};
  if (in.has_sheen) weight = principled4_sheen_add(columns, b, in, weight);
  if (in.has_coat) weight = principled4_coat_add(columns, b, in, weight);

  Principled4Facets facets;
  facets.frame = lobe_frames_add(columns, b, closure_normal(b, in.normal));
  facets.cos_o = load8(columns.frames[facets.frame].wo[2]);
  facets.roughness = saturated(in.roughness);
  const F8 alpha = facets.roughness * facets.roughness;
  const F8 aspect = safe_sqrt(1.0f - 0.9f * saturated(in.anisotropic));
  facets.alpha_x = clamp(alpha / aspect, kDeltaAlpha, 1.0f);
  facets.alpha_y = clamp(alpha * aspect, kDeltaAlpha, 1.0f);
  facets.width = sqrt(sqrt(facets.alpha_x * facets.alpha_y));
  GgxLost8 ggx{};
  if (in.gives_back) ggx = ggx_lost(*b.tables, min(facets.width, splat8(1.0f)), facets.cos_o);

  const F8 metallic = saturated(in.metallic);
  if (mask_of(metallic > kLeastClosureWeight) != 0) {
    principled4_metal_add(columns, in, facets, ggx, weight * metallic);
    weight = weight * (metallic > kLeastClosureWeight ? 1.0f - metallic : splat8(1.0f));
  }
  weight = principled4_reflection_add(columns, b, in, facets, ggx, weight);
  const int frame = lobe_frames_add(columns, b, closure_normal_as_given(b, in.normal));
  lobe_column_add(columns, {MixtureLobeKind::kLambert, in.maths}, frame,
                  multiplied(weight, not_negative(in.base_color)), is_there);
}

}  // namespace relief
