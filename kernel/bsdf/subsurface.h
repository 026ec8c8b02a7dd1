// Subsurface scattering: light enters a surface, walks about below it, and leaves it elsewhere. Here is how it enters, and what it
// walks through; integrator/subsurface_stage.h lets it walk.
//
// Chiang, Kutz, Burley 2016, "Practical and Controllable Subsurface Scattering for Production Path Tracing" [C16]; Wrenninge,
// Villemin, Hery 2017, "Path Traced Subsurface Scattering using Anisotropic Phase Functions and Non-Exponential Free Flights"
// [W17]; Jensen, Marschner, Levoy, Hanrahan 2001, "A Practical Model for Subsurface Light Transport" [J01].
#pragma once

#include <cmath>

#include "kernel/bsdf/fresnel.h"
#include "kernel/bsdf/ggx_anisotropic.h"
#include "kernel/bsdf/mixture_traits.h"
#include "kernel/bsdf/subsurface_params.h"
#include "kernel/math/lanes_functions.h"
#include "kernel/sample/warp.h"

namespace relief {

/// Radii below this are those of a diffuse surface, as in Cycles; metres.
inline constexpr float kLeastSubsurfaceRadius = 1e-8f;

/// Reflectance of eight half spaces by their reduced albedos. @param a43  4/3 A
/// @source [J01] Eq. 10
RELIEF_KERNEL F8 dipole_reflectance(F8 albedo, float a43)
{
  const F8 s = sqrt(3.0f * (1.0f - albedo));
  return 0.5f * albedo * (1.0f + exp8(-a43 * s)) * exp8(-s);
}

/// The mean free path of a medium that looks as if light had come up so far from where it entered.
/// @param radius  by which it comes up
/// @param ior     of the medium
/// @source [J01], its Eq. 10 inverted by twelve halvings, as Cycles has it; here three at a time
RELIEF_KERNEL float subsurface_free_path(float radius, float albedo, float ior)
{
  const float F_dr = (-1.440f / ior + 0.710f) / ior + 0.668f + 0.0636f * ior;
  const float a43 = (4.0f / 3.0f) * (1.0f + F_dr) / (1.0f - F_dr);
  float reduced = 0.0f;
  if (albedo >= 0.995f) {
    reduced = 0.999999f;
  } else if (albedo >= 1e-4f) {
    constexpr F8 kInner = {1, 2, 3, 4, 5, 6, 7, 8};
    const auto narrow = [&](float step, unsigned inner) {
      const I8 is_below = dipole_reflectance(reduced + step * kInner, a43) < albedo;
      reduced += step * static_cast<float>(__builtin_popcount(mask_of(is_below) & inner));
    };
    for (const float step : {0x1p-3f, 0x1p-6f, 0x1p-9f}) narrow(step, 0x7f);
    narrow(0x1p-11f, 0x7);
    reduced += 0x1p-12f;
  }
  return radius * __builtin_sqrtf(3.0f * (1.0f - reduced));
}

/// What a path walks through.
struct SubsurfaceMedium {
  Vec3f sigma_t;  ///< 1/m, world
  Vec3f albedo;   ///< of a single scattering
  Vec3f gain;     ///< factor on the throughput of who enters
};

/// Albedo of a single scattering in a half space that reflects so much of what enters diffusely.
/// @source  d'Eon 2016, "A Hitchhiker's Guide to Multiple Scattering", Eq. 53.7: van de Hulst's similarity
RELIEF_KERNEL float subsurface_similar_albedo(float albedo, float g)
{
  const float root = __builtin_sqrtf(9.59217f + 41.6808f * albedo + 17.7126f * sqr(albedo));
  const float s_squared = sqr(4.20863f * albedo - root + 4.09712f);
  return clamp((1.0f - s_squared) / (1.0f - g * s_squared), 0.0f, 0.999999f);
}

/// The same, as Cycles had it before.
/// @source  [W17], fitted for anisotropies from 0 to .9; the polynomials are Cycles'
RELIEF_KERNEL float subsurface_single_albedo(float albedo, float g)
{
  const auto polynomial = [g](const float (&c)[8]) {
    float sum = c[7];
    for (int i = 6; i >= 0; --i) sum = sum * g + c[i];
    return sum;
  };
  constexpr float kA[8] = {1.8260523782f,   -1.28451056436f, -1.79904629312f, 9.19393289202f,
                           -22.8215585862f, 32.0234874259f,  -23.6264803333f, 7.21067002658f};
  constexpr float kB[8] = {0,               31.1491581433f, -201.847017512f, 841.576016723f,
                           -2018.09288505f, 2731.71560286f, -1935.41424244f, 559.009054474f};
  constexpr float kC[8] = {1.09686102424f, -0.394704063468f, 1.05258115941f, -8.83963712726f,
                           28.8643230661f, -46.8802913581f,  38.5402837518f, -12.7181042538f};
  constexpr float kD[8] = {0.496310210422f, 0.360146581622f, -2.15139309747f, 17.8896899217f,
                           -55.2984010333f, 82.065982243f,   -58.5106008578f, 15.8478295021f};
  constexpr float kE[8] = {0,               76.7316253952f, -594.356773233f, 2448.8834203f,
                           -5576.68528998f, 7116.60171912f, -4763.54467887f, 1303.5318055f};
  constexpr float kF[8] = {2.40602999408f, -2.51814844609f, 9.18494908356f, -79.2191708682f,
                           259.082868209f, -403.613804597f, 302.85712436f,  -87.4370473567f};
  const float B = 4.98511194385f + 0.127355959438f * std::exp(polynomial(kB));
  const float E = 4.23190299701f + 0.00310603949088f * std::exp(polynomial(kE));
  const float blend = __builtin_sqrtf(__builtin_sqrtf(albedo));
  const float dark = polynomial(kA) * std::pow(std::atan(B * albedo), polynomial(kC));
  const float bright = polynomial(kD) * std::pow(std::atan(E * albedo), polynomial(kF));
  // Rounding would let white light walk for ever.
  return clamp(lerp(blend, dark, bright), 0.0f, 0.999999f);
}

RELIEF_KERNEL SubsurfaceMedium subsurface_medium(const Subsurface& s)
{
  SubsurfaceMedium m;
  const auto axis = [&](float albedo, float radius, float& sigma_t, float& single, float& gain) {
    const float free_path = max(radius, 1e-16f);
    single = s.is_similar ? subsurface_similar_albedo(albedo, s.anisotropy) : subsurface_single_albedo(albedo, s.anisotropy);
    sigma_t = 1.0f / (s.is_similar ? free_path : free_path * (1.0f - s.anisotropy));
    // The lobe's weight has the albedo already. Darker ones are walked in as this one is, and darkened: their walks end too soon for
    // guiding to be of use.
    constexpr float kDarkest = 0.2f;
    gain = albedo > 0.0f ? 1.0f / albedo : 0.0f;
    if (single < kDarkest) {
      gain *= single / kDarkest;
      single = kDarkest;
    }
  };
  axis(s.albedo.x, s.radius.x, m.sigma_t.x, m.albedo.x, m.gain.x);
  axis(s.albedo.y, s.radius.y, m.sigma_t.y, m.albedo.y, m.gain.y);
  axis(s.albedo.z, s.radius.z, m.sigma_t.z, m.albedo.z, m.gain.z);
  return m;
}

/// Direction in which a path enters; one that leaves by a profile does not, and is sent straight down. Only its distribution is that
/// of a rough interface: what of it would be lost between
/// the facets is not.
/// @param wo  its frame, z > 0
/// @return    below the surface, z < 0, unit
RELIEF_KERNEL Vec3f subsurface_enter(const Subsurface& s, Vec3f wo, Vec2f u)
{
  if (s.entry == SubsurfaceEntry::kProfile) return {0, 0, -1};
  const bool is_either = s.entry == SubsurfaceEntry::kEither;
  if (s.entry == SubsurfaceEntry::kDiffuse || (is_either && u.x < 0.5f)) {
    if (is_either) u.x *= 2.0f;
    return -warp_cosine_hemisphere(u);
  }
  if (is_either) u.x = 2.0f * u.x - 1.0f;
  const Vec3f h = ggx_anisotropic_visible_normal({s.entry_alpha, s.entry_alpha}, wo, u);
  const float cos_o = dot(h, wo), eta = 1.0f / s.entry_ior;
  const float cos_t = __builtin_sqrtf(max(1.0f - sqr(eta) * (1.0f - sqr(cos_o)), 0.0f));
  return normalize((eta * cos_o - cos_t) * h - eta * wo);
}

/// Lights are not found through it.
template <TransportMode>
RELIEF_KERNEL BsdfEval lobe_eval(const Subsurface&, const LobeHit&, const BsdfTables&, Vec3f, bool)
{
  return {};
}

/// Nothing: whoever samples a mixture has the path enter, see subsurface_enter.
template <TransportMode>
RELIEF_KERNEL LobeSample lobe_sample(const Subsurface&, const LobeHit&, float, Vec2f)
{
  return {};
}

}  // namespace relief
