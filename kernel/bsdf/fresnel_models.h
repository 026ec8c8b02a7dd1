// Reflectances that Blender's shaders put on microfacets, beside those of fresnel.h. All are functions of the cosine
// between either direction and the microfacet.
#pragma once

#include "kernel/bsdf/fresnel.h"
#include "kernel/math/cie_1931.h"
#include "kernel/math/trigonometry.h"

namespace relief {

/// Dielectric's reflectance at any index ratio. @param eta  transmitted / incident
RELIEF_KERNEL float fresnel_dielectric_at(float cos_i, float eta)
{
  return fresnel_dielectric(cos_i, refracted_cosine(cos_i, eta), eta);
}

/// How far a dielectric's reflectance has risen from normal (0) to grazing incidence (1).
///
/// Indices above 4 first fall a little: Cycles 3.4 lets the weight become negative, 4.x holds it at zero. Held here.
/// @return [0, 1]; 1 for eta = 1 only at grazing incidence
RELIEF_KERNEL float fresnel_dielectric_weight(float cos_i, float eta)
{
  // (F − F0) / (1 − F0), both of its fractions brought to the same: 1 − F0 is 4 eta / (eta + 1)². eta cos_t is t here.
  const float eta2 = eta * eta;
  const float t2 = eta2 - 1.0f + cos_i * cos_i;
  if (!(t2 > 0.0f)) return 1.0f;
  const float t = __builtin_sqrtf(t2);
  const float parallel = (eta2 * cos_i - t) / (eta2 * cos_i + t);
  const float perpendicular = (cos_i - t) / (cos_i + t);
  const float rise = 0.5f * sqr(eta + 1.0f) * (sqr(parallel) + sqr(perpendicular)) - sqr(eta - 1.0f);
  return clamp(0.25f * rise / eta, 0.0f, 1.0f);
}

/// A dielectric's curve between reflectances of one's own: specular of the Principled shader, its clearcoat, its coloured
/// glass. 3.4 has F90 = 1.
RELIEF_KERNEL Vec3f fresnel_interpolated(Vec3f F0, Vec3f F90, float cos_i, float eta)
{
  const float w = fresnel_dielectric_weight(cos_i, eta);
  return F0 * (1.0f - w) + F90 * w;
}

/// Index whose reflectance is 8 % of `specular`: the Principled shader up to 3.6.
RELIEF_KERNEL float ior_of_specular(float specular)
{
  return 2.0f / (1.0f - safe_sqrt(0.08f * min(specular, 12.4f))) - 1.0f;
}

/// Index of a reflectance at normal incidence. @param F0  clamped to [0, 0.99], as Cycles does
RELIEF_KERNEL float ior_of_F0(float F0)
{
  const float root = __builtin_sqrtf(clamp(F0, 0.0f, 0.99f));
  return (1.0f + root) / (1.0f - root);
}

/// Schlick's curve with an exponent of one's own.
/// @param eta       below 1 the angle of refraction counts, beyond the critical angle all is reflected
/// @param exponent  >= 0; 5 is Schlick's
RELIEF_KERNEL Vec3f fresnel_schlick_generalized(Vec3f F0, Vec3f F90, float exponent, float cos_i, float eta)
{
  const float cos_t = refracted_cosine(cos_i, eta);
  if (!(cos_t > 0.0f)) return splat3(1.0f);
  const float w = std::pow(clamp(1.0f - (eta < 1.0f ? cos_t : cos_i), 0.0f, 1.0f), exponent);
  return F0 * (1.0f - w) + F90 * w;
}

/// Metal by the colours seen from above and near the edge.
struct FresnelF82 {
  Vec3f F0{};
  Vec3f B{};  ///< taken from Schlick's curve, times cos (1 − cos)⁶
};

/// @param tint  factor on Schlick's reflectance at cosine 1/7, about 82°
/// @source      Kutz, Hašan, Edmondson 2021, "Novel Aspects of the Adobe Standard Material", Eq. 6
RELIEF_KERNEL FresnelF82 fresnel_f82_make(Vec3f F0, Vec3f tint)
{
  constexpr float kFifth = 0.46266436f;   // (6/7)⁵
  constexpr float kInvPeak = 17.651384f;  // 1 / (1/7 · (6/7)⁶)
  const Vec3f schlick = F0 * (1.0f - kFifth) + splat3(kFifth);
  return {F0, schlick * (splat3(1.0f) - tint) * kInvPeak};
}

RELIEF_KERNEL Vec3f fresnel_f82(const FresnelF82& f, float cos_i)
{
  const float x = clamp(1.0f - cos_i, 0.0f, 1.0f);
  const float x5 = sqr(sqr(x)) * x;
  const Vec3f F = f.F0 * (1.0f - x5) + splat3(x5) - f.B * (cos_i * x5 * x);
  return min(max(F, splat3(0.0f)), splat3(1.0f));
}

/// Mean over the cosine-weighted hemisphere, before the clamp of fresnel_f82: ∫ 2µ² (1 − µ)⁶ is 1/126.
RELIEF_KERNEL Vec3f fresnel_f82_mean(const FresnelF82& f)
{
  return f.F0 * (20.0f / 21.0f) + splat3(1.0f / 21.0f) - f.B * (1.0f / 126.0f);
}

/// Metal by its complex index eta + ik, for absorption that is strong against the index, as Cycles has it up to 4.x.
/// @source  Pharr, Jakob and Humphreys, "Physically Based Rendering", 2nd edition, Eq. 8.3: of polarisations apart, with
///          cos_t taken as 1
RELIEF_KERNEL Vec3f fresnel_conductor(Vec3f eta, Vec3f k, float cos_i)
{
  const float c2 = cos_i * cos_i;
  const Vec3f square = eta * eta + k * k;
  const Vec3f twice = eta * (2.0f * cos_i);
  const Vec3f scaled = square * c2;
  const Vec3f parallel = (scaled - twice + splat3(1.0f)) / (scaled + twice + splat3(1.0f));
  const Vec3f perpendicular = (square - twice + splat3(c2)) / (square + twice + splat3(c2));
  return (parallel + perpendicular) * 0.5f;
}

/// The F82 curve through a reflectance from above, and one at 82°.
RELIEF_KERNEL FresnelF82 fresnel_f82_through(Vec3f F0, Vec3f F82)
{
  constexpr float kFifth = 0.46266436f, kInvPeak = 17.651384f;
  return {F0, (F0 * (1.0f - kFifth) + splat3(kFifth) - F82) * kInvPeak};
}

/// That which meets the conductor's: for its mean.
RELIEF_KERNEL FresnelF82 fresnel_f82_of_conductor(Vec3f eta, Vec3f k)
{
  return fresnel_f82_through(fresnel_conductor(eta, k, 1.0f), fresnel_conductor(eta, k, 1.0f / 7.0f));
}

/// Both polarisations of a dielectric interface.
struct PolarizedReflection {
  float R_s = 1, R_p = 1;          ///< reflectances
  float phase_s = 0, phase_p = 0;  ///< of the reflected wave, 0 or π
  float cos_t = 0;
};

RELIEF_KERNEL PolarizedReflection fresnel_polarized(float cos_i, float eta)
{
  PolarizedReflection r;
  r.cos_t = refracted_cosine(cos_i, eta);
  if (!(r.cos_t > 0.0f)) return r;
  const float s = (cos_i - eta * r.cos_t) / (cos_i + eta * r.cos_t);
  const float p = (eta * cos_i - r.cos_t) / (eta * cos_i + r.cos_t);
  return {s * s, p * p, s < 0.0f ? kPi : 0.0f, p < 0.0f ? kPi : 0.0f, r.cos_t};
}

/// Fourier transform of the eye's sensitivities, CIE XYZ, at an optical path difference.
/// @param path_nm  optical path difference, nanometres
/// @param shift    phase, radians
/// @source         Belcour and Barla 2017 [BB], supplemental material: sums of Gaussians, divided by Y's integral
RELIEF_KERNEL Vec3f thin_film_sensitivity(float path_nm, float shift)
{
  const float phase = 2e-9f * kPi * path_nm;
  const float phase2 = phase * phase;
  const auto gaussian = [&](float value, float position, float variance) {
    return value * __builtin_sqrtf(2.0f * kPi * variance) * std::cos(position * phase + shift) *
           std::exp(-variance * phase2);
  };
  constexpr float kScale = 1.0f / 1.0685e-7f;
  // The second lobe of X comes with its root multiplied out.
  const float x_red = 1.64408e-8f * std::cos(2.2399e6f * phase + shift) * std::exp(-4.5282e9f * phase2);
  return {kScale * (gaussian(5.4856e-13f, 1.6810e6f, 4.3278e9f) + x_red),
          kScale * gaussian(4.4201e-13f, 1.7953e6f, 9.3046e9f), kScale * gaussian(5.2481e-13f, 2.2084e6f, 6.6121e9f)};
}

/// Light reflected by both faces of the film, of one polarisation, CIE XYZ.
/// @source  [BB] Eq. 10, first three orders
RELIEF_KERNEL Vec3f thin_film_airy(float R12, float R23, float path_nm, float phase)
{
  const float R123 = R12 * R23;
  const float T121 = 1.0f - R12;
  const float R_s = sqr(T121) * R23 / (1.0f - R123);
  const float amplitude = __builtin_sqrtf(R123);
  Vec3f sum = splat3(R12 + R_s);
  float C = R_s - T121;
  for (int m = 1; m <= 3; ++m) {
    C *= amplitude;
    const auto order = static_cast<float>(m);
    sum += thin_film_sensitivity(order * path_nm, order * phase) * (2.0f * C);
  }
  return sum;
}

/// Thinner films do not interfere in this approximation, and are faded to none.
inline constexpr float kThinFilmFadeNanometres = 30.0f;

/// Reflectance of a dielectric under a thin film, linear Rec.709.
/// @param eta           index of the surface over that of the outside
/// @param film_ior      of the film, over the outside's
/// @param thickness_nm  nanometres
/// @source              [BB], Belcour and Barla 2017, "A Practical Extension to Microfacet Theory for the Modeling of
///                      Varying Iridescence". XYZ becomes RGB by the white point E scaled to D65, as in Cycles
RELIEF_KERNEL Vec3f fresnel_thin_film(float cos_i, float eta, float film_ior, float thickness_nm)
{
  const float t = clamp(thickness_nm / kThinFilmFadeNanometres, 0.0f, 1.0f);
  const float film = lerp(t * t * (3.0f - 2.0f * t), 1.0f, film_ior);
  const PolarizedReflection top = fresnel_polarized(cos_i, film);
  if (!(top.cos_t > 0.0f)) return splat3(1.0f);
  const PolarizedReflection bottom = fresnel_polarized(top.cos_t, eta / film);
  if (!(bottom.cos_t > 0.0f)) return splat3(1.0f);
  const float path_nm = 2.0f * film * thickness_nm * top.cos_t;
  const Vec3f s = thin_film_airy(top.R_s, bottom.R_s, path_nm, kPi - top.phase_s + bottom.phase_s);
  const Vec3f p = thin_film_airy(top.R_p, bottom.R_p, path_nm, kPi - top.phase_p + bottom.phase_p);
  const Vec3f white = {0.95047f, 1.0f, 1.08883f};
  return min(max(rec709_of_xyz((s + p) * 0.5f * white), splat3(0.0f)), splat3(1.0f));
}

/// Reflectance of a film when the surface's own F0 is set by hand: scaled fully where it is at the real F0 and not at
/// all where it is 1.
/// @param F0  wanted at normal incidence without film
RELIEF_KERNEL Vec3f fresnel_thin_film_scaled(Vec3f F, Vec3f F0, float eta)
{
  const float real = fresnel_F0(eta);
  if (!(real > 1e-5f) || F == splat3(1.0f)) return F;
  const auto scaled = [real](float f, float wanted) {
    const float s = clamp((1.0f - f) / (1.0f - real), 0.0f, 1.0f);
    return f * lerp(s, 1.0f, wanted / real);
  };
  return {scaled(F.x, F0.x), scaled(F.y, F0.y), scaled(F.z, F0.z)};
}

}  // namespace relief
