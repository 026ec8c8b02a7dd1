// The lobes of a mixture: one struct for all, told apart by its kind, so that a hit's stand side by side in memory. Each is
// resolved for one wo, in a frame of its own whose z is its normal on wo's side. What they scatter stands in a file a lobe.
#pragma once

#include "kernel/bsdf/ashikhmin_shirley.h"
#include "kernel/bsdf/base_interface.h"
#include "kernel/bsdf/beckmann.h"
#include "kernel/bsdf/clearcoat_gtr1.h"
#include "kernel/bsdf/fibre.h"
#include "kernel/bsdf/fresnel_models.h"
#include "kernel/bsdf/ggx_anisotropic.h"
#include "kernel/bsdf/hair.h"
#include "kernel/bsdf/lobe.h"
#include "kernel/bsdf/microfacet_refraction.h"
#include "kernel/bsdf/oren_nayar.h"
#include "kernel/bsdf/principled_diffuse.h"
#include "kernel/bsdf/principled_sheen.h"
#include "kernel/bsdf/sheen_microfibre.h"
#include "kernel/bsdf/subsurface.h"
#include "kernel/bsdf/thin_film.h"
#include "kernel/bsdf/toon.h"
#include "kernel/bsdf/translucent.h"
#include "kernel/bsdf/velvet.h"

namespace relief {

enum class MixtureLobeKind : std::uint8_t {
  kLambert,
  kTranslucent,
  kOrenNayar,
  kOrenNayarMultiple,
  kPrincipledDiffuse,
  kPrincipledSheen,
  kVelvet,
  kMicrofibre,
  kToon,
  kGgx,
  kBeckmann,
  kAshikhminShirley,
  kClearcoat,
  kMultiple,
  kRefraction,
  kGlass,
  kSubsurface,  ///< from glass on, either side may be meant
  kHair,        ///< from here on, what scatters to all sides of a strand: frames as in hair.h
  kFibre,
};

/// How a microfacet's reflectance depends on the angle.
enum class MixtureFresnel : std::uint8_t {
  kNone,          ///< 1 everywhere
  kInterpolated,  ///< from F0 to 1 along a dielectric's curve
  kDielectric,
  kF82,
  kConductor,
  kConductorExact,
  kThinFilm,
  kFilmOnDielectric,
  kFilmOnConductor,
  kFilmOnF82,
};

/// A microfacet's reflectance.
struct MicrofacetFresnel {
  MixtureFresnel kind = MixtureFresnel::kNone;
  float eta = 1.5f;  ///< index of the far side / index of wo's side
  Vec3f a{};         ///< F0; of conductors their index
  Vec3f b{};         ///< FresnelF82::B; of conductors the imaginary part
  float film_ior = 1.33f, film_nm = 0;
  const ThinFilmTable* film_table = nullptr;  ///< of those kinds that have a film, but for kThinFilm
};

/// Solid glass: what microfacets reflect and refract, chosen between by their reflectance.
struct MixtureGlass {
  float alpha = 0;
  bool is_beckmann = false;
  Vec3f reflection_tint{1, 1, 1}, transmission_tint{1, 1, 1};
};

/// What a rough reflection scatters more than once, as MultipleLobe has it.
struct MixtureMultiple {
  GgxCoordinate ggx;
  MultipleScattering scattering;
  float over_mean = 0;  ///< 1 − E(wo), over π times its mean
};

/// Parameters of a lobe, by its kind.
union LobeShape {
  LobeShape() : none(0) {}
  float none;
  OrenNayar oren_nayar;
  OrenNayarMultiple oren_nayar_multiple;
  PrincipledDiffuse principled_diffuse;
  Velvet velvet;
  SheenMicrofibre microfibre;
  Toon toon;
  GgxAnisotropic ggx;
  Beckmann beckmann;
  AshikhminShirley ashikhmin_shirley;
  ClearcoatGtr1 clearcoat;
  MixtureMultiple multiple;
  MicrofacetRefraction refraction;
  MixtureGlass glass;
  Subsurface subsurface;
  Hair hair;
  Fibre fibre;
};

struct MixtureLobe {
  MixtureLobeKind kind = MixtureLobeKind::kLambert;
  bool is_delta = false;     ///< lights are not found through it: also what enters the object
  bool stays_sharp = false;  ///< a distribution without width: nothing blurs it
  bool is_bent = false;      ///< its normal is not the surface's
  bool is_4 = false;         ///< of 4.3's maths or later ones: which sides it reaches, see mixture_lobe_reaches
  bool is_5 = false;         ///< of 5.2's maths: what its normal sees and the surface does not fades as it does there
  bool mirrors_below = false;  ///< its microfacets mirror to below its normal as well, as far as the true surface lets them
  bool is_on_curve = false;  ///< its normal turns from edge to edge of a strand, whose geometric normal means little
  float probability = 0;     ///< not normalised
  float roughness = kInfinity;  ///< perceptual; infinite: never sharp
  Vec3f weight{};               ///< factor on f
  Frame frame;                  ///< world
  Vec3f wo{};                   ///< its own frame, z > 0
  Vec3f surface_N{};            ///< the surface's shading normal, its own frame
  MicrofacetFresnel fresnel;
  LobeShape shape;
};

/// Whether what the lobe scatters counts as diffuse, as mixture_lobe_sample says of it.
RELIEF_KERNEL bool mixture_lobe_is_diffuse(const MixtureLobe& lobe)
{
  switch (lobe.kind) {
    case MixtureLobeKind::kToon:
      return !lobe.shape.toon.is_glossy;
    case MixtureLobeKind::kGgx:
    case MixtureLobeKind::kBeckmann:
    case MixtureLobeKind::kAshikhminShirley:
    case MixtureLobeKind::kClearcoat:
    case MixtureLobeKind::kRefraction:
    case MixtureLobeKind::kGlass:
    case MixtureLobeKind::kHair:
    case MixtureLobeKind::kFibre:
      return false;
    default:
      return true;
  }
}

RELIEF_KERNEL bool mixture_lobe_is_sharp(const MixtureLobe& lobe, float most_roughness)
{
  return lobe.roughness < kInfinity && lobe.roughness <= most_roughness;
}

RELIEF_KERNEL bool mixture_lobe_is_microfacet(MixtureLobeKind kind)
{
  using K = MixtureLobeKind;
  return kind == K::kGgx || kind == K::kBeckmann || kind == K::kAshikhminShirley || kind == K::kRefraction ||
         kind == K::kGlass;
}

/// Whether a lobe is one of a strand, which has all directions around it.
RELIEF_KERNEL bool mixture_lobe_is_strand(MixtureLobeKind kind) { return kind >= MixtureLobeKind::kHair; }

/// Whether a lobe sends light to a direction that its own normal has on one side and the surface on another: as the version
/// of Cycles has it whose maths it is. What is sampled leaves by the true surface, so that no mirror sends it inside; but for
/// Ashikhmin and Shirley's lobe before 5.0.
/// @param below     wi is meant to go through the surface: it is below the lobe's normal, unless microfacets mirrored it there
/// @param below_Ns  the same of the surface's shading normal
/// @param below_Ng  of its geometric normal
/// @param sampled   wi was sampled from this lobe; or else it is asked for, as the direction of a lamp is
RELIEF_KERNEL bool mixture_lobe_reaches(const MixtureLobe& lobe, bool below, bool below_Ns, bool below_Ng, bool sampled)
{
  if (__builtin_expect(mixture_lobe_is_strand(lobe.kind), 0)) {
    if (lobe.kind == MixtureLobeKind::kFibre || sampled) return true;
    return lobe.shape.hair.transmits ? below_Ns : !(below || below_Ns);
  }
  if (__builtin_expect(lobe.is_on_curve, 0) && (sampled || lobe.is_5)) return true;
  const bool is_microfacet = mixture_lobe_is_microfacet(lobe.kind);
  if (sampled && lobe.kind == MixtureLobeKind::kAshikhminShirley && !lobe.is_5) return true;
  if (!lobe.is_4 && !lobe.is_5) {
    const bool refracts = lobe.kind == MixtureLobeKind::kRefraction || lobe.kind == MixtureLobeKind::kGlass;
    return !sampled || (refracts && below) || below == below_Ng;
  }
  if (sampled) return below == below_Ng && (is_microfacet || !lobe.is_5 || below == below_Ns);
  if (lobe.is_5) return below == below_Ns;
  return !is_microfacet || below == below_Ng;
}

/// @param cos_d  between either direction and the microfacet, >= 0
RELIEF_KERNEL Vec3f mixture_fresnel(const MicrofacetFresnel& f, float cos_d)
{
  switch (f.kind) {
    case MixtureFresnel::kNone:
      break;
    case MixtureFresnel::kInterpolated:
      return fresnel_interpolated(f.a, {1, 1, 1}, cos_d, f.eta);
    case MixtureFresnel::kDielectric:
      return splat3(fresnel_dielectric_at(cos_d, f.eta));
    case MixtureFresnel::kF82:
      return fresnel_f82({f.a, f.b}, cos_d);
    case MixtureFresnel::kConductor:
      return fresnel_conductor(f.a, f.b, cos_d);
    case MixtureFresnel::kConductorExact:
      return fresnel_conductor_exact(f.a, f.b, cos_d);
    case MixtureFresnel::kFilmOnDielectric:
      return fresnel_thin_film_scaled(fresnel_film_on_dielectric({f.film_table, f.film_ior, f.film_nm}, cos_d, f.eta),
                                      f.a, f.eta);
    case MixtureFresnel::kFilmOnConductor:
      return fresnel_film_on_conductor({f.film_table, f.film_ior, f.film_nm}, cos_d, f.a, f.b);
    case MixtureFresnel::kFilmOnF82:
      return fresnel_film_on_f82({f.film_table, f.film_ior, f.film_nm}, cos_d, {f.a, f.b});
    case MixtureFresnel::kThinFilm:
      return fresnel_thin_film_scaled(fresnel_thin_film(cos_d, f.eta, f.film_ior, f.film_nm), f.a, f.eta);
  }
  return {1, 1, 1};
}

/// Darkens diffuse light where a bent normal sees a lamp that the surface does not, smoothly.
/// @source Chiang, Li, Burley 2019, "Taming the Shadow Terminator", Eq. 2 and 3
RELIEF_KERNEL float bump_shadowing(Vec3f N, Vec3f wi)
{
  const float side = wi.z < 0.0f ? -1.0f : 1.0f;
  const float below = wi.z * N.z;
  const float g = below != 0.0f ? side * dot(N, wi) / (side * below) : 0.0f;
  if (g >= 1.0f) return 1.0f;
  return g > 0.0f ? g + g * g * (1.0f - g) : 0.0f;
}

/// The same as if the bumps were microfacets, as wide as the normal leans: since 5.0.
/// @source Conty Estevez, Lecocq, Stein 2019, "A Microfacet-Based Shadowing Function to Solve the Bump Terminator Problem"
RELIEF_KERNEL float bump_shadowing_ggx(Vec3f N, Vec3f wi)
{
  const float cos_N = __builtin_fabsf(N.z), cos_i = __builtin_fabsf(dot(N, wi));
  if (!(cos_i >= 1e-6f)) return cos_N < 1.0f ? 0.0f : 1.0f;
  const auto tan_squared = [](float cosine) { return max(1.0f / sqr(cosine) - 1.0f, 0.0f); };
  const float alpha_squared = min(0.125f * tan_squared(cos_N), 1.0f);
  return 2.0f / (1.0f + __builtin_sqrtf(1.0f + alpha_squared * tan_squared(cos_i)));
}

/// @param through  whether wi is refracted
/// @return         f, and pdf as if the lobe were chosen
template <TransportMode kMode>
RELIEF_KERNEL BsdfEval mixture_glass_eval(const MixtureLobe& lobe, Vec3f wi, bool through)
{
  const MixtureGlass& glass = lobe.shape.glass;
  const float eta = lobe.fresnel.eta;
  float pdf = 0.0f;
  if (!through) {
    const float cos_d = half_angle_cosine(lobe.wo, wi);
    const AnisotropicAlpha alpha{glass.alpha, glass.alpha};
    const float f = glass.is_beckmann ? beckmann_eval({alpha, SmithMasking::kCorrelated}, lobe.wo, wi, &pdf)
                                      : ggx_anisotropic_eval({alpha, SmithMasking::kCorrelated}, lobe.wo, wi, &pdf);
    const float chance = fresnel_dielectric_at(cos_d, eta);
    return {glass.reflection_tint * mixture_fresnel(lobe.fresnel, cos_d) * f, chance * pdf};
  }
  const MicrofacetRefraction refraction{glass.alpha, eta, glass.is_beckmann, SmithMasking::kCorrelated, false};
  const float f = microfacet_refraction_eval(refraction, lobe.wo, wi, &pdf);
  const Vec3f h = lobe.wo + eta * wi;
  const float cos_o = min(1.0f, __builtin_fabsf(dot(lobe.wo, h)) / length(h));
  const Vec3f transmittance = splat3(1.0f) - mixture_fresnel(lobe.fresnel, cos_o);
  return {glass.transmission_tint * max(transmittance, Vec3f{}) * (f * transmission_scale<kMode>(eta)),
          (1.0f - fresnel_dielectric_at(cos_o, eta)) * pdf};
}

[[gnu::noinline]] RELIEF_KERNEL BsdfEval strand_lobe_eval(const MixtureLobe& lobe, Vec3f wi)
{
  if (lobe.kind == MixtureLobeKind::kFibre) {
    const FibreEval e = fibre_eval(lobe.shape.fibre, lobe.wo, wi);
    return {e.f, e.pdf};
  }
  const float density = hair_eval(lobe.shape.hair, lobe.wo, wi);
  return {splat3(density), density};
}

/// What goes through a fibre counts as transmitted wherever it leaves.
[[gnu::noinline]] RELIEF_KERNEL LobeSample strand_lobe_sample(const MixtureLobe& lobe, float u_branch, Vec2f u)
{
  if (lobe.kind == MixtureLobeKind::kFibre) {
    const FibreSample s = fibre_sample(lobe.shape.fibre, lobe.wo, u_branch, u);
    return lobe_sample_glossy(s.wi, !s.is_reflected, min(__builtin_sqrtf(lobe.shape.fibre.variance_R), 1.0f));
  }
  const Hair& hair = lobe.shape.hair;
  return lobe_sample_glossy(hair_sample(hair, lobe.wo, u), hair.transmits, hair.along);
}

/// Evaluates a lobe. Not inlined, as are all that know every kind of lobe: kernels call them from many places, and with a copy
/// in each were half a megabyte long and slower.
/// @param wi       the lobe's frame
/// @param through  whether wi goes through the surface: as below in mixture_lobe_reaches
/// @param sampled  wi was sampled from this lobe
/// @return         f times |cos| to the lobe's own normal, before its weight; pdf as if the lobe were chosen
template <TransportMode kMode>
[[gnu::noinline]] RELIEF_KERNEL BsdfEval
mixture_lobe_eval(const MixtureLobe& lobe, const BsdfTables& tables, Vec3f wi, bool through, bool sampled)
{
  using K = MixtureLobeKind;
  const bool transmits = lobe.kind == K::kTranslucent || lobe.kind == K::kRefraction;
  const bool is_other_side = lobe.kind < K::kGlass && through != transmits;
  if (lobe.is_delta || is_other_side || !(__builtin_fabsf(wi.z) > kMinCosine)) return {};
  const Vec3f wo = lobe.wo;
  BsdfEval e;
  bool is_diffuse = true, is_microfacet = false;
  switch (lobe.kind) {
    case K::kLambert:
      e = {splat3(kInvPi), diffuse_pdf(wi)};
      break;
    case K::kTranslucent:
      e.f = splat3(translucent_eval({}, wo, wi, &e.pdf));
      break;
    case K::kOrenNayar:
      e.f = splat3(oren_nayar_eval(lobe.shape.oren_nayar, wo, wi, &e.pdf));
      break;
    case K::kOrenNayarMultiple:
      e.f = oren_nayar_multiple_eval(lobe.shape.oren_nayar_multiple, wo, wi, &e.pdf);
      break;
    case K::kPrincipledDiffuse:
      e.f = splat3(principled_diffuse_eval(lobe.shape.principled_diffuse, wo, wi, &e.pdf));
      break;
    case K::kPrincipledSheen:
      e.f = splat3(principled_sheen_eval({}, wo, wi, &e.pdf));
      break;
    case K::kVelvet:
      is_diffuse = !lobe.is_5;
      e.f = splat3(velvet_eval(lobe.shape.velvet, wo, wi, &e.pdf));
      break;
    case K::kMicrofibre:
      e.f = splat3(sheen_microfibre_eval(lobe.shape.microfibre, wo, wi, &e.pdf));
      break;
    case K::kToon:
      is_diffuse = !(lobe.is_5 && lobe.shape.toon.is_glossy);
      e.f = splat3(toon_eval(lobe.shape.toon, wo, wi, &e.pdf));
      break;
    case K::kGgx:
      is_microfacet = true;
      e.f = splat3(ggx_anisotropic_eval(lobe.shape.ggx, wo, wi, &e.pdf));
      break;
    case K::kBeckmann:
      is_microfacet = true;
      e.f = splat3(beckmann_eval(lobe.shape.beckmann, wo, wi, &e.pdf));
      break;
    case K::kAshikhminShirley:
      is_microfacet = true;
      e.f = splat3(ashikhmin_shirley_eval(lobe.shape.ashikhmin_shirley, wo, wi, &e.pdf));
      break;
    case K::kClearcoat:
      is_microfacet = true;
      e.f = splat3(clearcoat_gtr1_eval(lobe.shape.clearcoat, wo, wi, &e.pdf));
      break;
    case K::kMultiple:
      is_diffuse = false;
      e = {splat3(lobe.shape.multiple.over_mean * ggx_albedo(tables, lobe.shape.multiple.ggx, wi.z).lost),
           multiple_scattering_pdf(lobe.shape.multiple.scattering, wi.z)};
      break;
    case K::kRefraction:
      is_diffuse = false;
      e.f = splat3(microfacet_refraction_eval(lobe.shape.refraction, wo, wi, &e.pdf) *
                   transmission_scale<kMode>(lobe.shape.refraction.eta));
      break;
    case K::kGlass:
      is_diffuse = false;
      e = mixture_glass_eval<kMode>(lobe, wi, through);
      break;
    case K::kSubsurface:
      break;
    case K::kHair:
    case K::kFibre:
      return strand_lobe_eval(lobe, wi);
  }
  if (is_microfacet) {
    e.f *= mixture_fresnel(lobe.fresnel, half_angle_cosine(wo, wi));
  } else if (is_diffuse && lobe.is_bent && !(transmits && sampled)) {
    // In Cycles what a lobe sends through the surface itself does not fade, as what it is asked for does.
    e.f *= lobe.is_5 ? bump_shadowing_ggx(lobe.surface_N, wi) : bump_shadowing(lobe.surface_N, wi);
  }
  e.f *= __builtin_fabsf(wi.z);
  return e;
}

/// Samples glass, rough or smooth.
template <TransportMode kMode>
RELIEF_KERNEL LobeSample mixture_glass_sample(const MixtureLobe& lobe, float u_branch, Vec2f u)
{
  const MixtureGlass& glass = lobe.shape.glass;
  const float eta = lobe.fresnel.eta;
  const Vec3f wo = lobe.wo;
  const AnisotropicAlpha alpha{glass.alpha, glass.alpha};
  const Vec3f wm = lobe.is_delta       ? Vec3f{0, 0, 1}
                   : glass.is_beckmann ? beckmann_visible_normal(alpha, wo, u)
                                       : ggx_anisotropic_visible_normal(alpha, wo, u);
  const float cos_o = min(1.0f, dot(wo, wm));
  if (!(cos_o > 0.0f)) return {};
  const float chance = fresnel_dielectric_at(cos_o, eta);
  const bool reflects = u_branch < chance;
  Vec3f wi;
  if (reflects) {
    wi = 2.0f * cos_o * wm - wo;
  } else if (dielectric_is_matched(eta)) {
    wi = -wo;
  } else {
    wi = normalize(refract(wo, wm, cos_o, refracted_cosine(cos_o, eta), eta));
  }
  LobeSample s;
  const Vec3f F = mixture_fresnel(lobe.fresnel, cos_o);
  if (!lobe.is_delta) {
    s = lobe_sample_glossy(wi, !reflects, glass.alpha);
  } else if (reflects) {
    s = lobe_sample_delta(wi, glass.reflection_tint * F, chance);
  } else {
    const Vec3f through = max(splat3(1.0f) - F, Vec3f{}) * transmission_scale<kMode>(eta);
    s = lobe_sample_delta(wi, glass.transmission_tint * through, 1.0f - chance);
  }
  if (!reflects) s.eta = eta;
  return s;
}

/// What a lobe of microfacets sends on as a mirror, or as a clear pane.
template <TransportMode kMode>
RELIEF_KERNEL LobeSample mixture_delta_sample(const MixtureLobe& lobe)
{
  const Vec3f wo = lobe.wo;
  if (lobe.kind != MixtureLobeKind::kRefraction) {
    return lobe_sample_delta({-wo.x, -wo.y, wo.z}, mixture_fresnel(lobe.fresnel, wo.z));
  }
  const float eta = lobe.shape.refraction.eta;
  const float cos_t = refracted_cosine(wo.z, eta);
  if (!(cos_t > 0.0f)) return {};
  const Vec3f wi = dielectric_is_matched(eta) ? -wo : normalize(Vec3f{-wo.x / eta, -wo.y / eta, -cos_t});
  LobeSample s = lobe_sample_delta(wi, splat3(transmission_scale<kMode>(eta)));
  s.eta = eta;
  return s;
}

/// Samples a lobe.
/// @param u_branch  [0, 1): between reflection and refraction
/// @return          in the lobe's frame
template <TransportMode kMode>
[[gnu::noinline]] RELIEF_KERNEL LobeSample mixture_lobe_sample(const MixtureLobe& lobe, float u_branch, Vec2f u)
{
  using K = MixtureLobeKind;
  const Vec3f wo = lobe.wo;
  if (lobe.kind == K::kGlass) return mixture_glass_sample<kMode>(lobe, u_branch, u);
  if (lobe.is_delta) return mixture_delta_sample<kMode>(lobe);
  switch (lobe.kind) {
    case K::kTranslucent:
      return lobe_sample_diffuse(translucent_sample({}, wo, u), true);
    case K::kVelvet:
      return lobe_sample_diffuse(velvet_sample(lobe.shape.velvet, wo, u), false);
    case K::kMicrofibre:
      return lobe_sample_diffuse(sheen_microfibre_sample(lobe.shape.microfibre, wo, u), false);
    case K::kToon: {
      const Vec3f wi = toon_sample(lobe.shape.toon, wo, u);
      return lobe.shape.toon.is_glossy ? lobe_sample_glossy(wi, false, 1.0f) : lobe_sample_diffuse(wi, false);
    }
    case K::kGgx:
      return lobe_sample_glossy(ggx_anisotropic_sample(lobe.shape.ggx, wo, u), false, sqr(lobe.roughness));
    case K::kBeckmann:
      return lobe_sample_glossy(beckmann_sample(lobe.shape.beckmann, wo, u), false, sqr(lobe.roughness));
    case K::kAshikhminShirley:
      return lobe_sample_glossy(ashikhmin_shirley_sample(lobe.shape.ashikhmin_shirley, wo, u), false,
                                sqr(lobe.roughness));
    case K::kClearcoat:
      return lobe_sample_glossy(clearcoat_gtr1_sample(lobe.shape.clearcoat, wo, u), false, sqr(lobe.roughness));
    case K::kMultiple:
      return lobe_sample_diffuse(multiple_scattering_sample(lobe.shape.multiple.scattering, u), false);
    case K::kRefraction: {
      const Vec3f wi = microfacet_refraction_sample(lobe.shape.refraction, wo, u);
      LobeSample s = lobe_sample_glossy(wi, true, sqr(lobe.roughness));
      s.eta = lobe.shape.refraction.eta;
      return s;
    }
    case K::kHair:
    case K::kFibre:
      return strand_lobe_sample(lobe, u_branch, u);
    default:
      return lobe_sample_diffuse(diffuse_sample(u), false);
  }
}

}  // namespace relief
