// The Principled closure up to Blender 3.6 as lobes of a mixture.
#pragma once

#include "kernel/bsdf/mixture_build.h"

namespace relief {

/// The hue and saturation of a colour. @param luminance  of it, by weights of the caller's
RELIEF_KERNEL Vec3f tint_of(Vec3f color, float luminance)
{
  return luminance > 0.0f ? color / luminance : Vec3f{1, 1, 1};
}

/// What lies over the base of the Principled BSDF up to 3.6: its reflection, without anything taken from below.
RELIEF_KERNEL void principled3_specular_add(MixtureBuild& b,
                                            const SurfaceClosureSpec& spec,
                                            float weight,
                                            Vec3f N,
                                            const Principled3Inputs& in)
{
  if (!(in.specular > kLeastClosureWeight || in.metallic > kLeastClosureWeight)) return;
  MixtureLobe* lobe = reflection_add(b, splat3(weight), closure_tangent_frame(N, in.tangent, in.anisotropic_rotation));
  if (lobe == nullptr) return;
  SurfaceClosureSpec own = spec;
  // As Cycles does: smooth surfaces lose nothing worth giving back.
  if (in.roughness <= 0.075f) own.distribution = ClosureDistribution::kGgx;
  const float roughness = closure_roughness(spec, in.roughness);
  lobe_set_microfacets(*lobe, own, roughness, anisotropic_alpha_of_principled(roughness, in.anisotropic));
  const float luminance = 0.3f * in.base_color.x + 0.6f * in.base_color.y + 0.1f * in.base_color.z;
  const Vec3f tint = lerp(in.specular_tint, Vec3f{1, 1, 1}, tint_of(in.base_color, luminance));
  const Vec3f F0 = saturated(lerp(in.metallic, tint * (0.08f * in.specular), in.base_color));
  const float eta = ior_of_specular(max(in.specular, 0.0f));
  lobe->fresnel = {MixtureFresnel::kInterpolated, eta, F0, {}, 1.0f, 0.0f};
  lobe->probability *= mean_component(mixture_fresnel(lobe->fresnel, lobe->wo.z));
  lobe_give_back(b, own, *lobe, [&] { return saturated(fresnel_interpolated_mean(F0, {1, 1, 1}, eta)); });
}

/// Its glass: two lobes, between which the surface's own normal decides; one where microfacets scatter more than once.
RELIEF_KERNEL void principled3_glass_add(MixtureBuild& b,
                                         const SurfaceClosureSpec& spec,
                                         float weight,
                                         Vec3f N,
                                         const Principled3Inputs& in)
{
  const float eta = closure_eta(b, in.ior);
  const Vec3f base_color = max(in.base_color, Vec3f{});
  MicrofacetFresnel fresnel;
  fresnel.kind = MixtureFresnel::kInterpolated;
  fresnel.eta = eta;
  fresnel.a = saturated(lerp(in.specular_tint, Vec3f{1, 1, 1}, base_color));
  const bool gives_back = spec.distribution == ClosureDistribution::kMultiscatterGgx && in.roughness > 0.05f;
  if (gives_back) {
    glass_add(b, spec, weight, N, in.roughness, dielectric_fresnel(eta), {1, 1, 1}, base_color);
    return;
  }
  SurfaceClosureSpec own = spec;
  own.distribution = ClosureDistribution::kGgx;
  const float F = fresnel_dielectric_at(saturated(dot(N, b.wo)), eta);
  if (MixtureLobe* lobe = reflection_add(b, splat3(weight * F), frame_from_normal(N))) {
    const float roughness = closure_roughness(spec, in.roughness);
    lobe_set_microfacets(*lobe, own, roughness, anisotropic_alpha_of_glossy(roughness, 0.0f));
    lobe->fresnel = fresnel;
    lobe->probability *= mean_component(mixture_fresnel(fresnel, lobe->wo.z));
  }
  const bool is_single = spec.distribution == ClosureDistribution::kGgx;
  const float transmission_roughness =
      is_single ? 1.0f - (1.0f - in.roughness) * (1.0f - in.transmission_roughness) : in.roughness;
  refraction_add(b, own, base_color * (weight * (1.0f - F)), N, transmission_roughness, eta);
}

/// A sum of lobes, of which none takes from another.
/// @source  Burley 2012 and 2015, as Cycles 3.4 has them
RELIEF_KERNEL void closure_add(MixtureBuild& b,
                               const SurfaceClosureSpec& spec,
                               float weight,
                               const Principled3Inputs& in)
{
  const Vec3f N = closure_normal(b, in.normal);
  const float metallic = saturated(in.metallic), transmission = saturated(in.transmission);
  const float diffuse_weight = (1.0f - metallic) * (1.0f - transmission);
  const float glass_weight = transmission * (1.0f - metallic);
  const bool scatters_below = in.subsurface > kLeastClosureWeight;
  const Vec3f below = scatters_below ? lerp(in.subsurface, in.base_color, in.subsurface_color) : in.base_color;
  if (diffuse_weight > kLeastClosureWeight) {
    const Vec3f diffuse = max(below, Vec3f{}) * (weight * diffuse_weight);
    const bool enters = scatters_below && subsurface_enters(b, spec);
    const bool is_low = !(dot(N, b.wo) > kLeastDiffuseCosine);
    MixtureLobe* lobe = mixture_add(b, diffuse, frame_from_normal(N), is_low);
    if (lobe != nullptr) {
      lobe->kind = MixtureLobeKind::kPrincipledDiffuse;
      lobe->shape.principled_diffuse = {in.roughness};
      if (enters) {
        lobe->shape.principled_diffuse.part = PrincipledDiffusePart::kRetro;
        lobe->probability *= max(in.roughness, 0.0f) * schlick_weight(lobe->wo.z);
      }
    }
    if (enters) {
      Subsurface s;
      s.albedo = max(below, Vec3f{});
      s.radius = max(in.subsurface_radius * in.subsurface, Vec3f{});
      s.anisotropy = in.subsurface_anisotropy;
      s.entry_ior = in.subsurface_ior;
      s.leaves_by_fresnel = true;
      subsurface_add(b, spec, diffuse, N, s, MixtureLobeKind::kPrincipledDiffuse,
                     {in.roughness, PrincipledDiffusePart::kLambert});
    }
    if (in.sheen > kLeastClosureWeight) {
      constexpr Vec3f kLuminance{0.2126729f, 0.7151522f, 0.0721750f};
      const Vec3f tint = lerp(in.sheen_tint, Vec3f{1, 1, 1}, tint_of(in.base_color, dot(in.base_color, kLuminance)));
      MixtureLobe* sheen = mixture_add(b, tint * (weight * in.sheen * diffuse_weight), frame_from_normal(N));
      if (sheen != nullptr) sheen->kind = MixtureLobeKind::kPrincipledSheen;
    }
  }
  principled3_specular_add(b, spec, weight * (1.0f - glass_weight), N, in);
  if (glass_weight > kLeastClosureWeight) principled3_glass_add(b, spec, weight * glass_weight, N, in);
  if (in.clearcoat > kLeastClosureWeight) {
    const Vec3f coat_N = closure_normal(b, in.clearcoat_normal);
    MixtureLobe* coat = reflection_add(b, splat3(weight * kGtr1Strength * in.clearcoat), frame_from_normal(coat_N));
    if (coat == nullptr) return;
    coat->kind = MixtureLobeKind::kClearcoat;
    coat->mirrors_below = microfacets_mirror_below(spec);
    coat->roughness = closure_roughness(spec, in.clearcoat_roughness);
    const float alpha = sqr(coat->roughness);
    coat->shape.clearcoat = {max(alpha, kGtr1DeltaAlpha)};
    coat->is_delta = alpha <= kGtr1DeltaAlpha;
    coat->fresnel = {MixtureFresnel::kInterpolated, kGtr1Ior, splat3(0.04f), {}, 1.0f, 0.0f};
    coat->probability *= mean_component(mixture_fresnel(coat->fresnel, coat->wo.z));
  }
}

}  // namespace relief
