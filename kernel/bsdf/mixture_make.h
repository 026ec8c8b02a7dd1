// Closures of a material, with their inputs at a point, as the lobes of a mixture. One function a kind of closure; each says
// what Cycles makes of it in the version of its maths.
//
// What scatters below the surface is a lobe by which paths enter, or, where they may not, a diffuse one.
#pragma once

#include "kernel/bsdf/mixture_build.h"
#include "kernel/bsdf/principled3.h"
#include "kernel/bsdf/principled4.h"

namespace relief {

RELIEF_KERNEL void closure_add(MixtureBuild& b, const SurfaceClosureSpec& spec, float weight, const DiffuseInputs& in)
{
  const Frame frame = frame_from_normal(closure_diffuse_normal(b, spec, in.normal));
  MixtureLobe* lobe = mixture_add(b, weight * in.color, frame, true);
  if (lobe == nullptr || !(in.roughness > 0.0f)) return;
  if (spec.maths >= Maths::k43) {
    lobe->kind = MixtureLobeKind::kOrenNayarMultiple;
    lobe->shape.oren_nayar_multiple = oren_nayar_multiple_make(saturated(in.color), in.roughness, lobe->wo);
  } else {
    lobe->kind = MixtureLobeKind::kOrenNayar;
    lobe->shape.oren_nayar = oren_nayar_make(in.roughness);
  }
}

/// Adds a lobe of a strand.
/// @param tangent  Z up; 0: the curve's
RELIEF_KERNEL MixtureLobe* strand_add(MixtureBuild& b, Vec3f weight, Vec3f tangent, MixtureLobeKind kind)
{
  const float squared = length_squared(tangent);
  const bool is_given = squared > 0.0f && squared < kInfinity;
  const Vec3f T = is_given             ? world_from_z_up(tangent) / __builtin_sqrtf(squared)
                  : is_zero(b.tangent) ? frame_from_normal(b.Ns).t
                                       : b.tangent;
  const Vec3f across = b.wo - T * dot(T, b.wo);
  const float size = length(across);
  const Vec3f n = size > 0.0f ? across / size : frame_from_normal(T).s;
  MixtureLobe* lobe = mixture_add(b, weight, {T, cross(n, T), n}, true);
  if (lobe == nullptr) return nullptr;
  lobe->kind = kind;
  lobe->is_bent = false;
  return lobe;
}

RELIEF_KERNEL void closure_add(MixtureBuild& b, const SurfaceClosureSpec& spec, float weight, const HairInputs& in)
{
  const bool goes_through = spec.variant == ClosureVariant::kHairThrough;
  MixtureLobe* lobe = strand_add(b, weight * in.color, in.tangent,
                                 goes_through ? MixtureLobeKind::kHairThrough : MixtureLobeKind::kHair);
  if (lobe == nullptr) return;
  b.transmits |= goes_through;
  const bool is_strand = !is_zero(b.tangent) || !is_zero(in.tangent);
  const Hair hair = hair_make(in.roughness_u, in.roughness_v, is_strand ? -in.offset : 0.0f, goes_through);
  if (goes_through) {
    lobe->shape.hair_through = {hair};
  } else {
    lobe->shape.hair = hair;
  }
}

/// How much the random number of a strand varies what is its own, from -1 to 1.
RELIEF_KERNEL float fibre_variation(float random) { return 2.0f * (random - 0.5f); }

/// Absorption of a fibre by what says so.
/// @param radial  roughness by which colours were chosen
template <typename Inputs>
RELIEF_KERNEL Vec3f fibre_sigma(const SurfaceClosureSpec& spec, const Inputs& in, float radial)
{
  Vec3f sigma = in.absorption;
  if (spec.pigment == FibrePigment::kColor) sigma = fibre_sigma_of_color(in.color, radial);
  if (spec.pigment == FibrePigment::kMelanin) {
    const float share = in.melanin * (1.0f + fibre_variation(in.random) * saturated(in.random_color));
    const float amount = -std::log(max(1.0f - share, 1e-4f));
    sigma = fibre_sigma_of_melanin(amount * (1.0f - in.melanin_redness), amount * in.melanin_redness) +
            fibre_sigma_of_color(in.tint, radial);
  }
  return max(sigma, Vec3f{});
}

RELIEF_KERNEL void closure_add(MixtureBuild& b, const SurfaceClosureSpec& spec, float weight, const FibreInputs& in)
{
  MixtureLobe* lobe = strand_add(b, splat3(weight), {}, MixtureLobeKind::kFibre);
  if (lobe == nullptr) return;
  b.transmits = true;
  const float rougher = 1.0f + fibre_variation(in.random) * in.random_roughness;
  const float roughness = clamp(in.roughness * rougher, 0.001f, 1.0f), radial = in.radial_roughness * rougher;
  Fibre fibre;
  fibre.sigma = fibre_sigma(spec, in, radial);
  fibre.variance = fibre_variance(roughness);
  fibre.variance_R = fibre_variance((1.0f - saturated(in.coat)) * roughness);
  fibre.scale = fibre_scale(radial);
  fibre.tilt = in.offset;
  fibre.eta = max(in.ior, 1.001f);
  fibre.across = clamp(dot(lobe->frame.t, b.Ns), -1.0f, 1.0f);
  lobe->shape.fibre = fibre;
}

RELIEF_KERNEL void closure_add(MixtureBuild& b,
                               const SurfaceClosureSpec& spec,
                               float weight,
                               const FacetFibreInputs& in)
{
  MixtureLobe* lobe = strand_add(b, splat3(weight), {}, MixtureLobeKind::kFacetFibre);
  if (lobe == nullptr) return;
  b.transmits = true;
  FacetFibre fibre;
  const float roughness = in.roughness * (1.0f + fibre_variation(in.random) * in.random_roughness);
  fibre.sigma = fibre_sigma(spec, in, roughness);
  fibre.alpha = clamp(roughness, 0.001f, 1.0f);
  fibre.tilt = clamp(-in.offset, -1.5f, 1.5f);
  lobe->fresnel.eta = max(in.ior, 1.001f);
  // As in Cycles the axis that is given stays the larger one.
  const float aspect = clamp(__builtin_fabsf(in.aspect), 0.01f, 100.0f);
  fibre.aspect = min(aspect, 1.0f / aspect);
  if (fibre.aspect < 1.0f && lobe->is_on_curve) {
    const Vec3f given = to_local(lobe->frame, world_from_z_up(in.normal));
    fibre.turn = std::atan2(given.z, -given.y);
  }
  // Of a strand that is wider than a pixel the camera sees a part; of others all of it, wherever the ray has met them.
  const float across = clamp(dot(lobe->frame.t, b.Ns), -1.0f, 1.0f);
  const float half_width = b.strand_radius > 0.0f ? 0.5f * b.footprint / b.strand_radius : kInfinity;
  const float radius = ellipse_radius(fibre.aspect, fibre.turn);
  if (half_width < radius) {
    fibre.low = clamp((across - half_width) / radius, -1.0f, 0.998f);
    fibre.high = clamp((across + half_width) / radius, fibre.low + 1e-3f, 1.0f);
  }
  const float gains[] = {in.gain_R, in.gain_TT, in.gain_TRT};
  for (int i = 0; i < 3; ++i) fibre.gains[i] = half_from_float(clamp(gains[i], 0.0f, 1e4f));
  fibre.seed = static_cast<std::uint16_t>(__builtin_bit_cast(std::uint32_t, across) >> 4);
  lobe->shape.facet_fibre = fibre;
}

RELIEF_KERNEL void closure_add(MixtureBuild& b,
                               const SurfaceClosureSpec& spec,
                               float weight,
                               const SubsurfaceInputs& in)
{
  Subsurface s;
  s.albedo = max(in.color, Vec3f{});
  s.radius = max(in.radius * in.scale, Vec3f{});
  s.anisotropy = in.anisotropy;
  s.entry_ior = in.ior;
  if (spec.maths >= Maths::k43) subsurface_set_entry(s, spec, saturated(in.roughness));
  subsurface_add(b, spec, weight * s.albedo, closure_normal(b, in.normal), s, MixtureLobeKind::kLambert);
}

RELIEF_KERNEL void closure_add(MixtureBuild& b, const SurfaceClosureSpec&, float weight, const TranslucentInputs& in)
{
  MixtureLobe* lobe = mixture_add(b, weight * in.color, frame_from_normal(closure_normal(b, in.normal)));
  if (lobe == nullptr) return;
  lobe->kind = MixtureLobeKind::kTranslucent;
  b.transmits = true;
}

RELIEF_KERNEL void closure_add(MixtureBuild& b, const SurfaceClosureSpec&, float weight, const TransparentInputs& in)
{
  b.transparency += weight * max(in.color, Vec3f{});
}

RELIEF_KERNEL void closure_add(MixtureBuild& b, const SurfaceClosureSpec&, float weight, const EmissionInputs& in)
{
  const Vec3f radiance = in.color * (weight * in.strength);
  if (is_finite(radiance)) b.emission += radiance;
}

RELIEF_KERNEL void closure_add(MixtureBuild& b, const SurfaceClosureSpec&, float weight, const HoldoutInputs&)
{
  b.holdout += weight;
}

RELIEF_KERNEL void closure_add(MixtureBuild& b, const SurfaceClosureSpec& spec, float weight, const GlossyInputs& in)
{
  const Vec3f N = closure_normal(b, in.normal);
  MixtureLobe* lobe = reflection_add(b, weight * in.color, closure_tangent_frame(N, in.tangent, in.rotation));
  if (lobe == nullptr) return;
  const float roughness = closure_roughness(spec, in.roughness);
  lobe_set_microfacets(*lobe, spec, roughness, anisotropic_alpha_of_glossy(roughness, in.anisotropy));
  lobe_give_back(b, spec, *lobe, [&] { return saturated(in.color); });
}

RELIEF_KERNEL void closure_add(MixtureBuild& b,
                               const SurfaceClosureSpec& spec,
                               float weight,
                               const RefractionInputs& in)
{
  refraction_add(b, spec, weight * in.color, closure_normal(b, in.normal), in.roughness, closure_eta(b, in.ior));
}

RELIEF_KERNEL void closure_add(MixtureBuild& b, const SurfaceClosureSpec& spec, float weight, const GlassInputs& in)
{
  const Vec3f N = closure_normal(b, in.normal);
  const float eta = closure_eta(b, in.ior);
  const Vec3f color = max(in.color, Vec3f{});
  if (spec.maths >= Maths::k43 || spec.distribution == ClosureDistribution::kMultiscatterGgx) {
    const float film_ior = b.front ? in.thin_film_ior : in.thin_film_ior / max(in.ior, 1e-5f);
    glass_add(b, spec, weight, N, in.roughness, dielectric_fresnel(b, spec, eta, in.thin_film_thickness, film_ior),
              color, color);
    return;
  }
  // Up to 3.6 the surface's own normal decides how much is reflected, whatever its microfacets are.
  const float F = fresnel_dielectric_at(saturated(dot(N, b.wo)), eta);
  if (MixtureLobe* lobe = reflection_add(b, color * (weight * F), frame_from_normal(N))) {
    const float roughness = closure_roughness(spec, in.roughness);
    lobe_set_microfacets(*lobe, spec, roughness, anisotropic_alpha_of_glossy(roughness, 0.0f));
  }
  refraction_add(b, spec, color * (weight * (1.0f - F)), N, in.roughness, eta);
}

RELIEF_KERNEL void closure_add(MixtureBuild& b, const SurfaceClosureSpec& spec, float weight, const MetallicInputs& in)
{
  const Vec3f N = closure_normal(b, in.normal);
  MixtureLobe* lobe = reflection_add(b, splat3(weight), closure_tangent_frame(N, in.tangent, in.rotation));
  if (lobe == nullptr) return;
  const float roughness = saturated(in.roughness);
  lobe_set_microfacets(*lobe, spec, roughness, anisotropic_alpha_of_principled(roughness, saturated(in.anisotropy)));
  Vec3f F_mean;
  if (spec.variant == ClosureVariant::kPhysicalMetal) {
    const Vec3f n = max(in.ior, Vec3f{}), k = max(in.extinction, Vec3f{});
    lobe->fresnel = {spec.maths >= Maths::k52 ? MixtureFresnel::kConductorExact : MixtureFresnel::kConductor,
                     1.0f,
                     n,
                     k,
                     1.0f,
                     0.0f};
    const FresnelF82 f = spec.maths >= Maths::k52 ? fresnel_f82_through(mixture_fresnel(lobe->fresnel, 1.0f),
                                                                        mixture_fresnel(lobe->fresnel, 1.0f / 7.0f))
                                                  : fresnel_f82_of_conductor(n, k);
    F_mean = saturated(fresnel_f82_mean(f));
  } else {
    const FresnelF82 f = fresnel_f82_make(saturated(in.base_color), saturated(in.edge_tint));
    lobe->fresnel = {MixtureFresnel::kF82, 1.0f, f.F0, f.B, 1.0f, 0.0f};
    F_mean = fresnel_f82_mean(f);
  }
  metal_add_film(b, spec, in.thin_film_thickness, in.thin_film_ior, lobe->fresnel);
  lobe->probability *= mean_component(mixture_fresnel(lobe->fresnel, lobe->wo.z));
  lobe_give_back(b, spec, *lobe, [&] { return F_mean; });
}

RELIEF_KERNEL void closure_add(MixtureBuild& b, const SurfaceClosureSpec& spec, float weight, const VelvetInputs& in)
{
  const Frame frame = frame_from_normal(closure_diffuse_normal(b, spec, in.normal));
  MixtureLobe* lobe = mixture_add(b, weight * in.color, frame, true);
  if (lobe == nullptr) return;
  lobe->kind = MixtureLobeKind::kVelvet;
  lobe->shape.velvet = velvet_make(saturated(in.sigma));
}

RELIEF_KERNEL void closure_add(MixtureBuild& b, const SurfaceClosureSpec&, float weight, const SheenInputs& in)
{
  microfibre_add(b, weight * in.color, closure_normal_as_given(b, in.normal), saturated(in.roughness));
}

RELIEF_KERNEL void closure_add(MixtureBuild& b, const SurfaceClosureSpec& spec, float weight, const ToonInputs& in)
{
  const Toon toon = toon_make(in.size, in.smooth, spec.variant == ClosureVariant::kGlossyToon);
  if (toon_is_empty(toon) || (toon.is_glossy && !b.reflects)) return;
  const Frame frame = frame_from_normal(closure_diffuse_normal(b, spec, in.normal));
  MixtureLobe* lobe = mixture_add(b, weight * in.color, frame, true);
  if (lobe == nullptr) return;
  if (toon.is_glossy) {
    lobe->kind = MixtureLobeKind::kGlossyToon;
    lobe->shape.glossy_toon = {toon};
  } else {
    lobe->kind = MixtureLobeKind::kToon;
    lobe->shape.toon = toon;
  }
}

}  // namespace relief
