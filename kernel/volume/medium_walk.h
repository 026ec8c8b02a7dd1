// Tentative collisions along a ray through media that vary: places at a rate that is not less than what the media take away and
// scatter there. What they really do is asked for at those places alone, eight at a time.
//
// Nothing here chooses by what the media really do: so what is weighed by it has the right mean however wrong the rate is. Of a
// medium that takes away more than the rate says the weights are below 0, and only the noise suffers.
//
// Sources: Woodcock and others 1965 (rates); Novák, Selle and Jarosz 2014, "Residual Ratio Tracking for Estimating Attenuation in
// Participating Media" (weights); Galtier and others 2013, "Integral formulation of null-collision Monte Carlo algorithms" (rates that
// are too low).
#pragma once

#include <cmath>

#include "kernel/sample/sobol.h"
#include "kernel/state/medium_state.h"
#include "kernel/volume/distance.h"
#include "kernel/volume/varying_medium.h"

namespace relief {

/// Random numbers by a count, for places of which there is no telling how many there are.
struct CountedNumbers {
  std::uint32_t state = 0;
};

RELIEF_KERNEL float counted_next(CountedNumbers& numbers)
{
  numbers.state = numbers.state * 747796405u + 2891336453u;
  return unit_float(hash_mix_32(numbers.state));
}

/// Stretches of one rate that a walk keeps once it has looked for them. A ray through the middle of an object has some fifty.
inline constexpr int kKnownStretches = 24;

/// The media along a part of a ray.
struct MediumWalk {
  Vec3f O, D;
  float length = 0;     ///< metres; may be infinite
  MediaSum even;        ///< those that are even
  float even_rate = 0;  ///< 1/m
  std::int32_t instances[kMostMedia];
  const VaryingMedium* media[kMostMedia];  ///< those that vary
  RateRay rays[kMostMedia];                ///< as their grids see it
  int size = 0;
  float factor = 1;  ///< of rates: where they are low, collisions are made more often, as eight cost what one does
  float reach = 0;   ///< metres: most of what is scattered is nearer
  /// More collisions where a light is near: kNearCollisions of them on average, by its distance, but where there is nothing.
  Equiangular near;
  float near_t = kInfinity;  ///< where the next of them is
  float near_angle = 0;
  float t = 0;
  float rate = 0;  ///< of a collision at t that has not been used yet, but for those; 0: there is none
  RateStretch at;  ///< around t
  RateStretch known[kKnownStretches];  ///< from the start, one after the other
  int num_known = 0, next_known = 0;
  CountedNumbers numbers;
};

RELIEF_KERNEL std::int32_t medium_of_instance(const KernelGlobals& g, std::int32_t instance)
{
  return instance == kWholeWorld ? g.world_medium : g.materials[g.instances[instance].material_index].medium_index;
}

/// Whether one of the media that a point is in varies.
RELIEF_KERNEL bool media_vary(const KernelGlobals& g, const MediumState& m)
{
  if (g.varying_media == nullptr) return false;
  for (int i = 0; i < m.size; ++i) {
    if (g.varying_media[medium_of_instance(g, m.inside[i])].num_closures > 0) return true;
  }
  return false;
}

RELIEF_KERNEL RateStretch medium_walk_rate(const MediumWalk& walk, float t)
{
  RateStretch all{walk.even_rate, walk.length};
  for (int i = 0; i < walk.size; ++i) {
    const RateStretch one = rate_grid_at(varying_place(*walk.media[i], walk.instances[i]).rates, walk.rays[i], t);
    all.rate += one.rate;
    all.end = min(all.end, one.end);
  }
  return all;
}

/// Collisions that are wanted on a ray at least, on average: most of what one run of a graph takes.
inline constexpr float kWantedCollisions = 5.0f;

/// And so many more where a light is near.
inline constexpr float kNearCollisions = 3.0f;

/// @param D  unit
RELIEF_KERNEL MediumWalk
medium_walk_make(const KernelGlobals& g, const MediumState& m, Vec3f O, Vec3f D, float length, std::uint32_t seed)
{
  MediumWalk walk;
  walk.O = O;
  walk.D = D;
  walk.length = length;
  walk.numbers.state = seed;
  for (int i = 0; i < m.size; ++i) {
    const std::int32_t index = medium_of_instance(g, m.inside[i]);
    if (g.varying_media[index].num_closures == 0) {
      media_add(walk.even, g.media[index]);
    } else {
      walk.rays[walk.size] = rate_ray_make(varying_place(g.varying_media[index], m.inside[i]).rates, O, D);
      walk.instances[walk.size] = m.inside[i];
      walk.media[walk.size++] = &g.varying_media[index];
    }
  }
  walk.even_rate = max_component(walk.even.sigma_t);
  // What only shines needs collisions as well; on an infinite way it has no radiance.
  if (!is_zero(walk.even.emission) && !(walk.even_rate > 0.0f)) {
    if (length < kInfinity)
      walk.even_rate = 1.0f / length;
    else
      walk.even.emission = {};
  }
  float depth = 0, first = length;
  for (float t = 0; t < length && depth < kWantedCollisions;) {
    const RateStretch at = medium_walk_rate(walk, t);
    if (walk.num_known < kKnownStretches) walk.known[walk.num_known++] = at;
    const float end = min(at.end, length);
    if (at.rate > 0.0f) {
      first = min(first, t);
      depth += at.rate * (end - t);
      walk.reach = end < kInfinity ? end : t + kWantedCollisions / at.rate;
    }
    t = end;
  }
  if (depth < kWantedCollisions) {
    // All of the way is known: what lies before and behind has nothing to collide with.
    if (depth > 0.0f) walk.factor = kWantedCollisions / depth;
    walk.length = depth > 0.0f ? walk.reach : 0.0f;
  }
  walk.t = first;
  walk.at = {0.0f, 0.0f};
  return walk;
}

/// Optical depth up to a collision.
/// @param u  [0, 1), a multiple of 2⁻²⁴: what is left to 1 is exact
RELIEF_KERNEL float free_depth(float u) { return -__builtin_logf(1.0f - u); }

/// Goes on to the next collision but for those that are near a light: t and rate.
RELIEF_KERNEL void medium_walk_advance(MediumWalk& walk)
{
  float left = free_depth(counted_next(walk.numbers)) / walk.factor;
  while (walk.t < walk.length) {
    while (!(walk.t < walk.at.end)) {
      const bool is_known = walk.next_known < walk.num_known;
      walk.at = is_known ? walk.known[walk.next_known++] : medium_walk_rate(walk, walk.t);
    }
    const float end = min(walk.at.end, walk.length);
    if (walk.at.rate > 0.0f) {
      const float next = walk.t + left / walk.at.rate;
      if (next < end) {
        walk.t = next;
        walk.rate = walk.at.rate * walk.factor;
        return;
      }
      left -= walk.at.rate * (end - walk.t);
    }
    walk.t = end;
  }
}

/// Likewise of those, near_t.
RELIEF_KERNEL void medium_walk_advance_near(MediumWalk& walk)
{
  const Equiangular& near = walk.near;
  walk.near_angle += free_depth(counted_next(walk.numbers)) * (near.last - near.first) * (1.0f / kNearCollisions);
  walk.near_t = walk.near_angle < near.last ? near.nearest + near.distance * std::tan(walk.near_angle) : kInfinity;
}

/// Asks for more collisions near a light.
/// @param near  the walk, seen from there; its distance is above 0
RELIEF_KERNEL void medium_walk_approach(MediumWalk& walk, const Equiangular& near)
{
  if (!(walk.length > 0.0f)) return;
  walk.near = near;
  walk.near_angle = near.first;
  medium_walk_advance_near(walk);
}

/// Collisions a metre that are near a light.
RELIEF_KERNEL float medium_walk_near_rate(const MediumWalk& walk, float t)
{
  return walk.near.distance > 0.0f ? kNearCollisions * equiangular_pdf(walk.near, t) : 0.0f;
}

struct TentativeCollision {
  float t = 0;     ///< metres along the walk
  float rate = 0;  ///< 1/m; 0: there is none up to the length
};

RELIEF_KERNEL TentativeCollision medium_walk_next(MediumWalk& walk)
{
  if (!(walk.rate > 0.0f)) medium_walk_advance(walk);
  while (walk.near_t < min(walk.t, walk.length)) {
    const float t = max(walk.near_t, 0.0f), rate = medium_walk_rate(walk, t).rate;
    medium_walk_advance_near(walk);
    if (rate > 0.0f) return {t, rate * walk.factor + medium_walk_near_rate(walk, t)};
  }
  if (!(walk.rate > 0.0f)) return {};
  const TentativeCollision next{walk.t, walk.rate + medium_walk_near_rate(walk, walk.t)};
  walk.rate = 0.0f;
  return next;
}

/// Some collisions, and what the media are there.
struct MediumCollisions {
  int size = 0;
  float t[kMediumPoints], rate[kMediumPoints];
  Medium media[kMostMedia][kMediumPoints];  ///< those that vary
};

/// @return false: they were the last
RELIEF_KERNEL bool medium_collisions_next(const KernelGlobals& g,
                                          MediumWalk& walk,
                                          const GraphRay& ray,
                                          MediumCollisions& out)
{
  Vec3f P[kMediumPoints];
  bool goes_on = true;
  for (out.size = 0; out.size < kMediumPoints; ++out.size) {
    const TentativeCollision next = medium_walk_next(walk);
    goes_on = next.rate > 0.0f;
    if (!goes_on) break;
    out.t[out.size] = next.t;
    out.rate[out.size] = next.rate;
    P[out.size] = walk.O + walk.D * next.t;
  }
  if (out.size == 0) return false;
  for (int i = 0; i < walk.size; ++i) {
    varying_medium_eval(g, *walk.media[i], walk.instances[i], P, out.size, walk.D, ray, out.media[i]);
  }
  return goes_on;
}

/// All media at one of the collisions.
RELIEF_KERNEL MediaSum medium_collision(const MediumWalk& walk, const MediumCollisions& collisions, int k)
{
  MediaSum sum = walk.even;
  for (int i = 0; i < walk.size; ++i) media_add(sum, collisions.media[i][k]);
  return sum;
}

/// What is left below this of light is more often followed no further, and counts for more where it is.
inline constexpr float kLittleLeft = 1.0f / 32.0f;

/// @param left  not 0
/// @return      factor by which what is left is multiplied; 0: it ends
RELIEF_KERNEL float medium_walk_survive(MediumWalk& walk, Vec3f left)
{
  const float most = max_component(abs(left));
  if (!(most < kLittleLeft)) return 1.0f;
  const float chance = max(most / kLittleLeft, 0.25f);
  return counted_next(walk.numbers) < chance ? 1.0f / chance : 0.0f;
}

/// Share of light that media let through, as a random number of that mean.
RELIEF_KERNEL Vec3f medium_walk_transmittance(const KernelGlobals& g, MediumWalk& walk, const GraphRay& ray)
{
  Vec3f left{1, 1, 1};
  MediumCollisions collisions;
  for (bool goes_on = true; goes_on;) {
    goes_on = medium_collisions_next(g, walk, ray, collisions);
    for (int k = 0; k < collisions.size; ++k) {
      left *= Vec3f{1, 1, 1} - medium_collision(walk, collisions, k).sigma_t / collisions.rate[k];
      if (is_zero(left)) return left;
      left *= medium_walk_survive(walk, left);
      if (is_zero(left)) return left;
    }
  }
  return left;
}

}  // namespace relief
