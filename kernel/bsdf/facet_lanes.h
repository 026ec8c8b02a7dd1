// Microfacets of eight lobes at a time: Beckmann's distribution, refraction, and glass, which chooses between that and reflection.
// Each as in the file of its kind, by the same operations.
#pragma once

#include "kernel/bsdf/lobe_lanes.h"

namespace relief {

/// As beckmann_alpha_tan.
RELIEF_KERNEL F8 beckmann_alpha_tan(F8 alpha_x, F8 alpha_y, const Vec3x8& w)
{
  const F8 x = alpha_x * w.x, y = alpha_y * w.y;
  return sqrt(x * x + y * y) / abs(w.z);
}

/// As beckmann_lambda.
RELIEF_KERNEL F8 beckmann_lambda(F8 alpha_tan)
{
  const F8 a = 1.0f / alpha_tan, none = splat8(0.0f);
  const F8 fit = ((0.396f * a - 1.259f) * a + 1.0f) / ((2.181f * a + 3.535f) * a);
  return alpha_tan < 0.625f ? none : max(fit, none);
}

/// What the error function is less than 1.
/// @param x          ≥ 0
/// @param exp_minus  exp(−x²)
/// @return           within 2e-7
/// @source           Abramowitz and Stegun 7.1.26
RELIEF_KERNEL F8 erf_rest(F8 x, F8 exp_minus)
{
  const F8 t = 1.0f / (1.0f + 0.3275911f * x);
  const F8 p = 0.254829592f + t * (-0.284496736f + t * (1.421413741f + t * (-1.453152027f + t * 1.061405429f)));
  return t * p * exp_minus;
}

/// As beckmann_exact_one_plus_lambda.
RELIEF_KERNEL F8 beckmann_exact_one_plus_lambda(F8 alpha_tan)
{
  constexpr float kInvSqrtPi = 0.56418958f;
  const F8 one = splat8(1.0f), a = min(1.0f / alpha_tan, splat8(1e6f)), e = exp8(-a * a);
  return alpha_tan > 0.0f ? one + 0.5f * (kInvSqrtPi * alpha_tan * e - erf_rest(a, e)) : one;
}

/// As beckmann_D. @param h  any length, h.z > 0
RELIEF_KERNEL F8 beckmann_D(F8 alpha_x, F8 alpha_y, const Vec3x8& h)
{
  const F8 inv_z2 = 1.0f / (h.z * h.z), x = h.x / alpha_x, y = h.y / alpha_y;
  const F8 slope2 = (x * x + y * y) * inv_z2, ratio = dot(h, h) * inv_z2;
  const F8 D = kInvPi / (alpha_x * alpha_y) * exp8(-slope2) * (ratio * ratio);
  // Where an exponential of floats is none.
  return slope2 < 87.0f ? D : splat8(0.0f);
}

/// As beckmann_eval. @pre  wo.z + wi.z > 0 where it counts
[[gnu::noinline]] RELIEF_KERNEL F8
beckmann_eval(F8 alpha_x, F8 alpha_y, SmithMasking masking, const Vec3x8& wo, const Vec3x8& wi, F8& pdf)
{
  const F8 D = beckmann_D(alpha_x, alpha_y, wo + wi), tan_o = beckmann_alpha_tan(alpha_x, alpha_y, wo);
  const F8 lambda_o = beckmann_lambda(tan_o), lambda_i = beckmann_lambda(beckmann_alpha_tan(alpha_x, alpha_y, wi));
  const F8 masked =
      masking == SmithMasking::kSeparable ? (1.0f + lambda_o) * (1.0f + lambda_i) : 1.0f + lambda_o + lambda_i;
  pdf = 0.25f * D / (wo.z * beckmann_exact_one_plus_lambda(tan_o));
  return 0.25f * D / (wo.z * abs(wi.z) * masked);
}

/// As erf_inverse. @param x  (−1, 1); clamped next to the ends
RELIEF_KERNEL F8 erf_inverse(F8 x)
{
  const F8 a = min(abs(x), splat8(0.99999994f));
  const F8 w = -log8((1.0f - a) * (1.0f + a));
  const F8 t = w - 2.5f, s = sqrt(max(w, splat8(0.0f))) - 3.0f;
  F8 p = splat8(kErfInverseNear[0]), q = splat8(kErfInverseFar[0]);
  for (int i = 1; i < 9; ++i) {
    p = kErfInverseNear[i] + p * t;
    q = kErfInverseFar[i] + q * s;
  }
  return (w < 5.0f ? p : q) * x;
}

/// As beckmann_visible_slope.
/// @param wanted  lanes that count: others are anything
RELIEF_KERNEL F8 beckmann_visible_slope(F8 tan_o, F8 u, I8 wanted)
{
  constexpr float kInvSqrtPi = 0.56418958f;
  const F8 one = splat8(1.0f), K = tan_o * kInvSqrtPi, cot = min(1.0f / tan_o, splat8(1e6f));
  const F8 e = exp8(-cot * cot), b_end = one - erf_rest(cot, e);
  const F8 target = u * (1.0f + b_end + K * e);
  const F8 rough_target = u * (1.0f + b_end + K * (1.0f - b_end * b_end));
  F8 low = -one, high = b_end;
  F8 b = K > 1e-4f ? (0.5f - safe_sqrt(K * (K - rough_target + 1.0f) + 0.25f)) / K : rough_target - 1.0f;
  b = min(max(b, low), high);
  F8 slope = erf_inverse(b);
  for (int i = 0; i < 10; ++i) {
    const F8 value = 1.0f + b + K * exp8(-slope * slope) - target;
    wanted &= abs(value) > 1e-6f * (1.0f + target);
    if (mask_of(wanted) == 0) break;
    low = value < 0.0f ? b : low;
    high = value < 0.0f ? high : b;
    const F8 next = b - value / (1.0f - slope * tan_o);
    b = wanted ? (((next > low) & (next < high)) ? next : 0.5f * (low + high)) : b;
    slope = wanted ? erf_inverse(b) : slope;
  }
  return slope;
}

/// As beckmann_visible_normal.
/// @param wanted  lanes that count
[[gnu::noinline]] RELIEF_KERNEL Vec3x8
beckmann_visible_normal(F8 alpha_x, F8 alpha_y, const Vec3x8& wo, F8 u_x, F8 u_y, I8 wanted)
{
  const F8 x = wo.x * alpha_x, y = wo.y * alpha_y, across = sqrt(x * x + y * y), tan_o = across / wo.z;
  const I8 is_tilted = tan_o > 1e-4f;
  const F8 cos_phi = is_tilted ? x / across : splat8(1.0f), sin_phi = is_tilted ? y / across : splat8(0.0f);
  const F8 slope = beckmann_visible_slope(tan_o, u_x, wanted & is_tilted);
  const F8 along = is_tilted ? slope : erf_inverse(2.0f * u_x - 1.0f), sideways = erf_inverse(2.0f * u_y - 1.0f);
  return normalize(Vec3x8{-alpha_x * (cos_phi * along - sin_phi * sideways),
                          -alpha_y * (sin_phi * along + cos_phi * sideways), splat8(1.0f)});
}

/// As beckmann_sample.
RELIEF_KERNEL Vec3x8 beckmann_sample(F8 alpha_x, F8 alpha_y, const Vec3x8& wo, F8 u_x, F8 u_y, I8 wanted)
{
  const Vec3x8 wm = beckmann_visible_normal(alpha_x, alpha_y, wo, u_x, u_y, wanted);
  return 2.0f * dot(wo, wm) * wm - wo;
}

/// A normal of lobes' microfacets as wo sees them, of the distribution that their column has.
/// @param wanted  lanes that count
RELIEF_KERNEL Vec3x8 lobe_column_visible_normal(const LobeColumn& lobe, const Vec3x8& wo, F8 u_x, F8 u_y, I8 wanted)
{
  const F8 alpha_x = load8(lobe.shape[0]), alpha_y = load8(lobe.shape[1]);
  return lobe.is.is_beckmann ? beckmann_visible_normal(alpha_x, alpha_y, wo, u_x, u_y, wanted)
                             : ggx_anisotropic_visible_normal(alpha_x, alpha_y, wo, u_x, u_y);
}

/// As refracted_cosine.
RELIEF_KERNEL F8 refracted_cosine(F8 cos_i, F8 eta) { return safe_sqrt(1.0f - (1.0f - cos_i * cos_i) / (eta * eta)); }

/// As refract, normalised; straight on where indices match.
RELIEF_KERNEL Vec3x8 refracted(const Vec3x8& wo, const Vec3x8& m, F8 cos_o, F8 eta)
{
  const F8 inv_eta = 1.0f / eta;
  const Vec3x8 bent = (cos_o * inv_eta - refracted_cosine(cos_o, eta)) * m - wo * inv_eta;
  return select(abs(eta - 1.0f) < kMatchedEta, -wo, normalize(bent));
}

/// What refraction through microfacets sends to directions.
struct Refracted8 {
  F8 f, pdf;  ///< as of microfacet_refraction_eval; 0 where no microfacet connects the directions
  F8 cos_o;   ///< between wo and the microfacet
};

/// As microfacet_refraction_eval of closures. @pre  wi.z < 0 where it counts
RELIEF_KERNEL Refracted8 lobe_column_refract(const LobeColumn& lobe, const Vec3x8& wo, const Vec3x8& wi)
{
  const F8 alpha = load8(lobe.shape[0]), eta = load8(lobe.eta), one = splat8(1.0f), none = splat8(0.0f);
  const Vec3x8 across = wo + eta * wi, h = select(eta > 1.0f, -across, across), below = -wi;
  const F8 inv_length = 1.0f / length(h), cos_o = dot(wo, h) * inv_length, cos_i = dot(below, h) * inv_length;
  F8 D, lambda_o, lambda_i, one_plus_lambda_pdf;
  if (lobe.is.is_beckmann) {
    const F8 tan_o = beckmann_alpha_tan(alpha, alpha, wo);
    D = beckmann_D(alpha, alpha, h);
    lambda_o = beckmann_lambda(tan_o);
    lambda_i = beckmann_lambda(beckmann_alpha_tan(alpha, alpha, below));
    one_plus_lambda_pdf = beckmann_exact_one_plus_lambda(tan_o);
  } else {
    const F8 a2 = alpha * alpha;
    const auto lambda = [&](F8 z) {
      const F8 stretch = a2 * (1.0f - z * z);
      return 0.5f * stretch / (z * (z + sqrt(z * z + stretch)));
    };
    const F8 ratio = dot(h, h) / (h.x * h.x + h.y * h.y + a2 * h.z * h.z);
    D = a2 * kInvPi * (ratio * ratio);
    lambda_o = lambda(wo.z);
    lambda_i = lambda(below.z);
    one_plus_lambda_pdf = one + lambda_o;
  }
  const F8 masked =
      lobe.is.masking == SmithMasking::kSeparable ? (1.0f + lambda_o) * (1.0f + lambda_i) : 1.0f + lambda_o + lambda_i;
  const F8 stretched = eta * inv_length, common = D * cos_o * cos_i * (stretched * stretched) / wo.z;
  const I8 is_connected = (below.z > 0.0f) & (h.z > 0.0f) & (cos_o > 0.0f) & (cos_i > 0.0f);
  return {is_connected ? common / (below.z * masked) : none, is_connected ? common / one_plus_lambda_pdf : none,
          min(cos_o, one)};
}

/// What lobes of a column send to directions, colours and all but the lobes' weights.
struct ColumnEval8 {
  Vec3x8 f;
  F8 pdf;
};

/// As lobe_eval of lobes that let light through.
/// @param is_through  wi goes through the surface
[[gnu::noinline]] RELIEF_KERNEL ColumnEval8 lobe_column_eval_through(const LobeColumn& lobe,
                                                                     const Vec3x8& wo,
                                                                     const Vec3x8& wi,
                                                                     I8 is_through)
{
  const F8 one = splat8(1.0f), none = splat8(0.0f);
  if (lobe.is.kind == MixtureLobeKind::kTranslucent) {
    const F8 f = wi.z < 0.0f ? splat8(kInvPi) : none;
    return {{f, f, f}, kInvPi * max(-wi.z, none)};
  }
  const Refracted8 refracted = lobe_column_refract(lobe, wo, wi);
  if (lobe.is.kind == MixtureLobeKind::kRefraction) return {{refracted.f, refracted.f, refracted.f}, refracted.pdf};
  const F8 eta = load8(lobe.eta);
  const Vec3x8 left = Vec3x8{one, one, one} - lobe_column_fresnel(lobe, refracted.cos_o);
  ColumnEval8 e{multiplied(load8(lobe.through), not_negative(left)) * refracted.f,
                (1.0f - fresnel_dielectric_at(refracted.cos_o, eta)) * refracted.pdf};
  if (mask_of(~is_through) != 0) {
    const F8 alpha = load8(lobe.shape[0]), cos_d = half_angle_cosine(wo, wi);
    F8 pdf;
    const F8 f = lobe.is.is_beckmann ? beckmann_eval(alpha, alpha, lobe.is.masking, wo, wi, pdf)
                                     : ggx_anisotropic_eval(alpha, alpha, lobe.is.masking, wo, wi, pdf);
    const I8 is_seen = wo.z + wi.z > 0.0f;
    const Vec3x8 reflected = multiplied(load8(lobe.edge), lobe_column_fresnel(lobe, cos_d)) * f;
    e.f = select(is_through, e.f, select(is_seen, reflected, Vec3x8{none, none, none}));
    e.pdf = is_through ? e.pdf : is_seen ? fresnel_dielectric_at(cos_d, eta) * pdf : none;
  }
  return e;
}

/// Directions that lobes of a column sample.
struct ColumnSample8 {
  Vec3x8 wi;           ///< the lobe's frame
  I8 is_through;       ///< they are meant for the far side
  I8 is_lost;          ///< but are on the wrong one, or nowhere
  Vec3x8 reflectance;  ///< of delta lobes: share of the light that goes this way
  F8 probability;      ///< likewise, once the lobe is chosen
};

/// As lobe_sample of lobes that let light through.
/// @param cosine   warp_cosine_hemisphere of u
/// @param u_branch  between reflection and refraction
/// @param wanted   lanes that count
[[gnu::noinline]] RELIEF_KERNEL ColumnSample8 lobe_column_sample_through(const LobeColumn& lobe,
                                                                         const Vec3x8& wo,
                                                                         const Vec3x8& cosine,
                                                                         F8 u_x,
                                                                         F8 u_y,
                                                                         F8 u_branch,
                                                                         I8 wanted)
{
  const F8 one = splat8(1.0f), none = splat8(0.0f);
  const Vec3x8 white{one, one, one};
  if (lobe.is.kind == MixtureLobeKind::kTranslucent) {
    return {{cosine.x, cosine.y, -cosine.z}, ~I8{}, ~(cosine.z > 0.0f), white, one};
  }
  const I8 is_delta = load8(lobe.is_delta);
  Vec3x8 wm{none, none, one};
  if (mask_of(wanted & ~is_delta) != 0) {
    wm = select(is_delta, wm, lobe_column_visible_normal(lobe, wo, u_x, u_y, wanted & ~is_delta));
  }
  const F8 eta = load8(lobe.eta), cos_o = min(one, dot(wo, wm));
  const Vec3x8 through = refracted(wo, wm, cos_o, eta);
  if (lobe.is.kind == MixtureLobeKind::kRefraction) {
    const I8 is_refracted = (cos_o > 0.0f) & (refracted_cosine(cos_o, eta) > 0.0f) & (through.z < 0.0f);
    return {through, ~I8{}, ~is_refracted, white, one};
  }
  const F8 chance = fresnel_dielectric_at(cos_o, eta);
  const I8 is_through = u_branch >= chance;
  const Vec3x8 wi = select(is_through, through, 2.0f * cos_o * wm - wo), F = lobe_column_fresnel(lobe, cos_o);
  const I8 strays = is_through ? ~(wi.z < 0.0f) : lobe.is.mirrors_below ? I8{} : wi.z < 0.0f;
  return {wi, is_through, ~(cos_o > 0.0f) | strays,
          select(is_through, multiplied(load8(lobe.through), not_negative(white - F)), multiplied(load8(lobe.edge), F)),
          is_through ? 1.0f - chance : chance};
}

}  // namespace relief
