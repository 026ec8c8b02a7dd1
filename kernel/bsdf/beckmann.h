// Beckmann microfacets, isotropic or not: distribution, masking, visible normals, reflection. Fresnel is the caller's.
//
// Walter et al. 2007 [W]; Heitz 2014 [H]; Heitz and d'Eon 2014, "Importance Sampling Microfacet-Based BSDFs using the
// Distribution of Visible Normals"; Jakob 2014, "An Improved Visible Normal Sampling Routine for the Beckmann
// Distribution" [J].
#pragma once

#include "kernel/bsdf/ggx_anisotropic.h"
#include "kernel/bsdf/mixture_traits.h"

namespace relief {

struct Beckmann {
  static constexpr MixtureTraits kTraits = kReflectingMicrofacets;
  AnisotropicAlpha alpha;
  SmithMasking masking = SmithMasking::kSeparable;
};

/// Density of microfacet normals per unit of projected area. @param h  any length, h.z > 0
RELIEF_KERNEL float beckmann_D(AnisotropicAlpha a, Vec3f h)
{
  const float inv_z2 = 1.0f / (h.z * h.z);
  const float slope2 = (sqr(h.x / a.x) + sqr(h.y / a.y)) * inv_z2;
  return kInvPi / (a.x * a.y) * std::exp(-slope2) * sqr(length_squared(h) * inv_z2);
}

/// Tangent of w over what the roughness stretches, > 0 unless w is the normal.
RELIEF_KERNEL float beckmann_alpha_tan(AnisotropicAlpha a, Vec3f w)
{
  return __builtin_sqrtf(sqr(a.x * w.x) + sqr(a.y * w.y)) / __builtin_fabsf(w.z);
}

/// Smith's Λ by the rational fit that Cycles uses; 1 + Λ is within 0.32 % of the truth.
/// @source [H] below Eq. 69; one over one plus it is the fit of G1 of [W]
RELIEF_KERNEL float beckmann_lambda(float alpha_tan)
{
  // a > 1.6, where the fit crosses zero.
  if (alpha_tan < 0.625f) return 0.0f;
  const float a = 1.0f / alpha_tan;
  return max(0.0f, ((0.396f * a - 1.259f) * a + 1.0f) / ((2.181f * a + 3.535f) * a));
}

/// One plus Λ without a fit: what the density of visible normals needs.
/// @source [H] Eq. 68
RELIEF_KERNEL float beckmann_exact_one_plus_lambda(float alpha_tan)
{
  constexpr float kInvSqrtPi = 0.56418958f;
  if (!(alpha_tan > 0.0f)) return 1.0f;
  const float a = 1.0f / alpha_tan;
  return 0.5f * (1.0f + std::erf(a)) + 0.5f * kInvSqrtPi * alpha_tan * std::exp(-a * a);
}

/// f with reflectance 1.
/// @param wo, wi  unit; wo.z > 0. Below the horizon a sampled wi is masked as above it
/// @param pdf     solid angle of wi under beckmann_sample: by the exact masking, which f's fit misses by up to 0.32 %
RELIEF_KERNEL float beckmann_eval(const Beckmann& lobe, Vec3f wo, Vec3f wi, float* pdf)
{
  *pdf = 0.0f;
  if (!(wo.z + wi.z > 0.0f)) return 0.0f;
  const float D = beckmann_D(lobe.alpha, wo + wi);
  const float tan_o = beckmann_alpha_tan(lobe.alpha, wo);
  const float lambda_o = beckmann_lambda(tan_o), lambda_i = beckmann_lambda(beckmann_alpha_tan(lobe.alpha, wi));
  const float masking =
      lobe.masking == SmithMasking::kSeparable ? (1.0f + lambda_o) * (1.0f + lambda_i) : 1.0f + lambda_o + lambda_i;
  *pdf = 0.25f * D / (wo.z * beckmann_exact_one_plus_lambda(tan_o));
  return 0.25f * D / (wo.z * __builtin_fabsf(wi.z) * masking);
}

/// Coefficients of erf_inverse over its argument, from the highest power down: of −log(1 − x²) − 2.5 up to 5, and beyond of the root − 3.
inline constexpr float kErfInverseNear[9] = {2.81022636e-08f,  3.43273939e-07f, -3.5233877e-06f,
                                             -4.39150654e-06f, 0.00021858087f,  -0.00125372503f,
                                             -0.00417768164f,  0.246640727f,    1.50140941f};
inline constexpr float kErfInverseFar[9] = {-0.000200214257f, 0.000100950558f, 0.00134934322f,
                                            -0.00367342844f,  0.00573950773f,  -0.0076224613f,
                                            0.00943887047f,   1.00167406f,     2.83297682f};

/// Inverse of the error function.
/// @param x  (−1, 1); clamped next to the ends
/// @source   Giles 2010, "Approximating the erfinv function", single precision
RELIEF_KERNEL float erf_inverse(float x)
{
  const float a = min(__builtin_fabsf(x), 0.99999994f);
  const float w = -std::log((1.0f - a) * (1.0f + a));
  const bool is_near = w < 5.0f;
  const float t = is_near ? w - 2.5f : __builtin_sqrtf(w) - 3.0f;
  const float* const c = is_near ? kErfInverseNear : kErfInverseFar;
  float p = c[0];
  for (int i = 1; i < 9; ++i) p = c[i] + p * t;
  return p * x;
}

/// Slope along the view of a visible normal of roughness 1.
/// @param tan_o  tangent of the view, > 0
/// @source       [J]: the distribution function over b = erf(slope), which is monotonic up to b = erf(1 / tan)
RELIEF_KERNEL float beckmann_visible_slope(float tan_o, float u)
{
  constexpr float kInvSqrtPi = 0.56418958f;
  const float K = tan_o * kInvSqrtPi;
  const float cot = 1.0f / tan_o;
  const float b_end = std::erf(cot);
  const float target = u * (1.0f + b_end + K * std::exp(-cot * cot));
  // exp(−slope²) is about 1 − b²: a quadratic equation gives the start.
  const float rough_target = u * (1.0f + b_end + K * (1.0f - b_end * b_end));
  float low = -1.0f, high = b_end;
  float b = K > 1e-4f ? (0.5f - safe_sqrt(K * (K - rough_target + 1.0f) + 0.25f)) / K : rough_target - 1.0f;
  b = clamp(b, low, high);
  float slope = erf_inverse(b);
  // Newton inside a bracket; three or four steps reach the end of the digits, the bound is for grazing views.
  for (int i = 0; i < 10; ++i) {
    const float value = 1.0f + b + K * std::exp(-slope * slope) - target;
    if (!(__builtin_fabsf(value) > 1e-6f * (1.0f + target))) break;
    if (value < 0.0f)
      low = b;
    else
      high = b;
    const float next = b - value / (1.0f - slope * tan_o);
    b = next > low && next < high ? next : 0.5f * (low + high);
    slope = erf_inverse(b);
  }
  return slope;
}

/// Normal of the distribution as seen from wo. @return  unit, z > 0
RELIEF_KERNEL Vec3f beckmann_visible_normal(AnisotropicAlpha alpha, Vec3f wo, Vec2f u)
{
  const float x = wo.x * alpha.x, y = wo.y * alpha.y;
  const float across = __builtin_sqrtf(x * x + y * y);
  const float tan_o = across / wo.z;
  const bool is_tilted = tan_o > 1e-4f;
  const float cos_phi = is_tilted ? x / across : 1.0f, sin_phi = is_tilted ? y / across : 0.0f;
  const float along = is_tilted ? beckmann_visible_slope(tan_o, u.x) : erf_inverse(2.0f * u.x - 1.0f);
  const float sideways = erf_inverse(2.0f * u.y - 1.0f);
  return normalize(
      {-alpha.x * (cos_phi * along - sin_phi * sideways), -alpha.y * (sin_phi * along + cos_phi * sideways), 1.0f});
}

/// @return unit; z <= 0 is a ray lost among the microfacets
RELIEF_KERNEL Vec3f beckmann_sample(const Beckmann& lobe, Vec3f wo, Vec2f u)
{
  const Vec3f wm = beckmann_visible_normal(lobe.alpha, wo, u);
  return 2.0f * dot(wo, wm) * wm - wo;
}

template <TransportMode>
RELIEF_KERNEL BsdfEval lobe_eval(const Beckmann& lobe, const LobeHit& hit, const BsdfTables&, Vec3f wi, bool)
{
  BsdfEval e;
  e.f = splat3(beckmann_eval(lobe, hit.wo, wi, &e.pdf));
  return e;
}

template <TransportMode>
RELIEF_KERNEL LobeSample lobe_sample(const Beckmann& lobe, const LobeHit& hit, float, Vec2f u)
{
  if (hit.is_delta) return lobe_sample_mirror(hit);
  return lobe_sample_glossy(beckmann_sample(lobe, hit.wo, u), false, sqr(hit.roughness));
}

RELIEF_KERNEL bool lobe_widen(Beckmann& lobe, float, float blur)
{
  lobe.alpha = anisotropic_alpha_widened(lobe.alpha, blur);
  return true;
}

}  // namespace relief
