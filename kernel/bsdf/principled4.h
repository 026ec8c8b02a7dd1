// The Principled closure of Blender 4.0 and later as lobes of a mixture.
#pragma once

#include "kernel/bsdf/mixture_build.h"

namespace relief {

/// What a layer leaves for those below.
RELIEF_KERNEL Vec3f layered_weight(Vec3f weight, Vec3f albedo)
{
  return weight * clamp(1.0f - max_component(albedo), 0.0f, 1.0f);
}

/// Its coat. @return  what that leaves of the weight for what lies below
RELIEF_KERNEL Vec3f principled4_coat_add(MixtureBuild& b,
                                         const SurfaceClosureSpec& spec,
                                         Vec3f weight,
                                         Vec3f coat_N,
                                         const Principled4Inputs& in)
{
  const float coat = max(in.coat_weight, 0.0f), coat_ior = max(in.coat_ior, 1.0f);
  MixtureLobe* lobe = reflection_add(b, weight * coat, frame_from_normal(coat_N));
  if (lobe != nullptr) {
    // Since 5.0 what its facets reflect more than once is given back, and it takes from below what it reflects; before it took
    // what a smooth one reflects.
    SurfaceClosureSpec own = spec;
    own.distribution = spec.maths >= Maths::k52 ? ClosureDistribution::kMultiscatterGgx : ClosureDistribution::kGgx;
    const float coat_roughness = saturated(in.coat_roughness);
    lobe_set_microfacets(*lobe, own, coat_roughness, anisotropic_alpha_of_glossy(coat_roughness, 0.0f));
    lobe->fresnel = dielectric_fresnel(coat_ior);
    const float F =
        spec.maths >= Maths::k52 && coat_ior > 1.0f
            ? lerp(reflected_share(*b.tables, coat_roughness, coat_ior, lobe->wo.z), fresnel_F0(coat_ior), 1.0f)
            : fresnel_dielectric_at(lobe->wo.z, coat_ior);
    lobe->probability *= F;
    const Vec3f given_back = lobe_give_back(b, own, *lobe, [&] { return splat3(fresnel_dielectric_mean(coat_ior)); });
    weight = layered_weight(weight, given_back * (coat * F));
  }
  if (in.coat_tint != Vec3f{1, 1, 1}) {
    // Beer's law along the refracted ray, a coat of thickness 1.
    const float cos_o = saturated(dot(coat_N, b.wo));
    const float depth = 1.0f / __builtin_sqrtf(1.0f - (1.0f - sqr(cos_o)) / sqr(coat_ior));
    const auto absorbed = [&](float c) { return lerp(coat, 1.0f, std::pow(max(c, 0.0f), depth)); };
    weight *= max(Vec3f{}, {absorbed(in.coat_tint.x), absorbed(in.coat_tint.y), absorbed(in.coat_tint.z)});
  }
  return weight;
}

/// Its glass.
/// @param weight        of glass and what lies below it
/// @param transmission  the share of it that is glass
RELIEF_KERNEL void principled4_glass_add(MixtureBuild& b,
                                         const SurfaceClosureSpec& spec,
                                         Vec3f weight,
                                         float transmission,
                                         Vec3f N,
                                         const Principled4Inputs& in)
{
  const float roughness = saturated(in.roughness), ior = max(in.ior, 1e-5f);
  const float film_nm = max(in.thin_film_thickness, 0.0f), film_ior = max(in.thin_film_ior, 1e-5f);
  const Vec3f base_color = max(in.base_color, Vec3f{}), specular_tint = max(in.specular_tint, Vec3f{});
  MicrofacetFresnel fresnel =
      dielectric_fresnel(b, spec, closure_eta(b, ior), film_nm, b.front ? film_ior : film_ior / ior);
  fresnel.a = saturated(specular_tint * fresnel_F0(ior));
  if (fresnel.kind == MixtureFresnel::kDielectric && specular_tint != Vec3f{1, 1, 1}) {
    fresnel.kind = MixtureFresnel::kInterpolated;
  }
  const Vec3f through = saturated(base_color);
  const Vec3f root{__builtin_sqrtf(through.x), __builtin_sqrtf(through.y), __builtin_sqrtf(through.z)};
  const float mean = mean_component(weight);
  glass_add(b, spec, transmission * mean, N, roughness, fresnel, weight / max(mean, 1e-20f),
            root * weight / max(mean, 1e-20f));
}

/// Layers, of which each takes from those below: sheen, coat, metal, glass, reflection, diffuse base.
/// @source  Cycles 4.3 and 5.2
RELIEF_KERNEL void closure_add(MixtureBuild& b,
                               const SurfaceClosureSpec& spec,
                               float start,
                               const Principled4Inputs& in)
{
  const Vec3f N = closure_normal(b, in.normal), N_given = closure_normal_as_given(b, in.normal);
  const Vec3f coat_N = closure_normal(b, in.coat_normal);
  const float metallic = saturated(in.metallic), roughness = saturated(in.roughness);
  const float coat = max(in.coat_weight, 0.0f), ior = max(in.ior, 1e-5f);
  const Vec3f base_color = max(in.base_color, Vec3f{}), specular_tint = max(in.specular_tint, Vec3f{});
  Vec3f weight = splat3(start);
  if (in.sheen_weight > kLeastClosureWeight) {
    const Vec3f own = weight * max(in.sheen_tint, Vec3f{}) * in.sheen_weight;
    const Vec3f middle = lerp(saturated(coat), N_given, closure_normal_as_given(b, in.coat_normal));
    const float squared = length_squared(middle);
    const Vec3f sheen_N = squared > 0.0f ? middle / __builtin_sqrtf(squared) : N;
    const float albedo = microfibre_add(b, own, sheen_N, saturated(in.sheen_roughness));
    weight = layered_weight(weight, max(in.sheen_tint, Vec3f{}) * (in.sheen_weight * albedo));
  }
  if (in.coat_weight > kLeastClosureWeight) weight = principled4_coat_add(b, spec, weight, coat_N, in);
  const Frame base_frame = closure_tangent_frame(N, in.tangent, in.anisotropic_rotation);
  const AnisotropicAlpha alpha = anisotropic_alpha_of_principled(roughness, saturated(in.anisotropic));
  if (metallic > kLeastClosureWeight) {
    if (MixtureLobe* lobe = reflection_add(b, weight * metallic, base_frame)) {
      lobe_set_microfacets(*lobe, spec, roughness, alpha);
      const FresnelF82 f = fresnel_f82_make(saturated(base_color), min(specular_tint, splat3(1.0f)));
      lobe->fresnel = {MixtureFresnel::kF82, 1.0f, f.F0, f.B, 1.0f, 0.0f};
      metal_add_film(b, spec, in.thin_film_thickness, in.thin_film_ior, lobe->fresnel);
      lobe->probability *= mean_component(mixture_fresnel(lobe->fresnel, lobe->wo.z));
      lobe_give_back(b, spec, *lobe, [&] { return fresnel_f82_mean(f); });
    }
    weight *= 1.0f - metallic;
  }
  const float transmission = saturated(in.transmission_weight);
  const float film_nm = max(in.thin_film_thickness, 0.0f), film_ior = max(in.thin_film_ior, 1e-5f);
  if (transmission > kLeastClosureWeight) {
    principled4_glass_add(b, spec, weight, transmission, N, in);
    weight *= 1.0f - transmission;
  }
  float F0 = fresnel_F0(ior), eta = ior;
  if (in.specular_ior_level != 0.5f) {
    F0 *= 2.0f * max(in.specular_ior_level, 0.0f);
    eta = ior < 1.0f ? 1.0f / ior_of_F0(F0) : ior_of_F0(F0);
  }
  if (eta != 1.0f || film_nm > kLeastFilmNanometres) {
    if (MixtureLobe* lobe = reflection_add(b, weight, base_frame)) {
      lobe_set_microfacets(*lobe, spec, roughness, alpha);
      lobe->fresnel = dielectric_fresnel(b, spec, eta, film_nm, film_ior);
      lobe->fresnel.a = saturated(specular_tint * F0);
      if (lobe->fresnel.kind == MixtureFresnel::kDielectric) lobe->fresnel.kind = MixtureFresnel::kInterpolated;
      const Vec3f seen = mixture_fresnel(lobe->fresnel, lobe->wo.z);
      const bool has_film = film_nm > kLeastFilmNanometres;
      const float width = __builtin_sqrtf(__builtin_sqrtf(alpha.x * alpha.y));
      const float share = reflected_share(*b.tables, width, eta, lobe->wo.z);
      const Vec3f albedo = has_film ? seen : lerp(share, lobe->fresnel.a, Vec3f{1, 1, 1});
      lobe->probability *= mean_component(seen);
      const Vec3f F0s = lobe->fresnel.a;
      weight = layered_weight(weight, albedo * lobe_give_back(b, spec, *lobe, [&] {
                                        return saturated(fresnel_interpolated_mean(F0s, {1, 1, 1}, eta));
                                      }));
    }
  }
  const float below = saturated(in.subsurface_weight);
  if (below > kLeastClosureWeight) {
    Subsurface s;
    s.albedo = saturated(base_color);
    s.radius = max(in.subsurface_radius * in.subsurface_scale, Vec3f{});
    s.anisotropy = in.subsurface_anisotropy;
    s.entry_ior = spec.subsurface == SubsurfaceMethod::kSkin ? in.subsurface_ior : eta;
    subsurface_set_entry(s, spec, sqr(roughness));
    subsurface_add(b, spec, weight * s.albedo * below, N, s, MixtureLobeKind::kLambert);
    weight *= 1.0f - below;
  }
  const bool is_rough = in.diffuse_roughness > kLeastClosureWeight;
  MixtureLobe* lobe = mixture_add(b, weight * base_color, frame_from_normal(N_given), true);
  if (lobe == nullptr || !is_rough) return;
  lobe->kind = MixtureLobeKind::kOrenNayarMultiple;
  lobe->shape.oren_nayar_multiple = oren_nayar_multiple_make(saturated(base_color), in.diffuse_roughness, lobe->wo);
}

}  // namespace relief
