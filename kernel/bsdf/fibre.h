// A fibre of glass with a rough, tilted cuticle and pigment inside, seen from so far that it is a line: the Principled Hair BSDF of Cycles
// by its model "Chiang". Light that is reflected (R), goes through (TT), is reflected once inside (TRT), and the rest, each a
// distribution of tilts times one around the fibre.
//
// Chiang, Bitterli, Tappan and Burley 2016, "A Practical and Controllable Hair and Fur Model for Production Path Tracing" [C].
// d'Eon, Francois, Hill, Letteri and Aubry 2011, "An Energy-Conserving Hair Reflectance Model" [E].
//
// Frame as in hair.h. Angles around the fibre are seen along -x there, which is how `across` is signed.
#pragma once

#include "kernel/bsdf/fresnel_models.h"
#include "kernel/bsdf/hair.h"
#include "kernel/bsdf/mixture_traits.h"

namespace relief {

struct Fibre {
  static constexpr MixtureTraits kTraits{
      .sides = LobeSides::kSphere, .is_diffuse = false, .fading = LobeFading::kNever, .is_strand = true};
  Vec3f sigma{};          ///< absorption over the fibre's radius
  float variance = 0.1f;  ///< of tilts of TT times 4, TRT over 4
  float variance_R = 0.1f;
  float scale = 0.1f;  ///< of the logistic distribution around the fibre
  float tilt = 0;      ///< of the cuticle's scales, radians
  float eta = 1.55f;   ///< index of refraction
  float across = 0;    ///< where wo meets the fibre, from one edge, -1, to the other
};

inline constexpr int kFibreLobes = 4;

/// Variance of tilts by perceptual roughness.
/// @source  [C] Eq. 7
RELIEF_KERNEL float fibre_variance(float roughness)
{
  const float r = clamp(roughness, 0.001f, 1.0f), r2 = sqr(r), r4 = sqr(r2), r16 = sqr(sqr(r4));
  return sqr(0.726f * r + 0.812f * r2 + 3.7f * r16 * r4);
}

/// Scale of the logistic distribution by perceptual roughness.
/// @source  [C] Eq. 8
RELIEF_KERNEL float fibre_scale(float roughness)
{
  constexpr float kRootOfPiOver8 = 0.626657069f;
  const float r = clamp(roughness, 0.001f, 1.0f), r2 = sqr(r), r4 = sqr(r2), r16 = sqr(sqr(r4));
  return kRootOfPiOver8 * (0.265f * r + 1.194f * r2 + 5.372f * r16 * r4 * r2);
}

/// Absorption by which many fibres together have a colour.
/// @param color  reflectance
/// @source  [C] Eq. 9
RELIEF_KERNEL Vec3f fibre_sigma_of_color(Vec3f color, float radial_roughness)
{
  const float b = radial_roughness;
  const float scale = 5.969f + b * (-0.215f + b * (2.532f + b * (-10.73f + b * (5.574f + b * 0.245f))));
  const auto axis = [scale](float c) { return sqr(std::log(max(c, 1e-20f)) / scale); };
  return {axis(color.x), axis(color.y), axis(color.z)};
}

/// Absorption by the concentrations of the two pigments.
RELIEF_KERNEL Vec3f fibre_sigma_of_melanin(float eumelanin, float pheomelanin)
{
  return eumelanin * Vec3f{0.506f, 0.841f, 1.653f} + pheomelanin * Vec3f{0.343f, 0.733f, 1.924f};
}

struct FibreTilt {
  float sin, cos;
};

/// Logarithm of the modified Bessel function of the first kind and order 0.
RELIEF_KERNEL float log_bessel_0(float x)
{
  // The asymptotic series; at twelve, where it begins, it is within 10⁻³. Cycles has half of its second term, by which fibres lose
  // up to .5 % of the light.
  if (x > 12.0f) return x - 0.5f * std::log(2.0f * kPi * x) + (1.0f + 0.5625f / x) * 0.125f / x;
  const float quarter = 0.25f * sqr(x);
  float term = 1.0f, sum = 1.0f;
  for (int i = 1; i < 32 && term > 1e-8f * sum; ++i) {
    term *= quarter / sqr(static_cast<float>(i));
    sum += term;
  }
  return std::log(sum);
}

/// Density of the tilt of wi over the solid angle, without that around the fibre.
/// @source  [E] Eq. 7
RELIEF_KERNEL float fibre_tilt_density(FibreTilt i, FibreTilt o, float variance)
{
  const float inverse = 1.0f / variance;
  const float exponent = log_bessel_0(i.cos * o.cos * inverse) - i.sin * o.sin * inverse;
  // 1 / (2 v sinh(1 / v)), which overflows where v is small.
  return std::exp(exponent - inverse) * inverse / (1.0f - std::exp(-2.0f * inverse));
}

/// How a fibre scatters what comes from one direction.
struct FibreScattering {
  float gamma_o, gamma_t;          ///< angles at which light meets the surface and goes on inside, across
  Vec3f attenuation[kFibreLobes];  ///< of R, TT, TRT and the rest
  float chance[kFibreLobes];
};

/// @source  [C] Section 3, [E] Eq. 14 and 24
RELIEF_KERNEL FibreScattering fibre_scattering(const Fibre& fibre, Vec3f wo)
{
  const float sin_o = clamp(wo.x, -1.0f, 1.0f), cos_o = safe_sqrt(1.0f - sqr(sin_o));
  const float cos_t = safe_sqrt(1.0f - sqr(sin_o / fibre.eta));
  const float h = clamp(fibre.across, -1.0f, 1.0f);
  const float sin_gamma = clamp(h * cos_o / __builtin_sqrtf(max(sqr(fibre.eta) - sqr(sin_o), 1e-6f)), -1.0f, 1.0f);
  FibreScattering out;
  out.gamma_o = asin_clamped(h);
  out.gamma_t = asin_clamped(sin_gamma);
  const Vec3f T = exp(fibre.sigma * (-2.0f * safe_sqrt(1.0f - sqr(sin_gamma)) / max(cos_t, 1e-4f)));
  const float F = fresnel_dielectric_at(cos_o * safe_sqrt(1.0f - sqr(h)), fibre.eta);
  const auto rest = [F](float t) { return t * F < 1.0f ? t * F / (1.0f - t * F) : 0.0f; };
  out.attenuation[0] = splat3(F);
  out.attenuation[1] = sqr(1.0f - F) * T;
  out.attenuation[2] = out.attenuation[1] * T * F;
  out.attenuation[3] = out.attenuation[2] * Vec3f{rest(T.x), rest(T.y), rest(T.z)};
  float sum = 0;
  for (int p = 0; p < kFibreLobes; ++p) sum += out.chance[p] = luminance(out.attenuation[p]);
  for (float& chance : out.chance) chance = sum > 0.0f ? chance / sum : 0.25f;
  return out;
}

RELIEF_KERNEL float fibre_lobe_variance(const Fibre& fibre, int p)
{
  return p == 0 ? fibre.variance_R : p == 1 ? 0.25f * fibre.variance : 4.0f * fibre.variance;
}

/// By how much the cuticle turns the tilt of a lobe.
RELIEF_KERNEL float fibre_lobe_tilt(const Fibre& fibre, int p)
{
  constexpr float kTimes[] = {2, -1, -4, 0};
  return kTimes[p] * fibre.tilt;
}

RELIEF_KERNEL FibreTilt fibre_turned(FibreTilt a, float angle)
{
  const float s = std::sin(angle), c = std::cos(angle);
  return {a.sin * c + a.cos * s, __builtin_fabsf(a.cos * c - a.sin * s)};
}

/// Where around the fibre smooth surfaces would send a lobe, from where light came.
RELIEF_KERNEL float fibre_exit(const FibreScattering& s, int p)
{
  return static_cast<float>(p) * (2.0f * s.gamma_t + kPi) - 2.0f * s.gamma_o;
}

/// Share of the logistic distribution below x.
RELIEF_KERNEL float logistic_cdf(float x, float scale) { return 1.0f / (1.0f + std::exp(-x / scale)); }

/// Density of an angle, any, under the logistic distribution within half a turn.
RELIEF_KERNEL float logistic_pdf(float angle, float scale)
{
  constexpr float kTurn = 2.0f * kPi;
  const float x = angle - kTurn * __builtin_floorf(angle / kTurn + 0.5f);
  const float e = std::exp(-__builtin_fabsf(x) / scale);
  return e / (scale * sqr(1.0f + e) * (1.0f - 2.0f * logistic_cdf(-kPi, scale)));
}

RELIEF_KERNEL float logistic_sample(float u, float scale)
{
  const float low = logistic_cdf(-kPi, scale);
  const float share = lerp(u, low, 1.0f - low);
  return clamp(-scale * std::log(1.0f / max(share, 1e-20f) - 1.0f), -kPi, kPi);
}

/// Angle around the fibre from wo, which has none.
RELIEF_KERNEL float fibre_angle(Vec3f w) { return std::atan2(-w.y, w.z); }

struct FibreEval {
  Vec3f f{};  ///< f · cos
  float pdf = 0;
};

RELIEF_KERNEL FibreEval fibre_eval(const Fibre& fibre, Vec3f wo, Vec3f wi)
{
  const FibreScattering s = fibre_scattering(fibre, wo);
  const FibreTilt o{wo.x, safe_sqrt(1.0f - sqr(wo.x))}, i{wi.x, safe_sqrt(1.0f - sqr(wi.x))};
  const float phi = fibre_angle(wi);
  FibreEval e;
  for (int p = 0; p < kFibreLobes; ++p) {
    const FibreTilt turned = fibre_turned(i, fibre_lobe_tilt(fibre, p));
    const float around = p < 3 ? logistic_pdf(phi - fibre_exit(s, p), fibre.scale) : 0.5f * kInvPi;
    const float density = fibre_tilt_density(turned, o, fibre_lobe_variance(fibre, p)) * around;
    e.f += s.attenuation[p] * density;
    e.pdf += s.chance[p] * density;
  }
  return e;
}

struct FibreSample {
  Vec3f wi;
  bool is_reflected;  ///< by the surface
};

/// Sine of the tilt of wi. @param u_along  (0, 1]
/// @source  [E] Section 5
RELIEF_KERNEL float fibre_tilt_sample(Vec3f wo, float variance, float u_along, float u)
{
  const float along = 1.0f + variance * std::log(u_along + (1.0f - u_along) * std::exp(-2.0f / variance));
  const float cos_o = safe_sqrt(1.0f - sqr(wo.x));
  return clamp(-along * wo.x + safe_sqrt(1.0f - sqr(along)) * std::cos(2.0f * kPi * u) * cos_o, -1.0f, 1.0f);
}

/// @param u_lobe  [0, 1): of which lobe, and of the tilt
RELIEF_KERNEL FibreSample fibre_sample(const Fibre& fibre, Vec3f wo, float u_lobe, Vec2f u)
{
  const FibreScattering s = fibre_scattering(fibre, wo);
  int p = 0;
  while (p + 1 < kFibreLobes && u_lobe >= s.chance[p]) u_lobe -= s.chance[p++];
  const float again = clamp(s.chance[p] > 0.0f ? u_lobe / s.chance[p] : 0.0f, 1e-5f, 1.0f);
  FibreTilt i;
  i.sin = fibre_tilt_sample(wo, fibre_lobe_variance(fibre, p), again, u.y);
  i.cos = safe_sqrt(1.0f - sqr(i.sin));
  i = fibre_turned(i, -fibre_lobe_tilt(fibre, p));
  const float phi = p < 3 ? fibre_exit(s, p) + logistic_sample(u.x, fibre.scale) : 2.0f * kPi * u.x;
  return {{i.sin, -i.cos * std::sin(phi), i.cos * std::cos(phi)}, p == 0};
}

template <TransportMode>
[[gnu::noinline]] RELIEF_KERNEL BsdfEval lobe_eval(const Fibre& fibre, const LobeHit& hit, const BsdfTables&, Vec3f wi, bool)
{
  const FibreEval e = fibre_eval(fibre, hit.wo, wi);
  return {e.f, e.pdf};
}

/// What goes through a fibre counts as transmitted wherever it leaves.
template <TransportMode>
[[gnu::noinline]] RELIEF_KERNEL LobeSample lobe_sample(const Fibre& fibre, const LobeHit& hit, float u_branch, Vec2f u)
{
  const FibreSample s = fibre_sample(fibre, hit.wo, u_branch, u);
  return lobe_sample_glossy(s.wi, !s.is_reflected, min(__builtin_sqrtf(fibre.variance_R), 1.0f));
}

RELIEF_KERNEL bool lobe_widen(Fibre& fibre, float, float blur)
{
  fibre.variance = max(fibre.variance, blur);
  fibre.variance_R = max(fibre.variance_R, blur);
  fibre.scale = max(fibre.scale, blur);
  return true;
}

}  // namespace relief
