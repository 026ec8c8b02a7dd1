// Walks below surfaces, eight side by side: which way each goes and how far, and what it carries when it has been there. What rays
// meet between the two is asked by integrator/subsurface_stage.h.
//
// Chiang, Kutz, Burley 2016, "Practical and Controllable Subsurface Scattering for Production Path Tracing"; Křivánek and d'Eon
// 2014, "A Zero-variance-based Sampling Scheme for Monte Carlo Subsurface Scattering"; Meng, Hanika, Dachsbacher 2016, "Improving
// the Dwivedi Sampling Scheme" [M16]; d'Eon and Křivánek 2020, "Zero-Variance Theory for Efficient Subsurface Scattering" [E20]; put
// together as in Cycles.
#pragma once

#include <cmath>

#include "kernel/bsdf/subsurface.h"
#include "kernel/math/lanes_functions.h"
#include "kernel/math/vec_lanes.h"
#include "kernel/sample/dimensions.h"
#include "kernel/sample/sobol.h"
#include "kernel/stage/path_access.h"
#include "kernel/volume/henyey_greenstein.h"

namespace relief {

/// What has become of a walk by a step.
inline constexpr std::int32_t kWalkGoesOn = 0;
inline constexpr std::int32_t kWalkIsOut = 1;   ///< it has met the surface
inline constexpr std::int32_t kWalkIsLost = 2;  ///< it carries too little, or has taken too many steps

/// Random numbers that a step needs, in pairs that are stratified together.
enum WalkNumber : int { kWalkCosine, kWalkTurn, kWalkDistance, kWalkChannel, kWalkGuided, kWalkBack, kWalkNumbers };
/// Steps whose numbers are stratified among the samples of a pixel.
inline constexpr int kStratifiedWalkSteps = 2 * kPairsBelow / kWalkNumbers;

/// Eight walks, world space. Lanes without one are stepped as the others are, and may hold anything.
struct SubsurfaceWalks {
  // As a walk begins.
  Vec3x8 start, N;         ///< where the path has entered; the shading normal there, outwards
  Vec3x8 sigma_t, albedo;  ///< of the first steps, 1/m
  F8 g, guided_share;      ///< likewise
  F8 length;               ///< of diffusion, in free paths, above 1
  W8 key;                  ///< of the walk's random numbers
  F8 stratified[kStratifiedWalkSteps * kWalkNumbers];  ///< those of the first steps

  // What a step changes.
  Vec3x8 P, D, throughput;
  F8 across;  ///< of the object, along −N from where it was entered; −1: no other side is near
  I8 step;
  I8 fate;  ///< kWalkGoesOn, kWalkIsOut, kWalkIsLost

  // From a step's start to its end.
  Vec3x8 chances;    ///< of the channels, to decide on the distance
  F8 t, reach;       ///< metres that a walk goes if it meets nothing; that its ray has to look
  F8 met;            ///< metres to the surface; infinite: it is not in reach
  F8 cosine, phase;  ///< of D with N; density that the phase function has of D
  F8 back_share;     ///< of guided directions: those towards the other side
};

/// As in Cycles: walks that are longer, or carry less, are given up.
inline constexpr int kMostWalkSteps = 256;
inline constexpr float kLeastWalkCarried = 1e-6f;
/// After this many steps an anisotropic medium is as good as the even one that is similar to it.
inline constexpr int kAnisotropicWalkSteps = 10;

/// Dwivedi's distribution of directions along a normal: of light that finds its way out of a half space.
struct WalkGuide {
  F8 length;  ///< of diffusion, in free paths, above 1
  F8 log;
};

RELIEF_KERNEL WalkGuide walk_guide_make(F8 length) { return {length, log8((length + 1.0f) / (length - 1.0f))}; }
/// @source [M16] Eq. 10
RELIEF_KERNEL F8 walk_guide_cosine(const WalkGuide& g, F8 u) { return g.length - (g.length + 1.0f) * exp8(-u * g.log); }
/// Density of a direction, per steradian. @source [M16] Eq. 9
RELIEF_KERNEL F8 walk_guide_pdf(const WalkGuide& g, F8 cosine) { return 0.5f * kInvPi / ((g.length - cosine) * g.log); }
/// Factor on sigma_t for the way along a direction.
RELIEF_KERNEL F8 walk_guide_stretch(const WalkGuide& g, F8 cosine) { return 1.0f - cosine / g.length; }

/// Begins the walk of a path that has entered a surface.
/// @return  false: nothing would come back
RELIEF_KERNEL bool subsurface_walk_begin(const PathState& state, std::uint32_t path, SubsurfaceWalks& w, int lane)
{
  const SubsurfaceState& below = state.subsurface.entries[path];
  const SubsurfaceMedium medium = subsurface_medium(below.surface);
  const float albedo = max_component(medium.albedo);
  // @source [E20] Eq. 67
  const float length = 1.0f / std::sqrt(1.0f - std::pow(albedo, 2.44294f - 0.0215813f * albedo + 0.578637f / albedo));
  if (!(length > 1.0f && length < kInfinity)) return false;
  lane_set(w.start, lane, path_origin(state, path));
  lane_set(w.P, lane, path_origin(state, path));
  lane_set(w.D, lane, path_direction(state, path));
  lane_set(w.N, lane, below.N);
  lane_set(w.sigma_t, lane, medium.sigma_t);
  lane_set(w.albedo, lane, medium.albedo);
  lane_set(w.throughput, lane, path_throughput(state, path) * medium.gain);
  w.g[lane] = below.surface.anisotropy;
  w.guided_share[lane] = 1.0f - max(0.5f, std::pow(std::abs(below.surface.anisotropy), 0.125f));
  w.length[lane] = length;
  const int bounce = path_surface(state, path);
  w.key[lane] = hash_mix_32(hash_mix_32(state.sample_index[path] * 0x9e3779b1u + state.pixel_hash[path]) +
                            dimension_below(bounce, 0));
  static_assert(kPairsBelow % 4 == 0);
  for (int pair = 0; pair < kPairsBelow; pair += 4) {
    const Sample2dX4 points =
        sample_2d_x4(state.pixel_hash[path], state.sample_index[path], dimension_below(bounce, pair));
    for (int i = 0; i < 4; ++i) {
      w.stratified[2 * (pair + i)][lane] = points.at[i].x;
      w.stratified[2 * (pair + i) + 1][lane] = points.at[i].y;
    }
  }
  w.across[lane] = -1.0f;
  w.step[lane] = 0;
  w.fate[lane] = kWalkGoesOn;
  return true;
}

/// What a step goes through.
struct WalkMedium {
  F8 g;
  Vec3x8 sigma_s, sigma_t;
};

RELIEF_KERNEL WalkMedium walk_medium(const SubsurfaceWalks& w)
{
  const I8 is_even = w.step >= kAnisotropicWalkSteps;
  const Vec3x8 sigma_s = multiplied(w.sigma_t, w.albedo), even = sigma_s * (1.0f - w.g);
  return {is_even ? splat8(0.0f) : w.g, select(is_even, even, sigma_s),
          select(is_even, w.sigma_t - sigma_s + even, w.sigma_t)};
}

/// Share of directions that are guided.
RELIEF_KERNEL F8 walk_guided_share(const SubsurfaceWalks& w)
{
  return w.step >= kAnisotropicWalkSteps ? splat8(0.75f) : w.guided_share;
}

/// Density of the phase function, per steradian. See henyey_greenstein_pdf.
RELIEF_KERNEL F8 henyey_greenstein_pdf(F8 cosine, F8 g)
{
  const F8 size = abs(g), towards = g < 0.0f ? -cosine : cosine, rest = 1.0f - size;
  const F8 square = rest * rest + 2.0f * size * max(1.0f - towards, splat8(0.0f));
  const F8 pdf = (1.0f - g * g) / (square * sqrt(square)) * (0.25f * kInvPi);
  return size < kLeastAnisotropy ? splat8(warp_sphere_pdf()) : pdf;
}

/// Cosine with the way on. See henyey_greenstein_sample.
RELIEF_KERNEL F8 henyey_greenstein_cosine(F8 g, F8 u)
{
  const F8 k = (1.0f - g * g) / (1.0f - g + 2.0f * g * u);
  const F8 cosine = clamp((1.0f + g * g - k * k) / (2.0f * g), -1.0f, 1.0f);
  return abs(g) < kLeastAnisotropy ? 1.0f - 2.0f * u : cosine;
}

/// One of the numbers of each walk's step, [0, 1).
RELIEF_KERNEL F8 walk_number(const SubsurfaceWalks& w, WalkNumber which)
{
  const W8 n =
      __builtin_bit_cast(W8, w.step) * static_cast<std::uint32_t>(kWalkNumbers) + static_cast<std::uint32_t>(which);
  // 24 bits, as unit_float; signed, because that is what machines convert.
  const W8 bits = hash_mix_32(w.key + n * 0x9e3779b9u) >> 8;
  F8 u = __builtin_convertvector(__builtin_bit_cast(I8, bits), F8) * 0x1p-24f;
  for (int lane = 0; lane < 8; ++lane) {
    if (w.step[lane] < kStratifiedWalkSteps) u[lane] = w.stratified[n[lane]][lane];
  }
  return u;
}

/// Chooses where each walk goes: D, t and reach.
RELIEF_KERNEL void subsurface_walks_choose(SubsurfaceWalks& w)
{
  const F8 zero = splat8(0.0f);
  const WalkMedium medium = walk_medium(w);
  const Vec3x8 weights = abs(multiplied(w.throughput, w.albedo));
  const F8 sum = weights.x + weights.y + weights.z;
  w.chances = select(sum > 0.0f, weights / sum, splat8(splat3(1.0f / 3.0f)));
  const F8 u_channel = walk_number(w, kWalkChannel);
  const I8 is_x = u_channel < w.chances.x;
  const I8 is_y = (u_channel < w.chances.x + w.chances.y) | ~(w.chances.z > 0.0f);
  F8 sigma = is_x ? medium.sigma_t.x : is_y ? medium.sigma_t.y : medium.sigma_t.z;

  const I8 is_first = w.step == 0;
  const I8 is_guided = walk_number(w, kWalkGuided) < walk_guided_share(w);
  const I8 has_other_side = w.across >= 0.0f;
  const F8 depth = min(max(dot(w.start - w.P, w.N), zero), w.across);
  w.back_share = has_other_side ? 1.0f / (1.0f + exp8((w.across - 2.0f * depth) / w.length)) : zero;
  const I8 is_back = walk_number(w, kWalkBack) < w.back_share;
  const F8 u_cosine = walk_number(w, kWalkCosine);
  const WalkGuide guide = walk_guide_make(w.length);
  const F8 towards = walk_guide_cosine(guide, u_cosine);  // the side that guides
  const F8 guided = clamp(is_back ? -towards : towards, -1.0f, 1.0f);
  const F8 z = is_guided ? guided : henyey_greenstein_cosine(medium.g, u_cosine);
  const F8 r = sqrt(max((1.0f - z) * (1.0f + z), zero));
  const SinCos8 phi = sin_cos_turn(walk_number(w, kWalkTurn));
  const Frame8 frame = frame_from_normal(select(is_guided, w.N, w.D));
  const Vec3x8 next = normalize(from_local(frame, Vec3x8{r * phi.cos, r * phi.sin, z}));
  w.cosine = is_guided ? guided : dot(next, w.N);
  w.phase = henyey_greenstein_pdf(dot(w.D, next), medium.g);
  w.D = select(is_first, w.D, next);
  sigma *= is_guided & ~is_first ? walk_guide_stretch(guide, towards) : splat8(1.0f);
  w.t = -log8(1.0f - walk_number(w, kWalkDistance)) / sigma;
  // The first ray looks for another side as well.
  constexpr float kFarInFreePaths = 10.0f;
  w.reach = is_first ? max(w.t, kFarInFreePaths / min_component(medium.sigma_t)) : w.t;
}

/// Takes the walks to where they were going, or to what they have met before.
RELIEF_KERNEL void subsurface_walks_go(SubsurfaceWalks& w)
{
  const F8 one = splat8(1.0f);
  const WalkMedium medium = walk_medium(w);
  const I8 is_first = w.step == 0, is_out = w.met <= w.t;
  w.across = is_first & (w.met < kInfinity) ? max(dot(w.start - w.P - w.met * w.D, w.N), splat8(0.0f)) : w.across;
  w.t = is_out ? w.met : w.t;
  w.P = w.P + w.t * w.D;

  // Density of a free flight's end in each channel, or, where it has met the surface, its chance to get that far.
  const auto flight_pdf = [&](F8 sigma) {
    const F8 passed = exp8(-sigma * w.t);
    return is_out ? passed : sigma * passed;
  };
  const WalkGuide guide = walk_guide_make(w.length);
  const F8 ahead = walk_guide_stretch(guide, w.cosine), back = walk_guide_stretch(guide, -w.cosine);
  const F8 guided_share = is_first ? splat8(0.0f) : walk_guided_share(w);
  const F8 weight = guided_share / w.phase;
  const F8 ahead_weight = weight * (1.0f - w.back_share) * walk_guide_pdf(guide, w.cosine);
  const F8 back_weight = weight * w.back_share * walk_guide_pdf(guide, -w.cosine);
  F8 pdf = splat8(0.0f);
  const auto channel = [&](F8 sigma_t, F8 sigma_s, F8 chance, F8& throughput) {
    const F8 plain = flight_pdf(sigma_t);
    pdf += chance * ((1.0f - guided_share) * plain + ahead_weight * flight_pdf(ahead * sigma_t) +
                     back_weight * flight_pdf(back * sigma_t));
    throughput *= (is_out ? one : sigma_s / sigma_t) * plain;
  };
  channel(medium.sigma_t.x, medium.sigma_s.x, w.chances.x, w.throughput.x);
  channel(medium.sigma_t.y, medium.sigma_s.y, w.chances.y, w.throughput.y);
  channel(medium.sigma_t.z, medium.sigma_s.z, w.chances.z, w.throughput.z);
  w.throughput = w.throughput / pdf;
  w.step += 1;

  const F8 largest = max(w.throughput.x, max(w.throughput.y, w.throughput.z));
  const F8 all = w.throughput.x + w.throughput.y + w.throughput.z;
  const I8 is_finite = all - all == 0.0f;
  const I8 goes_on = (largest >= kLeastWalkCarried) & (w.step < kMostWalkSteps);
  w.fate = (is_out & 1) * kWalkIsOut + (~is_out & ~goes_on & 1) * kWalkIsLost;
  w.fate = is_finite ? w.fate : I8{} + kWalkIsLost;
}

}  // namespace relief
