// What closures are resolved with: how they get their normals, and the lobes that several of them add. The closures are in
// mixture_make.h.
#pragma once

#include <new>

#include "kernel/bsdf/closure_kinds.h"
#include "kernel/bsdf/microfacet_energy.h"
#include "kernel/bsdf/mixture.h"
#include "kernel/bsdf/surface_params.h"

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
  Maths maths = Maths::k34;               ///< of the closure that is added
  float blur = 0;                         ///< see path_blur; 0: none
  float most_sharp = -1;                  ///< perceptual roughness up to which lobes are not blurred
  bool reflects = true, refracts = true;  ///< there are microfacets that do so; see path_does_without
  bool enters = false;                    ///< paths may go below the surface
  bool is_after_diffuse = false;          ///< the path has been scattered diffusely before
  float footprint = 0;                    ///< metres
  Vec3f tangent{};                        ///< unit, along the curve that is met; 0: it is a triangle
  float strand_radius = 0;                ///< metres, of the curve that the camera sees itself; 0: it is none
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
  return spec.maths >= Maths::k43 ? closure_normal_as_given(b, given) : closure_normal(b, given);
}

/// Frame about a normal whose x is turned from a tangent.
/// @param tangent  Z up, any length; 0: any direction
/// @param turns    about the normal, of the whole circle
RELIEF_KERNEL Frame closure_tangent_frame(Vec3f N, Vec3f tangent, float turns)
{
  if (is_zero(tangent)) return frame_from_normal(N);
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

/// Cosine between a lobe's normal and the surface's, above which it is that: 1 but for rounding.
inline constexpr float kUnbentLobe = 1.0f - 1e-6f;

/// Diffuse lobes are seen from at least this far above their horizon.
inline constexpr float kLeastDiffuseCosine = 1e-3f;

/// Adds a lobe, unless it weighs nothing: Lambert's, which the caller may make another. It is sampled by its weight.
/// @param is_diffuse  it may be seen from below its own horizon, as if from just above
RELIEF_KERNEL MixtureLobe* mixture_add(MixtureBuild& b, Vec3f weight, const Frame& frame, bool is_diffuse = false)
{
  const Vec3f bounded = max(weight, Vec3f{});
  const float mean = mean_component(bounded);
  MixtureLobes& all = *b.lobes;
  Vec3f wo = to_local(frame, b.wo);
  if (is_diffuse) wo = normalize(Vec3f{wo.x, wo.y, max(wo.z, kLeastDiffuseCosine)});
  if (!(mean > kLeastClosureWeight && mean < kInfinity && wo.z > kMinCosine && all.size < kMostMixtureLobes)) {
    return nullptr;
  }
  // In place: what the kinds keep beside is seldom needed, and is not cleared.
  MixtureLobe& lobe = *new (&all.lobes[all.size++]) MixtureLobe;
  lobe.weight = bounded;
  lobe.probability = mean;
  lobe.frame = frame;
  lobe.wo = wo;
  lobe.maths = b.maths;
  lobe.is_on_curve = !is_zero(b.tangent);
  lobe.is_bent = !(dot(frame.n, b.Ns) > kUnbentLobe) && !(lobe.is_on_curve && b.maths >= Maths::k52);
  if (lobe.is_bent) lobe.surface_N = to_local(frame, b.Ns);
  return &lobe;
}

/// The same of microfacets that reflect.
RELIEF_KERNEL MixtureLobe* reflection_add(MixtureBuild& b, Vec3f weight, const Frame& frame)
{
  return b.reflects ? mixture_add(b, weight, frame) : nullptr;
}

/// Whether microfacets mirror to below their own normal, too, where it is bent: in Cycles before 5.0, but for what it follows
/// from facet to facet. Lamps are not asked for there.
RELIEF_KERNEL bool microfacets_mirror_below(const SurfaceClosureSpec& spec)
{
  return spec.maths < Maths::k52 &&
         (spec.maths >= Maths::k43 || spec.distribution != ClosureDistribution::kMultiscatterGgx);
}

/// Makes a lobe one of reflection by microfacets.
/// @param roughness  perceptual: whether the lobe is sharp, and how wide ray cones become
/// @param alpha      of both directions, bounded
RELIEF_KERNEL void lobe_set_microfacets(MixtureLobe& lobe,
                                        const SurfaceClosureSpec& spec,
                                        float roughness,
                                        AnisotropicAlpha alpha)
{
  const SmithMasking masking = spec.maths >= Maths::k43 ? SmithMasking::kCorrelated : SmithMasking::kSeparable;
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
    case ClosureDistribution::kGgx:
    case ClosureDistribution::kMultiscatterGgx:
    case ClosureDistribution::kSharp:
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

/// The rest of lobe_give_back, where there is something to give.
[[gnu::noinline]] RELIEF_KERNEL Vec3f lobe_give_lost(MixtureBuild& b,
                                                     const SurfaceClosureSpec& spec,
                                                     MixtureLobe& lobe,
                                                     Vec3f F_mean)
{
  const AnisotropicAlpha alpha = lobe.shape.ggx.alpha;
  const float roughness = __builtin_sqrtf(__builtin_sqrtf(alpha.x * alpha.y));
  GgxMultiple multiple;
  multiple.ggx = ggx_coordinate(min(roughness, 1.0f));
  const float lost = ggx_albedo(*b.tables, multiple.ggx, lobe.wo.z).lost;
  if (spec.maths >= Maths::k43) {
    const Vec3f factor = ggx_energy_factor(*b.tables, EnergyModel::kTable, F_mean, roughness, lobe.wo.z);
    lobe_scale(lobe, factor);
    lobe.first_share = 1.0f - lost;
    return factor * lobe.first_share;
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

/// Gives a reflection back what its microfacets would reflect more than once, if its distribution says so: since 4.0 in the same
/// directions, before nearly in all. May add a lobe.
/// @param F_mean  a function, see ggx_energy_factor
/// @return        what the reflection is now as part of one that loses nothing to colour; 1 before 4.0
template <typename F>
RELIEF_KERNEL Vec3f lobe_give_back(MixtureBuild& b, const SurfaceClosureSpec& spec, MixtureLobe& lobe, F&& F_mean)
{
  // Before 4.0 facets send light on as blurred ones.
  if (spec.maths < Maths::k43 && b.blur > 0.0f) lobe_blur(lobe, b.blur, b.most_sharp);
  if (spec.distribution != ClosureDistribution::kMultiscatterGgx || lobe.is_delta) return {1, 1, 1};
  return lobe_give_lost(b, spec, lobe, F_mean());
}

RELIEF_KERNEL float saturated(float x) { return clamp(x, 0.0f, 1.0f); }
RELIEF_KERNEL Vec3f saturated(Vec3f c) { return {saturated(c.x), saturated(c.y), saturated(c.z)}; }

/// Roughness of microfacets. Up to 3.6 it is squared as it is given, so that negative ones count as positive ones.
RELIEF_KERNEL float closure_roughness(const SurfaceClosureSpec& spec, float given)
{
  return saturated(spec.maths >= Maths::k43 ? given : __builtin_fabsf(given));
}

/// Index of refraction as wo meets it.
RELIEF_KERNEL float closure_eta(const MixtureBuild& b, float ior)
{
  const float bounded = max(ior, 1e-5f);
  return b.front ? bounded : 1.0f / bounded;
}

/// Whether a path may go below the surface. Before 5.0 Cycles left it at a diffuse surface after a diffuse event: it is not seen well
/// then, and noisy. With profiles it still does.
RELIEF_KERNEL bool subsurface_enters(const MixtureBuild& b, const SurfaceClosureSpec& spec)
{
  const bool always = spec.maths >= Maths::k52 && spec.subsurface != SubsurfaceMethod::kProfile;
  return b.enters && (always || !b.is_after_diffuse);
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
    least =
        max(kLeastSubsurfaceRadius, spec.maths >= Maths::k43 && spec.maths < Maths::k52 ? 0.25f * b.footprint : 0.0f);
  }
  const bool is_walk = spec.subsurface == SubsurfaceMethod::kRandomWalk;
  s.anisotropy = clamp(s.anisotropy, spec.maths >= Maths::k52 ? -0.99f : 0.0f, is_walk ? 0.99f : 0.9f);
  s.is_similar = is_walk || s.anisotropy < 0.0f;
  const bool is_profile = spec.subsurface == SubsurfaceMethod::kProfile;
  if (is_profile) s.entry = SubsurfaceEntry::kProfile;
  s.entry_ior = clamp(s.entry_ior, 1.01f, 3.8f);
  const auto free_path = [&](float radius, float albedo) {
    if (is_walk) return radius;
    if (is_profile || spec.subsurface == SubsurfaceMethod::kLegacy) return radius * (0.25f * kInvPi);
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
                            spec.maths >= Maths::k43 ? SmithMasking::kCorrelated : SmithMasking::kSeparable, false};
  b.transmits = true;
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
  if (spec.maths >= Maths::k43 && !b.reflects) reflection_tint = {};
  if (spec.maths >= Maths::k43 && !b.refracts) transmission_tint = {};
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
  if (spec.maths < Maths::k43) lobe_blur(*lobe, b.blur, b.most_sharp);
  if (spec.distribution == ClosureDistribution::kMultiscatterGgx && !lobe->is_delta) {
    const GlassCoordinate at = glass_coordinate(fresnel.eta, lobe->roughness);
    const float lost = glass_lost(*b.tables, at, at.side, lobe->wo.z);
    const float lost_mean = glass_lost_mean(*b.tables, at, at.side);
    const bool mirrors = spec.maths >= Maths::k43 && is_zero(transmission_tint);
    const Vec3f F_mean =
        mirrors ? reflection_tint * fresnel_interpolated_mean(fresnel.a, {1, 1, 1}, fresnel.eta) : transmission_tint;
    lobe->first_share = max(1.0f - lost, 1e-3f);
    lobe_scale(*lobe, microfacet_energy_factor(saturated(F_mean), lobe->first_share, 1.0f - lost_mean));
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
  f.kind = spec.maths >= Maths::k52 ? MixtureFresnel::kFilmOnDielectric : MixtureFresnel::kThinFilm;
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
  if (spec.maths < Maths::k52 || !(film_nm > kLeastFilmNanometres)) return;
  f.kind = f.kind == MixtureFresnel::kF82 ? MixtureFresnel::kFilmOnF82 : MixtureFresnel::kFilmOnConductor;
  f.film_nm = film_nm;
  f.film_ior = max(film_ior, 1e-5f);
  f.film_table = &b.tables->thin_film;
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

}  // namespace relief
