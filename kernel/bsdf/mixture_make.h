// Closures of a material, with their inputs at a point, as the lobes of a mixture. One function a kind of closure; each says
// what Cycles of Blender 3.4, with `is_4` that of 4.3, with `is_5` that of 5.2, makes of it.
//
// What scatters below the surface is a lobe by which paths enter, or, where they may not, a diffuse one.
#pragma once

#include "kernel/bsdf/closure_kinds.h"
#include "kernel/bsdf/microfacet_energy.h"
#include "kernel/bsdf/mixture.h"
#include "kernel/bsdf/surface_closure.h"
#include "kernel/bsdf/surface_params.h"
#include "kernel/math/lanes.h"

namespace relief {

/// Closures and lobes that weigh less are left out, as Cycles leaves them.
inline constexpr float kLeastClosureWeight = 1e-5f;

/// What closures are resolved for, and what they have come to so far.
struct MixtureBuild {
  Vec3f wo;  ///< unit, world
  Vec3f Ng;  ///< geometric normal on wo's side
  Vec3f Ns;  ///< shading normal on the side of Ng; wo may be below its horizon
  bool front;
  const BsdfTables* tables;
  MixtureLobes* lobes;
  Vec3f emission{};
  Vec3f transparency{};
  float holdout = 0;
  bool transmits = false;                 ///< some lobe sends light through the surface
  bool is_4 = false, is_5 = false;        ///< see MixtureLobe: of the closure that is added
  float blur = 0;                         ///< see path_blur; 0: none
  float most_sharp = -1;                  ///< perceptual roughness up to which lobes are not blurred
  bool reflects = true, refracts = true;  ///< there are microfacets that do so; see path_does_without
  bool enters = false;                    ///< paths may go below the surface
  bool is_after_diffuse = false;          ///< the path has been scattered diffusely before
  float footprint = 0;                    ///< metres
  Vec3f tangent{};                        ///< unit, along the curve that is met; 0: it is a triangle
};

RELIEF_KERNEL float mean_component(Vec3f v) { return (v.x + v.y + v.z) * (1.0f / 3.0f); }

/// A vector of a graph, which has Z up, in the scene's world.
RELIEF_KERNEL Vec3f world_from_z_up(Vec3f v) { return {v.x, v.z, -v.y}; }

/// A closure's normal as it is given.
/// @param given  Z up; 0: the surface's
RELIEF_KERNEL Vec3f closure_normal_as_given(const MixtureBuild& b, Vec3f given)
{
  const float squared = length_squared(given);
  if (!(squared > 0.0f && squared < kInfinity)) return b.Ns;
  return world_from_z_up(given) / __builtin_sqrtf(squared);
}

/// A closure's normal, by which wo is reflected above the true surface; on curves as it is given.
/// @param given  Z up; 0: the surface's
RELIEF_KERNEL Vec3f closure_normal(const MixtureBuild& b, Vec3f given)
{
  const Vec3f N = closure_normal_as_given(b, given);
  return is_zero(b.tangent) ? normal_with_reflection_above(b.Ng, N, b.wo) : N;
}

/// The same of a closure that does not mirror: since 4.0 Cycles leaves these as they are given.
RELIEF_KERNEL Vec3f closure_diffuse_normal(const MixtureBuild& b, const SurfaceClosureSpec& spec, Vec3f given)
{
  return spec.is_4 ? closure_normal_as_given(b, given) : closure_normal(b, given);
}

/// Frame about a normal whose x is turned from a tangent.
/// @param tangent  Z up, any length; 0: any direction
/// @param turns    about the normal, of the whole circle
RELIEF_KERNEL Frame closure_tangent_frame(Vec3f N, Vec3f tangent, float turns)
{
  const Vec3f T = world_from_z_up(tangent);
  const Vec3f across = cross(N, T);
  const float squared = length_squared(across);
  if (!(squared > 0.0f && squared < kInfinity)) return frame_from_normal(N);
  const Vec3f t = across / __builtin_sqrtf(squared);
  const Vec3f s = cross(t, N);
  if (turns == 0.0f) return {s, t, N};
  const SinCos turned = sin_cos_turn(turns);
  return {turned.cos * s + turned.sin * t, turned.cos * t - turned.sin * s, N};
}

/// Adds a lobe, unless it weighs nothing: Lambert's, which the caller may make another. It is sampled by its weight.
/// @param is_diffuse  it may be seen from below its own horizon, as if from just above
RELIEF_KERNEL MixtureLobe* mixture_add(MixtureBuild& b, Vec3f weight, const Frame& frame, bool is_diffuse = false)
{
  constexpr float kLeastCosine = 1e-3f;
  const Vec3f bounded = max(weight, Vec3f{});
  const float mean = mean_component(bounded);
  MixtureLobes& all = *b.lobes;
  Vec3f wo = to_local(frame, b.wo);
  if (is_diffuse) wo = normalize(Vec3f{wo.x, wo.y, max(wo.z, kLeastCosine)});
  if (!(mean > kLeastClosureWeight && mean < kInfinity && wo.z > kMinCosine && all.size < kMostMixtureLobes)) {
    return nullptr;
  }
  MixtureLobe& lobe = all.lobes[all.size++];
  lobe = {};
  lobe.weight = bounded;
  lobe.probability = mean;
  lobe.frame = frame;
  lobe.wo = wo;
  lobe.is_4 = b.is_4;
  lobe.is_5 = b.is_5;
  lobe.is_on_curve = !is_zero(b.tangent);
  lobe.is_bent = !(dot(frame.n, b.Ns) > 1.0f - 1e-6f) && !(lobe.is_on_curve && b.is_5);
  if (lobe.is_bent) lobe.surface_N = to_local(frame, b.Ns);
  return &lobe;
}

/// The same of microfacets that reflect.
RELIEF_KERNEL MixtureLobe* reflection_add(MixtureBuild& b, Vec3f weight, const Frame& frame)
{
  return b.reflects ? mixture_add(b, weight, frame) : nullptr;
}

/// Widens a lobe of microfacets to a least width. The energy that it has been given back stays that of before.
RELIEF_KERNEL void lobe_blur(MixtureLobe& lobe, float blur, float most_sharp)
{
  using K = MixtureLobeKind;
  if (lobe.stays_sharp || !(lobe.roughness < kInfinity) || lobe.roughness <= most_sharp) {
    if (lobe.kind == K::kFibre) {
      Fibre& fibre = lobe.shape.fibre;
      fibre.variance = max(fibre.variance, blur);
      fibre.variance_R = max(fibre.variance_R, blur);
      fibre.scale = max(fibre.scale, blur);
    }
    return;
  }
  const auto widen = [blur](AnisotropicAlpha& alpha) {
    alpha.x = max(alpha.x, blur);
    alpha.y = max(alpha.y, blur);
  };
  switch (lobe.kind) {
    case K::kGgx:
      widen(lobe.shape.ggx.alpha);
      break;
    case K::kBeckmann:
      widen(lobe.shape.beckmann.alpha);
      break;
    case K::kAshikhminShirley: {
      AnisotropicAlpha alpha = ashikhmin_shirley_alpha(lobe.shape.ashikhmin_shirley);
      widen(alpha);
      lobe.shape.ashikhmin_shirley = ashikhmin_shirley_make(alpha);
      break;
    }
    case K::kClearcoat:
      lobe.shape.clearcoat.alpha = max(lobe.shape.clearcoat.alpha, blur);
      break;
    case K::kRefraction:
      if (dielectric_is_matched(lobe.shape.refraction.eta)) return;
      lobe.shape.refraction.alpha = max(lobe.shape.refraction.alpha, blur);
      break;
    case K::kGlass:
      if (dielectric_is_matched(lobe.fresnel.eta)) return;
      lobe.shape.glass.alpha = max(lobe.shape.glass.alpha, blur);
      break;
    default:
      return;
  }
  lobe.roughness = max(lobe.roughness, __builtin_sqrtf(blur));
  lobe.is_delta = lobe.is_delta && blur < kDeltaAlpha;
}

/// Whether microfacets mirror to below their own normal, too, where it is bent: in Cycles before 5.0, but for what it follows
/// from facet to facet. Lamps are not asked for there.
RELIEF_KERNEL bool microfacets_mirror_below(const SurfaceClosureSpec& spec)
{
  return !spec.is_5 && (spec.is_4 || spec.distribution != ClosureDistribution::kMultiscatterGgx);
}

/// Makes a lobe one of reflection by microfacets.
/// @param roughness  perceptual: whether the lobe is sharp, and how wide ray cones become
/// @param alpha      of both directions, bounded
RELIEF_KERNEL void lobe_set_microfacets(MixtureLobe& lobe,
                                        const SurfaceClosureSpec& spec,
                                        float roughness,
                                        AnisotropicAlpha alpha)
{
  const SmithMasking masking = spec.is_4 ? SmithMasking::kCorrelated : SmithMasking::kSeparable;
  lobe.roughness = spec.distribution == ClosureDistribution::kSharp ? 0.0f : clamp(roughness, 0.0f, 1.0f);
  lobe.stays_sharp = spec.distribution == ClosureDistribution::kSharp;
  lobe.is_delta = lobe.stays_sharp || sqr(lobe.roughness) < kDeltaAlpha;
  lobe.mirrors_below = microfacets_mirror_below(spec);
  switch (spec.distribution) {
    case ClosureDistribution::kBeckmann:
      lobe.kind = MixtureLobeKind::kBeckmann;
      lobe.shape.beckmann = {alpha, masking};
      break;
    case ClosureDistribution::kAshikhminShirley:
      lobe.kind = MixtureLobeKind::kAshikhminShirley;
      lobe.mirrors_below = false;
      lobe.shape.ashikhmin_shirley = ashikhmin_shirley_make(alpha);
      break;
    default:
      lobe.kind = MixtureLobeKind::kGgx;
      // What the tables of lost light are for.
      const bool gives_back = spec.distribution == ClosureDistribution::kMultiscatterGgx;
      lobe.shape.ggx = {alpha, gives_back ? SmithMasking::kCorrelated : masking};
      break;
  }
}

/// Multiplies a lobe's weight, and its chance to be sampled.
RELIEF_KERNEL void lobe_scale(MixtureLobe& lobe, Vec3f by)
{
  lobe.weight *= by;
  lobe.probability *= mean_component(by);
}

/// Gives a reflection back what its microfacets would reflect more than once, if its distribution says so: since 4.0 in the same
/// directions, before nearly in all. May add a lobe.
/// @param F_mean  see ggx_energy_factor
/// @return        what the reflection is now as part of one that loses nothing to colour; 1 before 4.0
RELIEF_KERNEL Vec3f lobe_give_back(MixtureBuild& b, const SurfaceClosureSpec& spec, MixtureLobe& lobe, Vec3f F_mean)
{
  // Before 4.0 facets send light on as blurred ones.
  if (!spec.is_4) lobe_blur(lobe, b.blur, b.most_sharp);
  if (spec.distribution != ClosureDistribution::kMultiscatterGgx || lobe.is_delta) return {1, 1, 1};
  const AnisotropicAlpha alpha = lobe.shape.ggx.alpha;
  const float roughness = __builtin_sqrtf(__builtin_sqrtf(alpha.x * alpha.y));
  MixtureMultiple multiple;
  multiple.ggx = ggx_coordinate(min(roughness, 1.0f));
  const float lost = ggx_albedo(*b.tables, multiple.ggx, lobe.wo.z).lost;
  if (spec.is_4) {
    const Vec3f factor = ggx_energy_factor(*b.tables, EnergyModel::kTable, F_mean, roughness, lobe.wo.z);
    lobe_scale(lobe, factor);
    return factor * (1.0f - lost);
  }
  const float lost_mean = ggx_albedo_mean(*b.tables, multiple.ggx).lost;
  if (!(lost_mean > kLeastMeanLost && lost > 0.0f)) return {1, 1, 1};
  // The same energy as the factor's, spread.
  const Vec3f again = ggx_energy_factor(*b.tables, EnergyModel::kWalk, F_mean, roughness, lobe.wo.z) - splat3(1.0f);
  const Vec3f first = lobe.fresnel.kind == MixtureFresnel::kNone ? Vec3f{1, 1, 1} : F_mean;
  MixtureLobe* added = mixture_add(b, lobe.weight * first * again * ((1.0f - lost) / lost), lobe.frame);
  if (added == nullptr) return {1, 1, 1};
  multiple.scattering = multiple_scattering_make(multiple.ggx.alpha);
  multiple.over_mean = kInvPi * lost / lost_mean;
  added->kind = MixtureLobeKind::kMultiple;
  added->shape.multiple = multiple;
  added->probability *= lost;
  return {1, 1, 1};
}

RELIEF_KERNEL float saturated(float x) { return clamp(x, 0.0f, 1.0f); }
RELIEF_KERNEL Vec3f saturated(Vec3f c) { return {saturated(c.x), saturated(c.y), saturated(c.z)}; }

/// Roughness of microfacets. Up to 3.6 it is squared as it is given, so that negative ones count as positive ones.
RELIEF_KERNEL float closure_roughness(const SurfaceClosureSpec& spec, float given)
{
  return saturated(spec.is_4 ? given : __builtin_fabsf(given));
}

/// Index of refraction as wo meets it.
RELIEF_KERNEL float closure_eta(const MixtureBuild& b, float ior)
{
  const float bounded = max(ior, 1e-5f);
  return b.front ? bounded : 1.0f / bounded;
}

RELIEF_KERNEL void closure_add(MixtureBuild& b, const SurfaceClosureSpec& spec, float weight, const DiffuseInputs& in)
{
  const Frame frame = frame_from_normal(closure_diffuse_normal(b, spec, in.normal));
  MixtureLobe* lobe = mixture_add(b, weight * in.color, frame, true);
  if (lobe == nullptr || !(in.roughness > 0.0f)) return;
  if (spec.is_4) {
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
  MixtureLobe* lobe = strand_add(b, weight * in.color, in.tangent, MixtureLobeKind::kHair);
  if (lobe == nullptr) return;
  b.transmits |= spec.is_other;
  const bool is_strand = !is_zero(b.tangent) || !is_zero(in.tangent);
  lobe->shape.hair = hair_make(in.roughness_u, in.roughness_v, is_strand ? -in.offset : 0.0f, spec.is_other);
}

RELIEF_KERNEL void closure_add(MixtureBuild& b, const SurfaceClosureSpec& spec, float weight, const FibreInputs& in)
{
  MixtureLobe* lobe = strand_add(b, splat3(weight), {}, MixtureLobeKind::kFibre);
  if (lobe == nullptr) return;
  b.transmits = true;
  const float vary = 2.0f * (in.random - 0.5f);
  const float rougher = 1.0f + vary * in.random_roughness;
  const float roughness = clamp(in.roughness * rougher, 0.001f, 1.0f), radial = in.radial_roughness * rougher;
  Fibre fibre;
  switch (spec.pigment) {
    case FibrePigment::kColor:
      fibre.sigma = fibre_sigma_of_color(in.color, radial);
      break;
    case FibrePigment::kMelanin: {
      const float share = in.melanin * (1.0f + vary * saturated(in.random_color));
      const float amount = -std::log(max(1.0f - share, 1e-4f));
      fibre.sigma = fibre_sigma_of_melanin(amount * (1.0f - in.melanin_redness), amount * in.melanin_redness) +
                    fibre_sigma_of_color(in.tint, radial);
      break;
    }
    case FibrePigment::kAbsorption:
      fibre.sigma = in.absorption;
      break;
  }
  fibre.sigma = max(fibre.sigma, Vec3f{});
  fibre.variance = fibre_variance(roughness);
  fibre.variance_R = fibre_variance((1.0f - saturated(in.coat)) * roughness);
  fibre.scale = fibre_scale(radial);
  fibre.tilt = in.offset;
  fibre.eta = max(in.ior, 1.001f);
  fibre.across = clamp(dot(lobe->frame.t, b.Ns), -1.0f, 1.0f);
  lobe->shape.fibre = fibre;
}

/// Whether a path may go below the surface. Before 5.0 Cycles left it at a diffuse surface after a diffuse event: it is not seen well
/// then, and noisy.
RELIEF_KERNEL bool subsurface_enters(const MixtureBuild& b, const SurfaceClosureSpec& spec)
{
  return b.enters && (spec.is_5 || !b.is_after_diffuse);
}

/// How paths enter since 4.0.
RELIEF_KERNEL void subsurface_set_entry(Subsurface& s, const SurfaceClosureSpec& spec, float alpha)
{
  const bool is_skin = spec.subsurface == SubsurfaceMethod::kSkin;
  s.entry = is_skin ? SubsurfaceEntry::kEither : SubsurfaceEntry::kRefracted;
  s.entry_alpha = is_skin ? 1.0f : alpha;
}

/// Adds what scatters below the surface: the lobe by which paths enter, and a diffuse one for channels whose radius is none.
/// @param weight   with the colour
/// @param s        its radii as they are given
/// @param diffuse  kind of the lobe of what does not enter; `principled` if it has one
/// @source  Cycles 3.4 and 4.3
RELIEF_KERNEL void subsurface_add(MixtureBuild& b,
                                  const SurfaceClosureSpec& spec,
                                  Vec3f weight,
                                  Vec3f N,
                                  Subsurface s,
                                  MixtureLobeKind diffuse,
                                  PrincipledDiffuse principled = {})
{
  float least = kInfinity;
  if (subsurface_enters(b, spec)) {
    // From 4.0 on, before 5.0, what is smaller than a quarter of a pixel was not worth a walk.
    least = max(kLeastSubsurfaceRadius, spec.is_4 && !spec.is_5 ? 0.25f * b.footprint : 0.0f);
  }
  const bool is_walk = spec.subsurface == SubsurfaceMethod::kRandomWalk;
  s.anisotropy = clamp(s.anisotropy, spec.is_5 ? -0.99f : 0.0f, is_walk ? 0.99f : 0.9f);
  s.is_similar = is_walk || s.anisotropy < 0.0f;
  s.entry_ior = clamp(s.entry_ior, 1.01f, 3.8f);
  const auto free_path = [&](float radius, float albedo) {
    if (is_walk) return radius;
    if (spec.subsurface == SubsurfaceMethod::kLegacy) return radius * (0.25f * kInvPi);
    return subsurface_free_path(radius, albedo, s.entry_ior);
  };
  Vec3f around = weight;
  int channels = 0;
  const auto axis = [&](float albedo, float& radius, float& kept, float& going) {
    if (radius >= least) {
      kept = 0.0f;
      ++channels;
      radius = free_path(radius, albedo);
    } else {
      going = radius = 0.0f;
    }
  };
  Vec3f entering = weight;
  axis(s.albedo.x, s.radius.x, around.x, entering.x);
  axis(s.albedo.y, s.radius.y, around.y, entering.y);
  axis(s.albedo.z, s.radius.z, around.z, entering.z);
  const Frame frame = frame_from_normal(N);
  if (MixtureLobe* lobe = mixture_add(b, around, frame, true)) {
    lobe->kind = diffuse;
    if (diffuse == MixtureLobeKind::kPrincipledDiffuse) lobe->shape.principled_diffuse = principled;
  }
  MixtureLobe* lobe = mixture_add(b, entering, frame, true);
  if (lobe == nullptr) return;
  lobe->kind = MixtureLobeKind::kSubsurface;
  lobe->is_delta = true;
  lobe->probability *= static_cast<float>(channels);
  lobe->shape.subsurface = s;
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
  if (spec.is_4) subsurface_set_entry(s, spec, saturated(in.roughness));
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
  lobe_give_back(b, spec, *lobe, saturated(in.color));
}

/// Refraction by microfacets, without what they reflect.
/// @param roughness  as it is given: all versions square it so
RELIEF_KERNEL void refraction_add(MixtureBuild& b,
                                  const SurfaceClosureSpec& spec,
                                  Vec3f weight,
                                  Vec3f N,
                                  float roughness,
                                  float eta)
{
  MixtureLobe* lobe = b.refracts ? mixture_add(b, weight, frame_from_normal(N)) : nullptr;
  if (lobe == nullptr) return;
  lobe->kind = MixtureLobeKind::kRefraction;
  lobe->roughness = spec.distribution == ClosureDistribution::kSharp ? 0.0f : saturated(__builtin_fabsf(roughness));
  const float alpha = sqr(lobe->roughness);
  lobe->stays_sharp = spec.distribution == ClosureDistribution::kSharp;
  lobe->is_delta = lobe->stays_sharp || alpha < kDeltaAlpha || dielectric_is_matched(eta);
  lobe->shape.refraction = {alpha, eta, spec.distribution == ClosureDistribution::kBeckmann,
                            spec.is_4 ? SmithMasking::kCorrelated : SmithMasking::kSeparable, false};
  b.transmits = true;
}

RELIEF_KERNEL void closure_add(MixtureBuild& b,
                               const SurfaceClosureSpec& spec,
                               float weight,
                               const RefractionInputs& in)
{
  refraction_add(b, spec, weight * in.color, closure_normal(b, in.normal), in.roughness, closure_eta(b, in.ior));
}

/// Glass whose microfacets choose between reflection and refraction.
/// @param fresnel  its eta is the surface's
RELIEF_KERNEL void glass_add(MixtureBuild& b,
                             const SurfaceClosureSpec& spec,
                             float weight,
                             Vec3f N,
                             float roughness,
                             const MicrofacetFresnel& fresnel,
                             Vec3f reflection_tint,
                             Vec3f transmission_tint)
{
  if (!b.reflects && !b.refracts) return;
  // Up to 3.6 such glass has both or nothing.
  if (spec.is_4 && !b.reflects) reflection_tint = {};
  if (spec.is_4 && !b.refracts) transmission_tint = {};
  MixtureLobe* lobe = mixture_add(b, splat3(weight), frame_from_normal(N));
  if (lobe == nullptr) return;
  lobe->kind = MixtureLobeKind::kGlass;
  lobe->mirrors_below = microfacets_mirror_below(spec);
  lobe->roughness = spec.distribution == ClosureDistribution::kSharp ? 0.0f : closure_roughness(spec, roughness);
  const float alpha = sqr(lobe->roughness);
  lobe->fresnel = fresnel;
  lobe->stays_sharp = spec.distribution == ClosureDistribution::kSharp;
  lobe->is_delta = lobe->stays_sharp || alpha < kDeltaAlpha || dielectric_is_matched(fresnel.eta);
  lobe->shape.glass = {alpha, spec.distribution == ClosureDistribution::kBeckmann, reflection_tint, transmission_tint};
  if (!spec.is_4) lobe_blur(*lobe, b.blur, b.most_sharp);
  if (spec.distribution == ClosureDistribution::kMultiscatterGgx && !lobe->is_delta) {
    const GlassCoordinate at = glass_coordinate(fresnel.eta, lobe->roughness);
    const float lost = glass_lost(*b.tables, at, at.side, lobe->wo.z);
    const float lost_mean = glass_lost_mean(*b.tables, at, at.side);
    const bool mirrors = spec.is_4 && is_zero(transmission_tint);
    const Vec3f F_mean =
        mirrors ? reflection_tint * fresnel_interpolated_mean(fresnel.a, {1, 1, 1}, fresnel.eta) : transmission_tint;
    lobe_scale(*lobe, microfacet_energy_factor(saturated(F_mean), max(1.0f - lost, 1e-3f), 1.0f - lost_mean));
  }
  lobe->probability = weight * mean_component(max(reflection_tint, transmission_tint));
  b.transmits = true;
}

/// Thinner films are none.
inline constexpr float kLeastFilmNanometres = 0.1f;

/// A dielectric's microfacets.
RELIEF_KERNEL MicrofacetFresnel dielectric_fresnel(float eta)
{
  MicrofacetFresnel f;
  f.kind = MixtureFresnel::kDielectric;
  f.eta = eta;
  f.a = splat3(fresnel_F0(eta));
  return f;
}

/// The same under a film, where there is one.
RELIEF_KERNEL MicrofacetFresnel
dielectric_fresnel(const MixtureBuild& b, const SurfaceClosureSpec& spec, float eta, float film_nm, float film_ior)
{
  MicrofacetFresnel f = dielectric_fresnel(eta);
  if (!(film_nm > kLeastFilmNanometres)) return f;
  f.kind = spec.is_5 ? MixtureFresnel::kFilmOnDielectric : MixtureFresnel::kThinFilm;
  f.film_nm = film_nm;
  f.film_ior = film_ior;
  f.film_table = &b.tables->thin_film;
  return f;
}

/// Puts a film over a metal, where there is one; up to 4.x there is none.
RELIEF_KERNEL void metal_add_film(const MixtureBuild& b,
                                  const SurfaceClosureSpec& spec,
                                  float film_nm,
                                  float film_ior,
                                  MicrofacetFresnel& f)
{
  if (!spec.is_5 || !(film_nm > kLeastFilmNanometres)) return;
  f.kind = f.kind == MixtureFresnel::kF82 ? MixtureFresnel::kFilmOnF82 : MixtureFresnel::kFilmOnConductor;
  f.film_nm = film_nm;
  f.film_ior = max(film_ior, 1e-5f);
  f.film_table = &b.tables->thin_film;
}

RELIEF_KERNEL void closure_add(MixtureBuild& b, const SurfaceClosureSpec& spec, float weight, const GlassInputs& in)
{
  const Vec3f N = closure_normal(b, in.normal);
  const float eta = closure_eta(b, in.ior);
  const Vec3f color = max(in.color, Vec3f{});
  if (spec.is_4 || spec.distribution == ClosureDistribution::kMultiscatterGgx) {
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
  if (spec.is_other) {
    const Vec3f n = max(in.ior, Vec3f{}), k = max(in.extinction, Vec3f{});
    lobe->fresnel = {spec.is_5 ? MixtureFresnel::kConductorExact : MixtureFresnel::kConductor, 1.0f, n, k, 1.0f, 0.0f};
    const FresnelF82 f = spec.is_5 ? fresnel_f82_through(mixture_fresnel(lobe->fresnel, 1.0f),
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
  lobe_give_back(b, spec, *lobe, F_mean);
}

RELIEF_KERNEL void closure_add(MixtureBuild& b, const SurfaceClosureSpec& spec, float weight, const VelvetInputs& in)
{
  const Frame frame = frame_from_normal(closure_diffuse_normal(b, spec, in.normal));
  MixtureLobe* lobe = mixture_add(b, weight * in.color, frame, true);
  if (lobe == nullptr) return;
  lobe->kind = MixtureLobeKind::kVelvet;
  lobe->shape.velvet = velvet_make(saturated(in.sigma));
}

/// @return  albedo before the weight; 0: none was added
RELIEF_KERNEL float microfibre_add(MixtureBuild& b, Vec3f weight, Vec3f N, float roughness)
{
  MixtureLobe* lobe = mixture_add(b, weight, frame_from_normal(N), true);
  if (lobe == nullptr) return 0.0f;
  lobe->kind = MixtureLobeKind::kMicrofibre;
  lobe->shape.microfibre = sheen_microfibre_make(lobe->wo.z, roughness);
  const float albedo = lobe->shape.microfibre.albedo;
  lobe->probability *= albedo;
  if (!(albedo > 0.0f)) --b.lobes->size;
  return albedo;
}

RELIEF_KERNEL void closure_add(MixtureBuild& b, const SurfaceClosureSpec&, float weight, const SheenInputs& in)
{
  microfibre_add(b, weight * in.color, closure_normal_as_given(b, in.normal), saturated(in.roughness));
}

RELIEF_KERNEL void closure_add(MixtureBuild& b, const SurfaceClosureSpec& spec, float weight, const ToonInputs& in)
{
  const Toon toon = toon_make(in.size, in.smooth, spec.is_other);
  if (toon_is_empty(toon) || (toon.is_glossy && !b.reflects)) return;
  const Frame frame = frame_from_normal(closure_diffuse_normal(b, spec, in.normal));
  MixtureLobe* lobe = mixture_add(b, weight * in.color, frame, true);
  if (lobe == nullptr) return;
  lobe->kind = MixtureLobeKind::kToon;
  lobe->shape.toon = toon;
}

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
  lobe_give_back(b, own, *lobe, saturated(fresnel_interpolated_mean(F0, {1, 1, 1}, eta)));
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
    MixtureLobe* lobe = mixture_add(b, diffuse, frame_from_normal(N));
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

/// What a layer leaves for those below.
RELIEF_KERNEL Vec3f layered_weight(Vec3f weight, Vec3f albedo)
{
  return weight * clamp(1.0f - max_component(albedo), 0.0f, 1.0f);
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
  const float coat = max(in.coat_weight, 0.0f), coat_ior = max(in.coat_ior, 1.0f), ior = max(in.ior, 1e-5f);
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
  if (coat > kLeastClosureWeight) {
    MixtureLobe* lobe = reflection_add(b, weight * coat, frame_from_normal(coat_N));
    if (lobe != nullptr) {
      // Since 5.0 what its facets reflect more than once is given back, and it takes from below what it reflects; before it took
      // what a smooth one reflects.
      SurfaceClosureSpec own = spec;
      own.distribution = spec.is_5 ? ClosureDistribution::kMultiscatterGgx : ClosureDistribution::kGgx;
      const float coat_roughness = saturated(in.coat_roughness);
      lobe_set_microfacets(*lobe, own, coat_roughness, anisotropic_alpha_of_glossy(coat_roughness, 0.0f));
      lobe->fresnel = dielectric_fresnel(coat_ior);
      const float F =
          spec.is_5 && coat_ior > 1.0f
              ? lerp(reflected_share(*b.tables, coat_roughness, coat_ior, lobe->wo.z), fresnel_F0(coat_ior), 1.0f)
              : fresnel_dielectric_at(lobe->wo.z, coat_ior);
      lobe->probability *= F;
      const Vec3f given_back = lobe_give_back(b, own, *lobe, splat3(fresnel_dielectric_mean(coat_ior)));
      weight = layered_weight(weight, given_back * (coat * F));
    }
    if (in.coat_tint != Vec3f{1, 1, 1}) {
      // Beer's law along the refracted ray, a coat of thickness 1.
      const float cos_o = saturated(dot(coat_N, b.wo));
      const float depth = 1.0f / __builtin_sqrtf(1.0f - (1.0f - sqr(cos_o)) / sqr(coat_ior));
      const auto absorbed = [&](float c) { return lerp(coat, 1.0f, std::pow(max(c, 0.0f), depth)); };
      weight *= max(Vec3f{}, {absorbed(in.coat_tint.x), absorbed(in.coat_tint.y), absorbed(in.coat_tint.z)});
    }
  }
  const Frame base_frame = closure_tangent_frame(N, in.tangent, in.anisotropic_rotation);
  const AnisotropicAlpha alpha = anisotropic_alpha_of_principled(roughness, saturated(in.anisotropic));
  if (metallic > kLeastClosureWeight) {
    if (MixtureLobe* lobe = reflection_add(b, weight * metallic, base_frame)) {
      lobe_set_microfacets(*lobe, spec, roughness, alpha);
      const FresnelF82 f = fresnel_f82_make(saturated(base_color), min(specular_tint, splat3(1.0f)));
      lobe->fresnel = {MixtureFresnel::kF82, 1.0f, f.F0, f.B, 1.0f, 0.0f};
      metal_add_film(b, spec, in.thin_film_thickness, in.thin_film_ior, lobe->fresnel);
      lobe->probability *= mean_component(mixture_fresnel(lobe->fresnel, lobe->wo.z));
      lobe_give_back(b, spec, *lobe, fresnel_f82_mean(f));
    }
    weight *= 1.0f - metallic;
  }
  const float transmission = saturated(in.transmission_weight);
  const float film_nm = max(in.thin_film_thickness, 0.0f), film_ior = max(in.thin_film_ior, 1e-5f);
  if (transmission > kLeastClosureWeight) {
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
      const Vec3f F_mean = saturated(fresnel_interpolated_mean(lobe->fresnel.a, {1, 1, 1}, eta));
      weight = layered_weight(weight, albedo * lobe_give_back(b, spec, *lobe, F_mean));
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
