// A ray's way through media that vary, up to where it is scattered, or what they let through of its light. It asks them at tentative
// collisions alone, as they come: a flight goes no farther than it has to.
//
// As in medium_walk.h nothing has to be true of the grid for means to be right.
//
// Sources: Woodcock and others 1965; Galtier and others 2013 (weights where the medium is denser than collisions are many); Kutz, Habel,
// Li and Novák 2017, "Spectral and Decomposition Tracking for Rendering Heterogeneous Volumes" (chances by what channels carry); Novák,
// Selle and Jarosz 2014 (residuals).
#pragma once

#include <cmath>
#include <new>

#include "kernel/math/lanes.h"
#include "kernel/sample/sobol.h"
#include "kernel/volume/distance.h"
#include "kernel/volume/medium_ray.h"
#include "kernel/volume/shadow_way.h"

namespace relief {

/// Optical depth up to a collision.
/// @param u  [0, 1), a multiple of 2⁻²⁴: what is left to 1 is exact
RELIEF_KERNEL float free_depth(float u) { return -__builtin_logf(1.0f - u); }

/// Share of light that is left after an optical depth.
RELIEF_KERNEL Vec3f depth_transmittance(Vec3f depth)
{
  return {std::exp(-depth.x), std::exp(-depth.y), std::exp(-depth.z)};
}

/// What light carries, channels added: what choices are made by.
RELIEF_KERNEL float carried_share(Vec3f carried)
{
  const Vec3f size = abs(carried);
  return size.x + size.y + size.z;
}

/// Tentative collisions that are asked at once.
template <int kMost>
struct Collisions {
  Collisions() {}
  int size = 0;
  float t[kMost];      ///< metres along the ray
  float rate[kMost];   ///< 1/m
  Vec3f taken[kMost];  ///< sigma_t that the media are taken for, 1/m
  union {              // of which media[medium < ray.size][place < size] are there, once they have been asked
    Medium media[kMostMedia][kMost];
  };
};

template <int kMost>
RELIEF_KERNEL void collisions_ask(const KernelGlobals& g,
                                  const MediumRay& ray,
                                  const GraphRay& asks,
                                  Collisions<kMost>& all)
{
  Vec3f P[kMost];
  for (int k = 0; k < all.size; ++k) P[k] = ray.O + ray.D * all.t[k];
  for (int i = 0; i < ray.size; ++i) {
    varying_medium_eval(g, *ray.media[i], ray.instances[i], P, all.size, ray.D, asks, all.media[i]);
  }
}

/// All media at one of them.
template <int kMost>
RELIEF_KERNEL MediaSum collision_media(const MediumRay& ray, const Collisions<kMost>& all, int k)
{
  MediaSum sum = ray.even;
  for (int i = 0; i < ray.size; ++i) media_add(sum, all.media[i][k]);
  return sum;
}

/// Goes along a ray from collision to collision.
struct CollisionWay {
  float t = 0;      ///< metres
  float ahead = 0;  ///< what the next one is away, by the rate
};

/// Notes the collisions in a box.
/// @param end   metres along the ray
/// @param rate  1/m
/// @param ask   called when there is no more room; whether to go on
template <int kMost, typename Ask>
RELIEF_KERNEL bool collisions_in_box(Collisions<kMost>& all,
                                     CollisionWay& way,
                                     CountedNumbers& numbers,
                                     float end,
                                     float rate,
                                     Vec3f taken,
                                     const Ask& ask)
{
  if (rate > 0.0f) {
    for (;;) {
      const float depth = rate * (end - way.t);
      if (!(way.ahead < depth)) {
        way.ahead -= depth;
        break;
      }
      way.t = min(way.t + way.ahead / rate, end);
      way.ahead = free_depth(counted_next(numbers));
      const int k = all.size++;
      all.t[k] = way.t;
      all.rate[k] = rate;
      all.taken[k] = taken;
      if (all.size == kMost && !ask()) return false;
    }
  }
  way.t = end;
  return true;
}

/// Where a flight ends.
struct MediumFlight {
  MediumFlight() {}
  bool scatters = false;
  float distance = 0;  ///< metres, if so
  Vec3f left;          ///< what gets there of the light, over the density; or gets through
  Vec3f emitted;       ///< on the way, times what gets there
  union {              // of which those of the media that vary are there, where it is scattered
    Medium varying[kMostMedia];
  };
};

RELIEF_KERNEL MediaSum flight_media(const MediumRay& ray, const MediumFlight& flight)
{
  MediaSum sum = ray.even;
  for (int i = 0; i < ray.size; ++i) media_add(sum, flight.varying[i]);
  return sum;
}

/// Most flights end at one of so many collisions.
inline constexpr int kFlightCollisions = 4;

/// @param throughput  of the light
RELIEF_KERNEL void medium_fly(const KernelGlobals& g,
                              const MediumRay& ray,
                              const GraphRay& asks,
                              CountedNumbers& numbers,
                              Vec3f throughput,
                              MediumFlight& flight)
{
  flight.left = throughput;
  Collisions<kFlightCollisions> all;
  const auto meet = [&] {
    collisions_ask(g, ray, asks, all);
    for (int k = 0; k < all.size; ++k) {
      const MediaSum media = collision_media(ray, all, k);
      const Vec3f here = flight.left * (1.0f / all.rate[k]);
      flight.emitted += here * media.emission;
      const Vec3f passes = flight.left - here * media.sigma_t;
      const float scattered = carried_share(here * media.sigma_s), passing = carried_share(passes);
      if (!(scattered + passing > 0.0f)) {
        flight.left = {};
        return false;
      }
      const float chance = scattered / (scattered + passing);
      if (counted_next(numbers) < chance) {
        flight.scatters = true;
        flight.distance = all.t[k];
        flight.left = here * (1.0f / chance);
        for (int i = 0; i < ray.size; ++i) new (&flight.varying[i]) Medium(all.media[i][k]);
        return false;
      }
      flight.left = passes * (1.0f / (1.0f - chance));
    }
    all.size = 0;
    return true;
  };
  CollisionWay way;
  way.ahead = free_depth(counted_next(numbers));
  bool goes_on = true;
  rate_boxes_visit(ray, [&](float end, const RateBox& box) {
    goes_on = collisions_in_box(all, way, numbers, end, max(box.most, box.shows), box.sigma_t, meet);
    return goes_on;
  });
  if (goes_on && all.size > 0) meet();
}

/// Collisions of a ray's transmittance, over the residuals.
inline constexpr float kResidualCollisions = 3.0f;
/// Optical depth from which on a shadow ray is more often followed no further, and counts for more where it is.
inline constexpr float kDeep = 3.5f;
/// The chance that it is, each time, and how much deeper the next one is.
inline constexpr float kDeepSurvival = 0.25f, kDeepStep = 1.3862944f;

/// Share of light that media let through, as a random number of that mean.
RELIEF_KERNEL Vec3f medium_ray_transmittance(const KernelGlobals& g,
                                             const MediumRay& ray,
                                             const GraphRay& asks,
                                             CountedNumbers& numbers)
{
  Vec3f depth, left{1, 1, 1};
  Collisions<kMediumPoints> all;
  const auto meet = [&] {
    collisions_ask(g, ray, asks, all);
    for (int k = 0; k < all.size; ++k) {
      const Vec3f sigma_t = collision_media(ray, all, k).sigma_t;
      left *= Vec3f{1, 1, 1} - (sigma_t - all.taken[k]) * (1.0f / all.rate[k]);
    }
    all.size = 0;
    return !is_zero(left);
  };
  CollisionWay way;
  way.ahead = free_depth(counted_next(numbers));
  float deep = kDeep;
  bool goes_on = true;
  rate_boxes_visit(ray, [&](float end, const RateBox& box) {
    const float size = end - way.t, thinnest = min_component(depth);
    const float factor = max(1.0f, kResidualCollisions / (1.0f + thinnest));
    const auto add = [size](float& to, float sigma) {
      if (sigma > 0.0f) to += sigma * size;
    };
    add(depth.x, box.sigma_t.x);
    add(depth.y, box.sigma_t.y);
    add(depth.z, box.sigma_t.z);
    while (min_component(depth) > deep) {
      if (!(counted_next(numbers) < kDeepSurvival)) {
        left = {};
        goes_on = false;
        return false;
      }
      left *= 1.0f / kDeepSurvival;
      deep += kDeepStep;
    }
    goes_on = collisions_in_box(all, way, numbers, end, box.residual * factor, box.sigma_t, meet);
    return goes_on;
  });
  if (goes_on && all.size > 0) meet();
  return is_zero(left) ? left : left * depth_transmittance(depth);
}

/// See ShadowTransmittance.
RELIEF_KERNEL Vec3f media_shadow_transmittance(const KernelGlobals& g,
                                               const MediumState& inside,
                                               const ShadowWay& way,
                                               float from,
                                               float to)
{
  if (!media_vary(g, inside)) {
    Vec3f sigma_t;
    for (int i = 0; i < inside.size; ++i) sigma_t += g.media[medium_of_instance(g, inside.inside[i])].sigma_t;
    return medium_transmittance(sigma_t, to - from);
  }
  if (!(to > from)) return {1, 1, 1};
  const MediumRay ray = medium_ray_make(g, inside, way.O + way.D * from, way.D, to - from);
  CountedNumbers numbers{hash_mix_32(way.seed ^ hash_mix_32(__builtin_bit_cast(std::uint32_t, from)))};
  return medium_ray_transmittance(g, ray, way.ray, numbers);
}

}  // namespace relief
