// Closures of one or two lobes, of eight hits at once: diffuse and translucent ones, reflection and refraction by microfacets, and glass
// up to Blender 3.6, which is both. The numbers are those of mixture_make.h, by the same operations in the same order.
#pragma once

#include "kernel/bsdf/lobe_columns.h"

namespace relief {

/// Whether a closure weighs enough to be there.
RELIEF_KERNEL I8 closure_weighs(F8 weight) { return (weight > kLeastClosureWeight) & (weight < kInfinity); }

/// A diffuse closure that is not rough.
RELIEF_KERNEL void diffuse_columns_add(const MixtureBuildLanes& b,
                                       const SurfaceClosureSpec& spec,
                                       F8 weight,
                                       const Vec3x8& color,
                                       const Vec3x8& normal,
                                       LobeColumns& columns)
{
  const Vec3x8 N = spec.maths >= Maths::k43 ? closure_normal_as_given(b, normal) : closure_normal(b, normal);
  const int frame = lobe_frames_add(columns, b, N);
  lobe_column_add(columns, {.kind = MixtureLobeKind::kLambert, .maths = spec.maths}, frame, color * weight,
                  closure_weighs(weight));
}

RELIEF_KERNEL void translucent_columns_add(const MixtureBuildLanes& b,
                                           const SurfaceClosureSpec& spec,
                                           F8 weight,
                                           const Vec3x8& color,
                                           const Vec3x8& normal,
                                           LobeColumns& columns)
{
  const int frame = lobe_frames_add(columns, b, closure_normal(b, normal));
  lobe_column_add(columns, {.kind = MixtureLobeKind::kTranslucent, .maths = spec.maths}, frame, color * weight,
                  closure_weighs(weight));
}

/// As closure_roughness.
RELIEF_KERNEL F8 closure_roughness(const SurfaceClosureSpec& spec, F8 given)
{
  return saturated(spec.maths >= Maths::k43 ? given : abs(given));
}

/// As closure_eta.
RELIEF_KERNEL F8 closure_eta(const MixtureBuildLanes& b, F8 ior)
{
  const F8 bounded = max(ior, splat8(1e-5f));
  return b.is_front ? bounded : 1.0f / bounded;
}

RELIEF_KERNEL SmithMasking closure_masking(const SurfaceClosureSpec& spec)
{
  return spec.maths >= Maths::k43 ? SmithMasking::kCorrelated : SmithMasking::kSeparable;
}

/// Reflection by microfacets whose reflectance is 1.
/// @param roughness  as of closure_roughness
/// @param anisotropy  of the Glossy node
/// @param wanted      see lobe_column_add
RELIEF_KERNEL void reflection_column_add(const SurfaceClosureSpec& spec,
                                         const Vec3x8& weight,
                                         int frame,
                                         F8 roughness,
                                         F8 anisotropy,
                                         I8 wanted,
                                         LobeColumns& columns)
{
  const bool is_beckmann = spec.distribution == ClosureDistribution::kBeckmann;
  const LobeColumnKind kind{.kind = is_beckmann ? MixtureLobeKind::kBeckmann : MixtureLobeKind::kGgx,
                            .maths = spec.maths,
                            .masking = closure_masking(spec),
                            .mirrors_below = microfacets_mirror_below(spec)};
  LobeColumn* const lobe = lobe_column_add(columns, kind, frame, weight, wanted);
  if (lobe == nullptr) return;
  const F8 alpha = roughness * roughness, a = clamp(anisotropy, -0.99f, 0.99f);
  const F8 wider = 1.0f + a, narrower = 1.0f - a;
  const F8 x = a < 0.0f ? alpha / wider : alpha * narrower, y = a < 0.0f ? alpha * wider : alpha / narrower;
  const F8 none = splat8(0.0f);
  lobe_column_set_microfacets(*lobe, roughness, clamp(x, kDeltaAlpha, 1.0f), clamp(y, kDeltaAlpha, 1.0f), none,
                              Vec3x8{none, none, none});
}

/// As refraction_add.
/// @param roughness  as it is given
/// @param wanted     see lobe_column_add
RELIEF_KERNEL void refraction_column_add(const SurfaceClosureSpec& spec,
                                         const Vec3x8& weight,
                                         int frame,
                                         F8 roughness,
                                         F8 eta,
                                         I8 wanted,
                                         LobeColumns& columns)
{
  const LobeColumnKind kind{.kind = MixtureLobeKind::kRefraction,
                            .maths = spec.maths,
                            .masking = closure_masking(spec),
                            .is_beckmann = spec.distribution == ClosureDistribution::kBeckmann};
  LobeColumn* const lobe = lobe_column_add(columns, kind, frame, weight, wanted);
  if (lobe == nullptr) return;
  const F8 bounded = saturated(abs(roughness)), alpha = bounded * bounded, none = splat8(0.0f);
  lobe_column_set_microfacets(*lobe, bounded, alpha, alpha, eta, Vec3x8{none, none, none});
  store8(lobe->is_delta, (alpha < kDeltaAlpha) | lobe_column_is_matched(*lobe));
}

/// Inputs of eight microfacet closures.
struct FacetLanes {
  F8 weight;
  Vec3x8 color;
  F8 roughness;
  F8 ior;         ///< of what refracts
  F8 anisotropy;  ///< of what reflects alone
  Vec3x8 normal;  ///< Z up; 0: the surface's
};

/// Glossy closures without a tangent.
RELIEF_KERNEL void glossy_columns_add(const MixtureBuildLanes& b,
                                      const SurfaceClosureSpec& spec,
                                      const FacetLanes& in,
                                      LobeColumns& columns)
{
  const int frame = lobe_frames_add(columns, b, closure_normal(b, in.normal));
  reflection_column_add(spec, in.color * in.weight, frame, closure_roughness(spec, in.roughness), in.anisotropy,
                        closure_weighs(in.weight), columns);
}

RELIEF_KERNEL void refraction_columns_add(const MixtureBuildLanes& b,
                                          const SurfaceClosureSpec& spec,
                                          const FacetLanes& in,
                                          LobeColumns& columns)
{
  const int frame = lobe_frames_add(columns, b, closure_normal(b, in.normal));
  refraction_column_add(spec, in.color * in.weight, frame, in.roughness, closure_eta(b, in.ior),
                        closure_weighs(in.weight), columns);
}

/// Glass up to 3.6: the surface's own normal decides how much is reflected, whatever its microfacets are.
RELIEF_KERNEL void glass3_columns_add(const MixtureBuildLanes& b,
                                      const SurfaceClosureSpec& spec,
                                      const FacetLanes& in,
                                      LobeColumns& columns)
{
  const Vec3x8 N = closure_normal(b, in.normal), color = not_negative(in.color);
  const int frame = lobe_frames_add(columns, b, N);
  const I8 wanted = closure_weighs(in.weight);
  const F8 eta = closure_eta(b, in.ior), F = fresnel_dielectric_at(saturated(dot(N, b.wo)), eta);
  reflection_column_add(spec, color * (in.weight * F), frame, closure_roughness(spec, in.roughness), splat8(0.0f),
                        wanted, columns);
  refraction_column_add(spec, color * (in.weight * (1.0f - F)), frame, in.roughness, eta, wanted, columns);
}

}  // namespace relief
