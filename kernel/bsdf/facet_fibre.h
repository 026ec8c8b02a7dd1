// A fibre of glass whose cuticle is a rough, tilted surface of GGX microfacets and whose outline is a circle or an ellipse, with
// pigment inside: the Principled Hair BSDF of Cycles by its model "Huang". Unlike in fibre.h light is refracted and mirrored by
// facets, and what a strand does as a whole is the integral over all places across it that the pixel sees: R, TT and TRT, and the
// rest as a distribution that is even around the fibre.
//
// The integrals of TT and TRT have five dimensions. They are estimated, with random numbers that follow from the question itself. The
// directions that are sampled follow a density of their own in closed form, which looks like the lobes: fans of mirrored and
// refracted light, blurred.
//
// Huang, Hullin and Hanika 2022, "A Microfacet-based Hair Scattering Model" [H]; numbers and the rest's share are those of Cycles 5.2.
//
// Frame as in hair.h, and angles around the fibre as in fibre.h; but they are counted from the ellipse's smaller axis, from which wo
// is turned by `turn`. A place on the outline is its angle γ there: the point (sin γ, aspect cos γ).
#pragma once

#include "kernel/bsdf/energy_tables.h"
#include "kernel/bsdf/fibre.h"
#include "kernel/bsdf/ggx_anisotropic.h"
#include "kernel/sample/sobol.h"
#include "kernel/texture/half.h"

namespace relief {

/// The index of refraction is that of the hit's Fresnel term.
struct FacetFibre {
  static constexpr MixtureTraits kTraits{.sides = LobeSides::kSphere,
                                         .is_diffuse = false,
                                         .fading = LobeFading::kNever,
                                         .is_strand = true};
  Vec3f sigma{};                ///< absorption over the fibre's radius
  float alpha = 0.3f;           ///< of the facets
  float tilt = 0;               ///< of the cuticle's scales against the fibre, radians
  float aspect = 1;             ///< smaller axis over the larger one
  float turn = 0;               ///< radians
  float low = -1, high = 1;     ///< which part of the fibre is seen, from one edge, -1, to the other
  std::uint16_t gains[3] = {};  ///< of R, TT and TRT: halves
  std::uint16_t seed = 0;
};

/// Random numbers that follow from a question.
struct FacetFibreRandom {
  std::uint32_t state;

  float next()
  {
    state += 0x9e3779b9u;
    return unit_float(hash_mix_32(state));
  }
  Vec2f next2()
  {
    const float x = next();
    return {x, next()};
  }
};

RELIEF_KERNEL FacetFibreRandom facet_fibre_random(const FacetFibre& fibre, Vec3f wo, Vec3f wi)
{
  std::uint32_t state = fibre.seed;
  for (const float x : {wo.x, wo.z, fibre.turn, wi.x, wi.y, wi.z}) {
    state = hash_mix_32(state * 0x85ebca6bu + __builtin_bit_cast(std::uint32_t, x));
  }
  return {state};
}

/// Angle of the outline's normal at a place.
RELIEF_KERNEL float ellipse_normal(float aspect, float place)
{
  return aspect == 1.0f ? place : std::atan2(aspect * std::sin(place), std::cos(place));
}

/// Place where the outline's normal has an angle.
RELIEF_KERNEL float ellipse_place(float aspect, float normal)
{
  return aspect == 1.0f ? normal : std::atan2(std::sin(normal), aspect * std::cos(normal));
}

/// Length of the outline an angle of its places.
RELIEF_KERNEL float ellipse_arc(float aspect, float place)
{
  return aspect == 1.0f ? 1.0f : __builtin_sqrtf(1.0f - (1.0f - sqr(aspect)) * sqr(std::sin(place)));
}

/// Half of the outline's width as seen from an angle.
RELIEF_KERNEL float ellipse_radius(float aspect, float angle)
{
  return __builtin_sqrtf(1.0f - (1.0f - sqr(aspect)) * sqr(std::sin(angle)));
}

/// Place that is seen from an angle. @param across  from one edge, -1, to the other
/// @source  [H] Section 4
RELIEF_KERNEL float ellipse_place_seen(float aspect, float angle, float across)
{
  return std::atan2(std::cos(angle), -aspect * std::sin(angle)) - std::acos(clamp(-across, -1.0f, 1.0f));
}

/// Distance between two places, in the fibre's radius.
RELIEF_KERNEL float ellipse_chord(float aspect, float a, float b)
{
  return __builtin_sqrtf(sqr(std::sin(a) - std::sin(b)) + sqr(aspect * (std::cos(a) - std::cos(b))));
}

RELIEF_KERNEL Vec3f fibre_direction(float tilt, float angle)
{
  const float c = std::cos(tilt);
  return {std::sin(tilt), -c * std::sin(angle), c * std::cos(angle)};
}

/// A direction as it is counted from the ellipse's axis.
RELIEF_KERNEL Vec3f facet_fibre_turned(Vec3f w, float turn)
{
  if (turn == 0.0f) return w;
  const float s = std::sin(turn), c = std::cos(turn);
  return {w.x, w.y * c - w.z * s, w.z * c + w.y * s};
}

/// Where light meets the cuticle.
struct FibreBoundary {
  float place;
  Vec3f macro, meso;  ///< normals of outline and scale
};

RELIEF_KERNEL FibreBoundary fibre_boundary(const FacetFibre& fibre, float place, float tilt)
{
  const float angle = ellipse_normal(fibre.aspect, place);
  return {place, fibre_direction(0.0f, angle), fibre_direction(tilt, angle)};
}

RELIEF_KERNEL bool facet_sees(Vec3f w, const FibreBoundary& at, Vec3f facet)
{
  return dot(w, facet) > 0.0f && dot(w, at.meso) > 0.0f && dot(w, at.macro) > 0.0f;
}

/// A facet as it is seen from a direction above the scale.
RELIEF_KERNEL Vec3f fibre_facet_sample(float alpha, const FibreBoundary& at, Vec3f w, Vec2f u)
{
  const Frame frame = frame_from_normal(at.meso);
  return from_local(frame, ggx_anisotropic_visible_normal({alpha, alpha}, to_local(frame, w), u));
}

/// Density of facets by the cosine between them and the scale.
RELIEF_KERNEL float fibre_facet_D(float alpha, float cosine)
{
  const float a2 = sqr(alpha), c2 = sqr(min(cosine, 1.0f));
  return a2 * kInvPi / sqr(1.0f - c2 + a2 * c2);
}

/// Facets that are seen from both sides over those that are seen from one.
RELIEF_KERNEL float fibre_facet_seen(float alpha, float cos_one, float cos_other)
{
  const float one = ggx_lambda(cos_one, alpha), other = ggx_lambda(cos_other, alpha);
  return (1.0f + one) / (1.0f + one + other);
}

/// The same over all.
RELIEF_KERNEL float fibre_facet_G(float alpha, float cos_one, float cos_other)
{
  return 1.0f / (1.0f + ggx_lambda(cos_one, alpha) + ggx_lambda(cos_other, alpha));
}

/// What facets give back that was lost among them.
struct FibreEnergy {
  const BsdfTables* tables;
  GlassCoordinate outside, inside;

  float factor(const GlassCoordinate& g, float cosine) const
  {
    return 1.0f / (1.0f - glass_lost(*tables, g, g.side, cosine));
  }
};

/// Direction of refraction.
/// @param w      where light comes from, on the facet's side
/// @param cos_t  refracted_cosine
RELIEF_KERNEL Vec3f refracted(Vec3f w, Vec3f facet, float cos_i, float cos_t, float eta)
{
  return (cos_i / eta - cos_t) * facet - w / eta;
}

/// Integral of R over the places that are seen; without what divides all.
/// @source  [H] Eq. 9, over angles that lie as densely as the facets do that reflect
RELIEF_KERNEL float facet_fibre_R(const FacetFibre& fibre,
                                  const FibreEnergy& energy,
                                  float eta,
                                  Vec3f wo,
                                  Vec3f wi,
                                  float shift)
{
  constexpr int kAngles = 8;
  const Vec3f sum = wo + wi;
  const float size = length(sum);
  if (!(size > 1e-6f)) return 0.0f;
  const Vec3f wh = sum / size;
  const float alpha = fibre.alpha, aspect = fibre.aspect;
  const float middle = fibre_angle(wh), cos_h = safe_sqrt(1.0f - sqr(wh.x));
  const float cos_tilt = std::cos(fibre.tilt), sin_tilt = std::sin(fibre.tilt);
  const float together = max(cos_h * cos_tilt, 1e-6f);
  const float off = 1.0f - (wh.x * sin_tilt + together);  // of the scale that is nearest
  const float width = __builtin_sqrtf((sqr(alpha) + 2.0f * max(off, 0.0f)) / together);
  // The ends, as seen from the middle.
  const auto from_middle = [&](float across) {
    return ellipse_normal(aspect, ellipse_place_seen(aspect, fibre.turn, across)) - middle;
  };
  constexpr float kTurn = 2.0f * kPi;
  float begin = from_middle(fibre.high), end = from_middle(fibre.low);
  end += begin > end ? kTurn : 0.0f;
  const float back = kTurn * __builtin_floorf(0.5f + 0.5f * (begin + end) / kTurn);
  begin = max(begin - back, -0.5f * kPi);
  end = min(end - back, 0.5f * kPi);
  if (!(begin < end)) return 0.0f;
  const float first = std::atan(begin / width), step = (std::atan(end / width) - first) / kAngles;
  float integral = 0;
  for (int i = 0; i < kAngles; ++i) {
    const float t = std::tan(first + (static_cast<float>(i) + shift) * step);
    const float angle = middle + width * t;
    const Vec3f macro = fibre_direction(0.0f, angle);
    const Vec3f meso{sin_tilt, cos_tilt * macro.y, cos_tilt * macro.z};
    const float cos_o = dot(meso, wo), cos_i = dot(meso, wi);
    if (!(cos_o > 0.0f && cos_i > 0.0f && dot(macro, wo) > 0.0f && dot(macro, wi) > 0.0f)) continue;
    // The outline that has normals within an angle.
    const float bend = aspect / (sqr(aspect * std::cos(angle)) + sqr(std::sin(angle)));
    const float arc = aspect == 1.0f ? 1.0f : bend * ellipse_arc(aspect, ellipse_place(aspect, angle));
    integral += fibre_facet_D(alpha, dot(meso, wh)) * fibre_facet_G(alpha, cos_o, cos_i) *
                energy.factor(energy.outside, cos_o) * arc * (dot(macro, wo) / cos_o) * (1.0f + sqr(t));
  }
  return 0.25f * fresnel_dielectric_at(min(dot(wo, wh), 1.0f), eta) * integral * step * width;
}

/// Light on its way through the fibre for the first time.
struct FibreInside {
  float share;   ///< of what meets the first boundary, before it is absorbed
  Vec3f wt;      ///< direction of its way
  Vec3f passed;  ///< what pigment leaves
  FibreBoundary far;
  float cos_far;  ///< between that and where light comes from
  float energy;   ///< of the far boundary
};

/// Refracts light at the first boundary.
/// @param near   where it meets the fibre, seen from wo
/// @param facet  that it meets
/// @return       whether it gets in and to the far boundary
RELIEF_KERNEL bool facet_fibre_enter(const FacetFibre& fibre,
                                     const FibreEnergy& energy,
                                     float eta,
                                     Vec3f wo,
                                     const FibreBoundary& near,
                                     Vec3f facet,
                                     FibreInside& in)
{
  const float cos_o = dot(wo, near.meso), cos_i = dot(wo, facet), cos_t = refracted_cosine(cos_i, eta);
  in.wt = refracted(wo, facet, cos_i, cos_t, eta);
  if (!facet_sees(wo, near, facet) || !facet_sees(-in.wt, near, facet)) return false;
  const float angle = fibre_angle(in.wt);
  in.far = fibre_boundary(fibre, 2.0f * ellipse_normal(fibre.aspect, angle) - near.place, -fibre.tilt);
  in.cos_far = -dot(in.wt, in.far.meso);
  if (!(in.cos_far > kMinCosine)) return false;
  in.share = (1.0f - fresnel_dielectric(cos_i, cos_t, eta)) * energy.factor(energy.outside, cos_o) *
             fibre_facet_seen(fibre.alpha, cos_o, -dot(in.wt, near.meso));
  in.energy = energy.factor(energy.inside, in.cos_far);
  const float cos_tilt = max(safe_sqrt(1.0f - sqr(in.wt.x)), 1e-4f);
  in.passed = exp(fibre.sigma * (-ellipse_chord(fibre.aspect, near.place, in.far.place + kPi) / cos_tilt));
  return true;
}

/// What leaves through a boundary in a direction, of what comes to it from inside.
/// @param w  back to where light comes from, on the boundary's side
/// @return   density of solid angle, times the square of the index ratio; 0: facets do not refract so
RELIEF_KERNEL float facet_fibre_leave(float alpha, float eta, const FibreBoundary& at, Vec3f w, Vec3f wi)
{
  const float inverse = 1.0f / eta;
  if (!(-dot(w, wi) > inverse)) return 0.0f;
  const Vec3f sum = w + wi * inverse;
  const float size_squared = length_squared(sum);
  const Vec3f facet = sum / __builtin_sqrtf(size_squared);
  const float cos_facet = dot(at.meso, facet), cos_w = dot(w, at.meso), cos_i = -dot(wi, at.meso);
  if (!(cos_facet > 0.0f && cos_i > kMinCosine) || !facet_sees(w, at, facet) || !facet_sees(-wi, at, facet))
    return 0.0f;
  const float cos_in = dot(w, facet), cos_out = -dot(wi, facet);
  const float T = 1.0f - fresnel_dielectric_at(min(cos_in, 1.0f), inverse);
  return T * fibre_facet_D(alpha, cos_facet) * fibre_facet_G(alpha, cos_w, cos_i) * cos_in * cos_out / size_squared;
}

/// Share of the light that came to the third boundary that is mirrored there, and leaves somewhere at last.
/// @param w       back to where it comes from
/// @param facet   that it meets
/// @param before  reflectance of the second boundary
/// @param passed  what pigment left on both ways
/// @source  a series as of [C], as Cycles samples it
RELIEF_KERNEL Vec3f
facet_fibre_rest(float alpha, float eta, const FibreBoundary& at, Vec3f w, Vec3f facet, float before, Vec3f passed)
{
  const float cos_facet = dot(w, facet), cos_on = dot(2.0f * cos_facet * facet - w, at.meso);
  if (!(cos_facet > 0.0f && cos_on > 0.0f)) return {};
  const float R = fresnel_dielectric_at(min(cos_facet, 1.0f), 1.0f / eta);
  // None of it is lost to what cannot leave.
  const float T = max(1.0f - 0.5f * (before + R), 1e-5f);
  const Vec3f A{__builtin_sqrtf(passed.x), __builtin_sqrtf(passed.y), __builtin_sqrtf(passed.z)};
  return A * (R * T * fibre_facet_seen(alpha, dot(w, at.meso), cos_on)) / (splat3(1.0f) - A * (1.0f - T));
}

/// Light after it was mirrored inside.
struct FibreMirrored {
  float share;   ///< of what came to the second boundary, with what facets of the third give back
  float R;       ///< of the second boundary's facet
  Vec3f back;    ///< where it then comes from
  Vec3f passed;  ///< what pigment leaves on its way
  FibreBoundary last;
};

/// Mirrors light at the second boundary.
/// @return  whether it comes to the third
RELIEF_KERNEL bool facet_fibre_mirror(const FacetFibre& fibre,
                                      const FibreEnergy& energy,
                                      float eta,
                                      const FibreInside& in,
                                      Vec3f facet,
                                      FibreMirrored& m)
{
  const float cos_facet = -dot(in.wt, facet);
  m.back = -in.wt - 2.0f * cos_facet * facet;
  if (!facet_sees(-in.wt, in.far, facet) || !facet_sees(-m.back, in.far, facet)) return false;
  m.last =
      fibre_boundary(fibre, 2.0f * ellipse_normal(fibre.aspect, fibre_angle(m.back)) - in.far.place + kPi, -fibre.tilt);
  const float cos_last = dot(m.back, m.last.meso);
  if (!(cos_last > kMinCosine)) return false;
  m.R = fresnel_dielectric_at(min(cos_facet, 1.0f), 1.0f / eta);
  m.share = m.R * in.energy * fibre_facet_seen(fibre.alpha, in.cos_far, -dot(m.back, in.far.meso)) *
            energy.factor(energy.inside, cos_last);
  const float cos_tilt = max(safe_sqrt(1.0f - sqr(m.back.x)), 1e-4f);
  m.passed = exp(fibre.sigma * (-ellipse_chord(fibre.aspect, m.last.place, in.far.place) / cos_tilt));
  return true;
}

struct FibreResidual {
  Vec3f refracted;  ///< TT and TRT, times the square of the index
  Vec3f rest;       ///< share of the light that is mirrored inside more often
};

/// Estimates what of the light that entered at a place is mirrored inside.
/// @param weight  light that meets the place
/// @source        [H] Eq. 14
RELIEF_KERNEL void facet_fibre_add_mirrored(const FacetFibre& fibre,
                                            const FibreEnergy& energy,
                                            float eta,
                                            const FibreInside& in,
                                            Vec3f wi,
                                            float weight,
                                            FacetFibreRandom& random,
                                            FibreResidual& sum)
{
  FibreMirrored m;
  const Vec3f second = fibre_facet_sample(fibre.alpha, in.far, -in.wt, random.next2());
  if (!facet_fibre_mirror(fibre, energy, eta, in, second, m)) return;
  const Vec3f passed = in.passed * m.passed;
  const float share = weight * in.share * m.share;
  const Vec3f third = fibre_facet_sample(fibre.alpha, m.last, m.back, random.next2());
  sum.rest += passed * facet_fibre_rest(fibre.alpha, eta, m.last, m.back, third, m.R, passed) * share;
  const float out = facet_fibre_leave(fibre.alpha, eta, m.last, m.back, wi);
  sum.refracted += passed * (float_from_half(fibre.gains[2]) * share * out / dot(m.back, m.last.meso));
}

/// Variance of the tilts of the rest.
RELIEF_KERNEL float facet_fibre_rest_variance(const FacetFibre& fibre) { return 4.0f * fibre.alpha; }

/// Estimates f · cos.
/// @param wo, wi  as of the lobe; wo.y = 0
RELIEF_KERNEL Vec3f facet_fibre_f(const FacetFibre& fibre, float eta, const BsdfTables& tables, Vec3f wo, Vec3f wi)
{
  const float cos_o = safe_sqrt(1.0f - sqr(wo.x)), span = fibre.high - fibre.low;
  if (!(cos_o > 1e-4f && span > 0.0f)) return {};
  FacetFibreRandom random = facet_fibre_random(fibre, wo, wi);
  const Vec3f o = facet_fibre_turned(wo, fibre.turn), i = facet_fibre_turned(wi, fibre.turn);
  const float roughness = __builtin_sqrtf(fibre.alpha);
  const FibreEnergy energy{&tables, glass_coordinate(eta, roughness), glass_coordinate(1.0f / eta, roughness)};
  Vec3f sum = splat3(float_from_half(fibre.gains[0]) * facet_fibre_R(fibre, energy, eta, o, i, random.next()));

  const float first = ellipse_place_seen(fibre.aspect, fibre.turn, fibre.high);
  const float last = ellipse_place_seen(fibre.aspect, fibre.turn, fibre.low);
  // Places by no more than what facets blur.
  const float range = last - first;
  const int places = static_cast<int>(clamp(__builtin_ceilf(0.6f * range / fibre.alpha), 3.0f, 32.0f));
  const float step = range / static_cast<float>(places);
  const float gain_TT = float_from_half(fibre.gains[1]), gain_TRT = float_from_half(fibre.gains[2]);
  FibreResidual residual;
  for (int k = 0; k < places; ++k) {
    const FibreBoundary near =
        fibre_boundary(fibre, first + (static_cast<float>(k) + random.next()) * step, fibre.tilt);
    if (!(dot(o, near.meso) > kMinCosine)) continue;
    FibreInside in;
    const Vec3f facet = fibre_facet_sample(fibre.alpha, near, o, random.next2());
    if (!facet_fibre_enter(fibre, energy, eta, o, near, facet, in)) continue;
    const float weight = step * ellipse_arc(fibre.aspect, near.place) * dot(o, near.macro);
    // [H] Eq. 12.
    if (gain_TT > 0.0f) {
      const float out = facet_fibre_leave(fibre.alpha, eta, in.far, -in.wt, i);
      residual.refracted += in.passed * (gain_TT * weight * in.share * in.energy * out / in.cos_far);
    }
    if (gain_TRT > 0.0f) facet_fibre_add_mirrored(fibre, energy, eta, in, i, weight, random, residual);
  }
  sum += residual.refracted * sqr(1.0f / eta);
  const float tilts =
      fibre_tilt_density({wi.x, safe_sqrt(1.0f - sqr(wi.x))}, {wo.x, cos_o}, facet_fibre_rest_variance(fibre));
  sum += residual.rest * (tilts * 0.5f * kInvPi);
  // All light that meets the fibre where it is seen.
  const Vec3f f = sum / (cos_o * ellipse_radius(fibre.aspect, fibre.turn) * span);
  return is_finite(f) ? f : Vec3f{};
}

// What is sampled: R, TT and TRT of a fibre whose facets all lie flat, blurred. The places that are seen are a few pieces, each of
// which sends light into a range of angles around the fibre, evenly; the blur about these, and that of the tilts, is how one slope of
// GGX's facets is distributed, whose tails are as long as theirs.

inline constexpr int kFacetFibreFans = 8;

/// Where one lobe sends light.
struct FibreFan {
  float from[kFacetFibreFans], size[kFacetFibreFans];  ///< angles around, from wo
  float weight[kFacetFibreFans];
  float around, along;  ///< width of the blur
  float tilt;           ///< that most light has
};

struct FibreFans {
  FibreFan of[3];  ///< R, TT, TRT
  float rest;      ///< weight of the rest
  float even;      ///< weight of all directions
  float total;
};

/// What is sampled of all directions alike: where two tails meet, fans see too little.
inline constexpr float kFacetFibreEven = 0.05f;

/// Angles around the fibre, counted from its axis, at which flat facets of a place send R, TT and TRT.
RELIEF_KERNEL void fibre_fan_angles(float aspect, float turn, float eta_across, float place, float* angles)
{
  const float normal = ellipse_normal(aspect, place);
  const auto out = [&](float angle) { return asin_clamped(eta_across * std::sin(angle)); };
  angles[0] = 2.0f * normal - turn;
  const float inside = normal + kPi - asin_clamped(std::sin(normal - turn) / eta_across);
  const float far_place = 2.0f * ellipse_normal(aspect, inside) - place;
  const float far = ellipse_normal(aspect, far_place);
  angles[1] = far + kPi + out(inside + kPi - far);
  const float back = 2.0f * far - inside;
  const float last = ellipse_normal(aspect, 2.0f * ellipse_normal(aspect, back) - far_place + kPi);
  angles[2] = last + kPi + out(back - last);
}

RELIEF_KERNEL float turn_within_half(float angle)
{
  constexpr float kTurn = 2.0f * kPi;
  return angle - kTurn * __builtin_floorf(angle / kTurn + 0.5f);
}

RELIEF_KERNEL FibreFans fibre_fans_make(const FacetFibre& fibre, float eta, Vec3f wo)
{
  constexpr float kLeastSize = 1e-3f, kRootOf2 = 1.41421356f;
  const float sin_o = clamp(wo.x, -1.0f, 1.0f), cos_o = max(safe_sqrt(1.0f - sqr(sin_o)), 1e-3f),
              tilt_o = asin_clamped(sin_o);
  const float eta_across = __builtin_sqrtf(max(sqr(eta) - sqr(sin_o), 1e-6f)) / cos_o;
  const float cos_t = max(safe_sqrt(1.0f - sqr(sin_o / eta)), 1e-3f);
  FibreFans fans{};
  // How far slopes of all facets that light meets turn it.
  const float widths[] = {2.0f, kRootOf2 * __builtin_fabsf(eta - 1.0f),
                          __builtin_sqrtf(2.0f * sqr(eta - 1.0f) + 4.0f * sqr(eta))};
  const float tilts[] = {2.0f, -2.0f * (eta - 1.0f), 2.0f - 4.0f * eta};
  for (int p = 0; p < 3; ++p) {
    fans.of[p].along = fans.of[p].around = max(widths[p] * fibre.alpha, 1e-3f);
    fans.of[p].tilt = clamp(tilts[p] * fibre.tilt - tilt_o, -0.5f * kPi, 0.5f * kPi);
  }
  float before[3] = {}, sum = 0;
  for (int k = 0; k <= kFacetFibreFans; ++k) {
    const float across = clamp(lerp(static_cast<float>(k) / kFacetFibreFans, fibre.high, fibre.low), -0.9999f, 0.9999f);
    float angles[3];
    fibre_fan_angles(fibre.aspect, fibre.turn, eta_across, ellipse_place_seen(fibre.aspect, fibre.turn, across),
                     angles);
    if (k > 0) {
      for (int p = 0; p < 3; ++p) {
        const float size = turn_within_half(angles[p] - before[p]);
        fans.of[p].from[k - 1] = before[p] - fibre.turn;
        fans.of[p].size[k - 1] = __builtin_copysignf(max(__builtin_fabsf(size), kLeastSize), size);
      }
      const float middle = lerp((static_cast<float>(k) - 0.5f) / kFacetFibreFans, fibre.high, fibre.low);
      const float place = ellipse_place_seen(fibre.aspect, fibre.turn, middle);
      const float sine = std::sin(ellipse_normal(fibre.aspect, place) - fibre.turn);
      const float F = fresnel_dielectric_at(cos_o * safe_sqrt(1.0f - sqr(sine)), eta);
      const Vec3f A = exp(fibre.sigma * (-2.0f * safe_sqrt(1.0f - sqr(sine / eta_across)) / cos_t));
      const Vec3f TT = sqr(1.0f - F) * A, TRT = TT * A * F;
      fans.of[0].weight[k - 1] = float_from_half(fibre.gains[0]) * F;
      fans.of[1].weight[k - 1] = float_from_half(fibre.gains[1]) * luminance(TT);
      fans.of[2].weight[k - 1] = float_from_half(fibre.gains[2]) * luminance(TRT);
      // Rough facets mirror much more of it than flat ones do.
      constexpr float kRougher = 0.3f;
      fans.rest += luminance(TRT * A) * (F + kRougher * fibre.alpha);
      for (int p = 0; p < 3; ++p) sum += fans.of[p].weight[k - 1];
    }
    for (int p = 0; p < 3; ++p) before[p] = angles[p];
  }
  sum += fans.rest;
  fans.even = sum > 0.0f ? kFacetFibreEven * sum : 1.0f;
  fans.total = sum + fans.even;
  return fans;
}

/// Share of the blur below x, times two, less one, were it not cut off.
RELIEF_KERNEL float fibre_blur_cdf(float x, float width) { return x / __builtin_sqrtf(sqr(x) + sqr(width)); }
RELIEF_KERNEL float fibre_blur_inverse(float share, float width)
{
  return width * share / safe_sqrt(max(1.0f - sqr(share), 1e-12f));
}

/// Share of the blur, which ends after half a turn, below any angle; grows by 1 a turn.
RELIEF_KERNEL float fibre_turns_cdf(float angle, float width)
{
  const float turns = __builtin_floorf(angle / (2.0f * kPi) + 0.5f);
  return turns + 0.5f * fibre_blur_cdf(angle - 2.0f * kPi * turns, width) / fibre_blur_cdf(kPi, width);
}

struct FibreTiltRange {
  float low, high;  ///< of fibre_blur_cdf, from one end of the fibre to the other
};

RELIEF_KERNEL FibreTiltRange fibre_tilt_range(const FibreFan& fan)
{
  return {fibre_blur_cdf(-0.5f * kPi - fan.tilt, fan.along), fibre_blur_cdf(0.5f * kPi - fan.tilt, fan.along)};
}

RELIEF_KERNEL float fibre_fans_pdf(const FacetFibre& fibre, const FibreFans& fans, Vec3f wo, Vec3f wi)
{
  const float angle = fibre_angle(wi), tilt = asin_clamped(wi.x), cos_i = max(safe_sqrt(1.0f - sqr(wi.x)), 1e-6f);
  const FibreTilt o{wo.x, safe_sqrt(1.0f - sqr(wo.x))}, i{wi.x, cos_i};
  float sum = fans.even * 0.25f * kInvPi +
              fans.rest * fibre_tilt_density(i, o, facet_fibre_rest_variance(fibre)) * 0.5f * kInvPi;
  for (const FibreFan& fan : fans.of) {
    float around = 0;
    for (int k = 0; k < kFacetFibreFans; ++k) {
      const float x = angle - fan.from[k];
      around +=
          fan.weight[k] * (fibre_turns_cdf(x, fan.around) - fibre_turns_cdf(x - fan.size[k], fan.around)) / fan.size[k];
    }
    const FibreTiltRange range = fibre_tilt_range(fan);
    const float squared = sqr(tilt - fan.tilt) + sqr(fan.along);
    sum += around * sqr(fan.along) / (squared * __builtin_sqrtf(squared) * (range.high - range.low) * cos_i);
  }
  return sum / fans.total;
}

/// Density by which lights are weighed against what is sampled: 1 in all, and near that of the samples.
/// @param wo, wi  as of the lobe
[[gnu::noinline]] RELIEF_KERNEL float facet_fibre_pdf(const FacetFibre& fibre, float eta, Vec3f wo, Vec3f wi)
{
  return fibre_fans_pdf(fibre, fibre_fans_make(fibre, eta, wo), wo, wi);
}

struct FacetFibreSample {
  Vec3f wi;
  Vec3f weight;       ///< f · cos over the density by which wi is found; 0: absorbed
  bool is_reflected;  ///< by the surface
};

/// Refraction out of the fibre at a boundary.
/// @param w   back to where light comes from
/// @param wi  gets where it goes
/// @return    share that goes there, of what facets reflect and refract
RELIEF_KERNEL float facet_fibre_refract_out(float alpha,
                                            float eta,
                                            const FibreBoundary& at,
                                            Vec3f w,
                                            Vec3f facet,
                                            Vec3f& wi)
{
  const float inverse = 1.0f / eta, cos_w = dot(w, facet);
  if (!(cos_w > 0.0f)) return 0.0f;
  const float cos_t = refracted_cosine(cos_w, inverse);
  wi = refracted(w, facet, cos_w, cos_t, inverse);
  const float cos_out = -dot(wi, at.meso);
  if (!(cos_t > 0.0f && cos_out > 0.0f && dot(wi, at.macro) < 0.0f)) return 0.0f;
  return (1.0f - fresnel_dielectric(cos_w, cos_t, inverse)) * fibre_facet_seen(alpha, dot(w, at.meso), cos_out);
}

/// Follows light through the fibre, facet by facet, and chooses by their shares among the ways on which it leaves.
/// @source  [H] Section 5, as Cycles does it
[[gnu::noinline]] RELIEF_KERNEL FacetFibreSample
facet_fibre_sample(const FacetFibre& fibre, float eta, const BsdfTables& tables, Vec3f wo, float u_lobe, Vec2f u)
{
  const float roughness = __builtin_sqrtf(fibre.alpha), alpha = fibre.alpha;
  const FibreEnergy energy{&tables, glass_coordinate(eta, roughness), glass_coordinate(1.0f / eta, roughness)};
  const Vec3f o = facet_fibre_turned(wo, fibre.turn);
  FacetFibreRandom random = facet_fibre_random(fibre, {u_lobe, u.x, u.y}, wo);
  const float across = lerp(u.x, fibre.low, fibre.high);
  const FibreBoundary near = fibre_boundary(fibre, ellipse_place_seen(fibre.aspect, fibre.turn, across), fibre.tilt);
  const float cos_o = dot(o, near.meso);
  if (!(cos_o > kMinCosine && dot(o, near.macro) > 0.0f)) return {};
  const Vec3f facet = fibre_facet_sample(alpha, near, o, {u.y, random.next()});
  if (!facet_sees(o, near, facet)) return {};
  constexpr int kWays = 4;
  Vec3f to[kWays], share[kWays] = {};

  to[0] = 2.0f * dot(o, facet) * facet - o;
  const float cos_r = dot(to[0], near.meso);
  if (cos_r > 0.0f && dot(to[0], near.macro) > 0.0f) {
    share[0] = splat3(float_from_half(fibre.gains[0]) * fresnel_dielectric_at(min(dot(o, facet), 1.0f), eta) *
                      energy.factor(energy.outside, cos_o) * fibre_facet_seen(alpha, cos_o, cos_r));
  }
  FibreInside in;
  if (facet_fibre_enter(fibre, energy, eta, o, near, facet, in)) {
    const Vec3f second = fibre_facet_sample(alpha, in.far, -in.wt, random.next2());
    const float TT = facet_fibre_refract_out(alpha, eta, in.far, -in.wt, second, to[1]);
    share[1] = in.passed * (float_from_half(fibre.gains[1]) * in.share * in.energy * TT);
    FibreMirrored m;
    if (float_from_half(fibre.gains[2]) > 0.0f && facet_fibre_mirror(fibre, energy, eta, in, second, m)) {
      const Vec3f third = fibre_facet_sample(alpha, m.last, m.back, random.next2());
      const Vec3f passed = in.passed * m.passed;
      const float left = in.share * m.share;
      const float TRT = facet_fibre_refract_out(alpha, eta, m.last, m.back, third, to[2]);
      share[2] = passed * (float_from_half(fibre.gains[2]) * left * TRT);
      share[3] = passed * facet_fibre_rest(alpha, eta, m.last, m.back, third, m.R, passed) * left;
      const float sine = fibre_tilt_sample(wo, facet_fibre_rest_variance(fibre), 1.0f - random.next(), random.next());
      to[3] = fibre_direction(asin_clamped(sine), 2.0f * kPi * random.next());
    }
  }
  float total = 0;
  for (const Vec3f& s : share) total += luminance(s);
  if (!(total > 0.0f)) return {};
  float left = u_lobe * total;
  int way = 0;
  while (way + 1 < kWays && left >= luminance(share[way])) left -= luminance(share[way++]);
  const float mean = luminance(share[way]);
  if (!(mean > 0.0f)) return {};
  return {facet_fibre_turned(to[way], -fibre.turn), share[way] * (total / mean), way == 0};
}

template <TransportMode>
[[gnu::noinline]] RELIEF_KERNEL BsdfEval
lobe_eval(const FacetFibre& fibre, const LobeHit& hit, const BsdfTables& tables, Vec3f wi, bool)
{
  const float eta = hit.fresnel.eta;
  return {facet_fibre_f(fibre, eta, tables, hit.wo, wi), facet_fibre_pdf(fibre, eta, hit.wo, wi)};
}

/// Nothing: whoever samples a mixture follows the light, see facet_fibre_sample.
template <TransportMode>
RELIEF_KERNEL LobeSample lobe_sample(const FacetFibre&, const LobeHit&, float, Vec2f)
{
  return {};
}

RELIEF_KERNEL bool lobe_widen(FacetFibre& fibre, float, float blur)
{
  fibre.alpha = max(fibre.alpha, blur);
  return true;
}

}  // namespace relief
