// The Principled closure up to Blender 3.6, of eight hits at once: its diffuse base, sheen, its reflection by GGX, and its coat. Most
// surfaces of most files are this and no more. The numbers are those of principled3.h, by the same operations in the same order.
#pragma once

#include "kernel/bsdf/lobe_columns.h"

namespace relief {

/// Inputs of eight hits. What is not here is nothing: see closure_has_columns.
struct Principled3Lanes {
  F8 weight;
  Vec3x8 base_color;
  F8 metallic, specular, specular_tint, roughness, anisotropic;
  Vec3x8 normal;  ///< Z up; 0: the surface's
  bool has_sheen = false;
  F8 sheen, sheen_tint;
  bool has_coat = false;
  F8 coat, coat_roughness;
  Vec3x8 coat_normal;  ///< likewise
};

/// As tint_of.
RELIEF_KERNEL Vec3x8 tint_of(const Vec3x8& color, F8 luminance)
{
  return select(luminance > 0.0f, color / luminance, splat8(Vec3f{1, 1, 1}));
}

/// As principled3_specular_add.
RELIEF_KERNEL void principled3_specular_add(LobeColumns& columns, const Principled3Lanes& in, int frame)
{
  const LobeColumnKind kind{
      .kind = MixtureLobeKind::kGgx, .fresnel = MixtureFresnel::kInterpolated, .mirrors_below = true};
  const I8 is_wanted = (in.specular > kLeastClosureWeight) | (in.metallic > kLeastClosureWeight);
  LobeColumn* const lobe = lobe_column_add(columns, kind, frame, Vec3x8{in.weight, in.weight, in.weight}, is_wanted);
  if (lobe == nullptr) return;
  const Vec3x8 color = in.base_color, white = splat8(Vec3f{1, 1, 1});
  const F8 roughness = saturated(abs(in.roughness)), alpha = roughness * roughness;
  const F8 aspect = safe_sqrt(1.0f - 0.9f * in.anisotropic);
  const F8 luminance = 0.3f * color.x + 0.6f * color.y + 0.1f * color.z;
  const Vec3x8 tint = lerp(in.specular_tint, white, tint_of(color, luminance));
  const Vec3x8 F0 = saturated(lerp(in.metallic, tint * (0.08f * in.specular), color));
  const F8 eta = 2.0f / (1.0f - safe_sqrt(0.08f * min(not_negative(in.specular), splat8(12.4f)))) - 1.0f;
  lobe_column_set_microfacets(*lobe, roughness, clamp(alpha / aspect, kDeltaAlpha, 1.0f),
                              clamp(alpha * aspect, kDeltaAlpha, 1.0f), eta, F0);
  const F8 cos_o = load8(columns.frames[frame].wo[2]);
  lobe_column_favour(*lobe, mean_component(fresnel_interpolated(F0, cos_o, eta)));
}

/// Its coat.
RELIEF_KERNEL void principled3_coat_add(LobeColumns& columns, const MixtureBuildLanes& b, const Principled3Lanes& in)
{
  const LobeColumnKind kind{
      .kind = MixtureLobeKind::kClearcoat, .fresnel = MixtureFresnel::kInterpolated, .mirrors_below = true};
  const int frame = lobe_frames_add(columns, b, closure_normal(b, in.coat_normal));
  const F8 weight = in.weight * kGtr1Strength * in.coat;
  LobeColumn* const lobe =
      lobe_column_add(columns, kind, frame, Vec3x8{weight, weight, weight}, in.coat > kLeastClosureWeight);
  if (lobe == nullptr) return;
  const F8 roughness = saturated(abs(in.coat_roughness)), alpha = roughness * roughness;
  const F8 bounded = max(alpha, splat8(kGtr1DeltaAlpha)), eta = splat8(kGtr1Ior);
  const Vec3x8 F0 = splat8(splat3(0.04f));
  lobe_column_set_microfacets(*lobe, roughness, bounded, bounded, eta, F0);
  store8(lobe->is_delta, alpha <= kGtr1DeltaAlpha);
  const F8 cos_o = load8(columns.frames[frame].wo[2]);
  lobe_column_favour(*lobe, mean_component(fresnel_interpolated(F0, cos_o, eta)));
}

/// The frames of the diffuse lobes: those of the others, but where wo is below the horizon.
RELIEF_KERNEL int principled3_diffuse_frame(LobeColumns& columns,
                                            const MixtureBuildLanes& b,
                                            const Vec3x8& N,
                                            int frame)
{
  const F8 cos_o = load8(columns.frames[frame].wo[2]);
  // Lanes of no hit have no wo.
  const I8 is_low = ~(cos_o > kLeastDiffuseCosine) & (dot(b.wo, b.wo) > 0.0f);
  if (mask_of(is_low) == 0 || columns.num_frames == kMostLobeColumns) [[likely]]
    return frame;
  const int low = lobe_frames_add(columns, b, N, true);
  store8(columns.frames[low].wo, select(is_low, load8(columns.frames[low].wo), load8(columns.frames[frame].wo)));
  return low;
}

/// Resolves the closure.
[[gnu::noinline]] RELIEF_KERNEL void principled3_columns_make(const MixtureBuildLanes& b,
                                                              const Principled3Lanes& in,
                                                              LobeColumns& columns)
{
  const Vec3x8 N = closure_normal(b, in.normal);
  const int frame = lobe_frames_add(columns, b, N);
  const I8 is_there = (in.weight > kLeastClosureWeight) & (in.weight < kInfinity);
  const F8 base_weight = 1.0f - saturated(in.metallic);
  const I8 has_base = is_there & (base_weight > kLeastClosureWeight);
  const Vec3x8 diffuse = not_negative(in.base_color) * (in.weight * base_weight);
  if (LobeColumn* const lobe = lobe_column_add(columns, {.kind = MixtureLobeKind::kPrincipledDiffuse},
                                               principled3_diffuse_frame(columns, b, N, frame), diffuse, has_base)) {
    store8(lobe->shape[0], in.roughness);
  }
  if (in.has_sheen) {
    constexpr Vec3f kLuminance{0.2126729f, 0.7151522f, 0.0721750f};
    const Vec3x8 hue = tint_of(in.base_color, dot(in.base_color, splat8(kLuminance)));
    const Vec3x8 tint = lerp(in.sheen_tint, splat8(Vec3f{1, 1, 1}), hue);
    lobe_column_add(columns, {.kind = MixtureLobeKind::kPrincipledSheen}, frame,
                    tint * (in.weight * in.sheen * base_weight), has_base & (in.sheen > kLeastClosureWeight));
  }
  principled3_specular_add(columns, in, frame);
  if (in.has_coat) principled3_coat_add(columns, b, in);
}

}  // namespace relief
