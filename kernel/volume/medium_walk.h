// A ray's way through media that vary: what they let through of its light, and places at which they are asked what they scatter.
//
// A grid says what they are taken for (rate_grid.h). Light is weakened by that in closed form, and what it is off by is corrected by
// tentative collisions, each of which asks the media at one place. Other places are spread evenly over what is likely to show. All
// of them are asked eight at a time, and all count for what is scattered.
//
// Nothing here chooses by what the media really do: so what is weighed by it has the right mean however wrong the grid is, and only the
// noise suffers.
//
// Sources: Woodcock and others 1965 (collisions); Novák, Selle and Jarosz 2014, "Residual Ratio Tracking for Estimating Attenuation in
// Participating Media"; Galtier and others 2013, "Integral formulation of null-collision Monte Carlo algorithms" (weights below 0).
#pragma once

#include <cmath>
#include <new>

#include "kernel/math/lanes.h"
#include "kernel/sample/sobol.h"
#include "kernel/state/medium_state.h"
#include "kernel/volume/distance.h"
#include "kernel/volume/shadow_way.h"
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

/// A part of a walk in which the media are taken for even.
struct WalkStretch {
  float end;  ///< metres; where the next one begins
  RateBox box;
  Vec3f depth;    ///< optical, of all before it
  float left;     ///< about the light that gets to it: samples get rarer by that
  float samples;  ///< in it, see walk_samples
};

/// Stretches that a walk has at most: where there are more, neighbours become one. A ray through the middle of an object has some fifty.
inline constexpr int kMostStretches = 64;

/// A place that goes along a walk.
struct WalkPlace {
  int stretch = 0;
  float start = 0;      ///< of the stretch, metres
  float passed = 0;     ///< up to there, of what it goes by
  float next = 0;       ///< and up to where it stands
  float t = kInfinity;  ///< metres; infinite: it has left
};

/// The media along a part of a ray.
struct MediumWalk {
  MediumWalk() {}
  Vec3f O, D;
  float length = 0;  ///< metres; may be infinite
  MediaSum even;     ///< those that are even
  std::int32_t instances[kMostMedia];
  const VaryingMedium* media[kMostMedia];  ///< those that vary
  int size = 0;
  union {  // of which the first num_stretches are there
    WalkStretch stretches[kMostStretches];
  };
  int num_stretches = 0;
  Vec3f depth;       ///< of all of it, as the media are taken for
  float factor = 0;  ///< of collisions, to the stretches' residuals
  WalkPlace collision, sample;
  float spacing = 0;     ///< of samples, by what shows; 0: there are none
  float reach = 0;       ///< metres: most of what shows is nearer
  Equiangular near;      ///< more samples are near a light: how it is seen
  float near_angle = 0;  ///< where the next of them is
  float near_t = kInfinity;
  WalkPlace at;  ///< the last of all these
  CountedNumbers numbers;
};

RELIEF_KERNEL std::int32_t medium_of_instance(const KernelGlobals& g, std::int32_t instance)
{
  return instance == kWholeWorld ? g.world_medium : g.materials[g.instances[instance].material_index].medium_index;
}

/// What an instance, or the world, is filled with that varies; null: nothing.
RELIEF_KERNEL const VaryingMedium* medium_that_varies(const KernelGlobals& g, std::int32_t instance)
{
  const VaryingMedium& medium = g.varying_media[medium_of_instance(g, instance)];
  return medium.num_closures > 0 && varying_place(medium, instance).rates.boxes != nullptr ? &medium : nullptr;
}

/// Whether one of the media that a point is in varies.
RELIEF_KERNEL bool media_vary(const KernelGlobals& g, const MediumState& m)
{
  if (g.varying_media == nullptr) return false;
  for (int i = 0; i < m.size; ++i) {
    if (medium_that_varies(g, m.inside[i]) != nullptr) return true;
  }
  return false;
}

/// Makes one of every two stretches.
RELIEF_KERNEL void walk_join(MediumWalk& walk)
{
  float start = 0;
  const int half = walk.num_stretches / 2;
  for (int i = 0; i < half; ++i) {
    const WalkStretch a = walk.stretches[2 * i], b = walk.stretches[2 * i + 1];
    const float share = (a.end - start) / (b.end - start), rest = 1.0f - share;
    walk.stretches[i] = {b.end,
                         {a.box.sigma_t * share + b.box.sigma_t * rest, a.box.residual * share + b.box.residual * rest,
                          a.box.shows * share + b.box.shows * rest},
                         {},
                         0,
                         0};
    start = b.end;
  }
  walk.num_stretches = half;
}

RELIEF_KERNEL void walk_add(MediumWalk& walk, float end, const RateBox& box)
{
  if (walk.num_stretches > 0) {
    WalkStretch& last = walk.stretches[walk.num_stretches - 1];
    if (last.box.sigma_t == box.sigma_t && last.box.residual == box.residual && last.box.shows == box.shows) {
      last.end = end;
      return;
    }
    if (walk.num_stretches == kMostStretches) walk_join(walk);
  }
  // By its parts: one that is put together first and copied then is waited for.
  WalkStretch& stretch = walk.stretches[walk.num_stretches++];
  stretch.end = end;
  stretch.box.sigma_t = box.sigma_t;
  stretch.box.residual = box.residual;
  stretch.box.shows = box.shows;
}

/// Finds the stretches of a walk through one grid of one level. Which side of a box a ray leaves by is not to be foretold, so this does not
/// branch by it.
/// @param even  what is everywhere besides
RELIEF_KERNEL void walk_find_in_grid(MediumWalk& walk, const RateGrid& grid, const RateBox& even)
{
  using F4 [[gnu::vector_size(16)]] = float;
  using I4 [[gnu::vector_size(16)]] = std::int32_t;
  const Vec3f D = walk.D / grid.cell, O = (walk.O - rate_grid_middle(grid)) / grid.cell;
  const float half = 0.5f * static_cast<float>(grid.size), from[3] = {O.x, O.y, O.z}, to[3] = {D.x, D.y, D.z};
  float enters = 0, leaves = walk.length;
  for (int i = 0; i < 3; ++i) {
    if (to[i] == 0.0f) {
      if (!(__builtin_fabsf(from[i]) <= half)) leaves = 0;
      continue;
    }
    const float inverse = 1.0f / to[i], a = (-half - from[i]) * inverse, b = (half - from[i]) * inverse;
    enters = max(enters, min(a, b));
    leaves = min(leaves, max(a, b));
  }
  if (!(enters < leaves)) return walk_add(walk, walk.length, even);
  if (enters > 0.0f) walk_add(walk, enters, even);
  // Where the ray gets to along each axis next, and what that changes; of lane 3 and of axes that it does not go along: never.
  F4 border{}, origin{}, inverse{}, step{};
  std::ptrdiff_t strides[3];
  border += kInfinity;
  inverse += 1.0f;
  const RateBox* box = grid.boxes;
  std::ptrdiff_t stride = 1;
  for (int i = 0; i < 3; ++i, stride *= grid.size) {
    const int n = static_cast<int>(clamp(from[i] + to[i] * enters + half, 0.0f, 2.0f * half - 1.0f));
    const bool up = to[i] > 0.0f;
    box += stride * n;
    strides[i] = up ? stride : -stride;
    if (to[i] == 0.0f) continue;
    border[i] = static_cast<float>(up ? n + 1 : n) - half;
    origin[i] = from[i];
    inverse[i] = 1.0f / to[i];
    step[i] = up ? 1.0f : -1.0f;
  }
  std::ptrdiff_t moves[8];
  for (int i = 0; i < 8; ++i) {
    moves[i] = (i & 1 ? strides[0] : 0) + (i & 2 ? strides[1] : 0) + (i & 4 ? strides[2] : 0);
  }
  for (float t = enters;;) {
    // The same sum as that by which it leaves the grid: no box is beyond.
    const F4 next = (border - origin) * inverse;
    const float end = min(min(next[0], next[1]), next[2]);
    const float until = min(end, leaves);
    if (until > t) {
      walk_add(walk, until, {box->sigma_t + even.sigma_t, box->residual + even.residual, box->shows + even.shows});
      t = until;
    }
    if (!(end < leaves)) break;
    const I4 crosses = next == F4{} + end;
    border += __builtin_bit_cast(F4, __builtin_bit_cast(I4, step) & crosses);
    box += moves[_mm_movemask_ps(__builtin_bit_cast(__m128, crosses)) & 7];
  }
  if (leaves < walk.length) walk_add(walk, walk.length, even);
}

/// Finds the stretches of a walk.
RELIEF_KERNEL void walk_find(MediumWalk& walk)
{
  RateBox even{walk.even.sigma_t, 0.0f, max_component(walk.even.sigma_t)};
  // What only shines needs samples as well; on an infinite way it has no radiance.
  if (!is_zero(walk.even.emission) && !(even.shows > 0.0f)) {
    if (walk.length < kInfinity)
      even.shows = 1.0f / walk.length;
    else
      walk.even.emission = {};
  }
  if (walk.size == 1) {
    const RateGrid& grid = varying_place(*walk.media[0], walk.instances[0]).rates;
    if (grid.num_levels == 1) return walk_find_in_grid(walk, grid, even);
  }
  struct Ways {
    Ways() {}
    union {
      RateWay of[kMostMedia];
    };
  } ways;
  for (int i = 0; i < walk.size; ++i) {
    ways.of[i] = rate_way_make(varying_place(*walk.media[i], walk.instances[i]).rates, walk.O, walk.D);
  }
  for (float t = 0; t < walk.length;) {
    float end = walk.length;
    RateBox box = even;
    for (int i = 0; i < walk.size; ++i) {
      const RateWay& way = ways.of[i];
      end = min(end, way.end);
      if (way.box == nullptr) continue;
      box.sigma_t += way.box->sigma_t;
      box.residual += way.box->residual;
      box.shows += way.box->shows;
    }
    if (end > t) walk_add(walk, end, box);
    t = end;
    for (int i = 0; i < walk.size; ++i) {
      if (!(ways.of[i].end > t)) rate_way_go(ways.of[i]);
    }
  }
}

/// Collisions that are wanted on a ray at least, on average, where what they correct is large enough to be seen.
inline constexpr float kWantedCollisions = 3.0f;
/// And where it is not, of the square of its optical depth, which is what the noise is made of. 20 to 100 gave the same noise for its
/// time.
inline constexpr float kCollisionsOfSquare = 20.0f;

/// Optical depth up to a collision.
/// @param u  [0, 1), a multiple of 2⁻²⁴: what is left to 1 is exact
RELIEF_KERNEL float free_depth(float u) { return -__builtin_logf(1.0f - u); }

/// How much of what a place goes by is in a stretch.
struct WalkPart {
  float size;   ///< of all of it
  float rate;   ///< 1/m at its start
  float fades;  ///< 1/m: the rate is over (1 + fades x)²
};

/// Puts a place where what it goes by comes to `next`.
/// @param part  (stretch, metres) -> WalkPart
template <typename Part>
RELIEF_KERNEL void walk_place_go(const MediumWalk& walk, WalkPlace& place, const Part& part)
{
  for (; place.stretch < walk.num_stretches; ++place.stretch) {
    const WalkStretch& stretch = walk.stretches[place.stretch];
    const WalkPart here = part(stretch, stretch.end - place.start);
    const float more = place.next - place.passed;
    if (more < here.size) {
      const float x = more / here.rate, t = place.start + x / max(1.0f - here.fades * x, 0x1p-20f);
      // By rounding it may be beyond.
      place.t = t < stretch.end ? t : place.start;
      return;
    }
    place.passed += here.size;
    place.start = stretch.end;
  }
  place.t = kInfinity;
}

/// Goes on to the next collision.
RELIEF_KERNEL void walk_collide(MediumWalk& walk)
{
  walk.collision.next += free_depth(counted_next(walk.numbers)) / walk.factor;
  walk_place_go(walk, walk.collision, [](const WalkStretch& stretch, float length) {
    const float rate = stretch.box.residual;
    return WalkPart{rate > 0.0f ? rate * length : 0.0f, rate, 0.0f};
  });
}

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
    const VaryingMedium* varying = medium_that_varies(g, m.inside[i]);
    if (varying == nullptr) {
      media_add(walk.even, g.media[medium_of_instance(g, m.inside[i])]);
    } else {
      walk.instances[walk.size] = m.inside[i];
      walk.media[walk.size++] = varying;
    }
  }
  walk_find(walk);
  float start = 0, residual = 0;
  Vec3f depth;
  for (int i = 0; i < walk.num_stretches; ++i) {
    WalkStretch& stretch = walk.stretches[i];
    const float size = stretch.end - start;
    if (stretch.box.residual > 0.0f) residual += stretch.box.residual * size;
    const auto add = [size](float& to, float sigma) {
      if (sigma > 0.0f) to += sigma * size;
    };
    stretch.depth = depth;
    add(depth.x, stretch.box.sigma_t.x);
    add(depth.y, stretch.box.sigma_t.y);
    add(depth.z, stretch.box.sigma_t.z);
    start = stretch.end;
  }
  walk.depth = depth;
  if (residual > 0.0f) {
    walk.factor = max(1.0f, min(kCollisionsOfSquare * residual, kWantedCollisions / residual));
    walk_collide(walk);
  }
  return walk;
}

/// Share of light that is left after an optical depth.
RELIEF_KERNEL Vec3f depth_transmittance(Vec3f depth)
{
  return {std::exp(-depth.x), std::exp(-depth.y), std::exp(-depth.z)};
}

/// Samples of a stretch. Light fades as 1 / (1 + depth) in each for them, which is near enough to an exponential.
RELIEF_KERNEL WalkPart walk_samples(const WalkStretch& stretch, float length)
{
  const Vec3f s = stretch.box.sigma_t;
  // By the channel that gets farthest. On an infinite way what is not weakened has no mean.
  const float fades = length < kInfinity ? min_component(s) : max_component(s);
  const float rate = stretch.box.shows * stretch.left;
  if (!(rate > 0.0f)) return {0.0f, 0.0f, 0.0f};
  if (!(length < kInfinity)) return {fades > 0.0f ? rate / fades : 0.0f, rate, fades};
  return {rate * length / (1.0f + fades * length), rate, fades};
}

/// Goes on to the next sample.
RELIEF_KERNEL void walk_place_sample(MediumWalk& walk)
{
  walk_place_go(walk, walk.sample, [](const WalkStretch& stretch, float length) {
    WalkPart part = walk_samples(stretch, length);
    part.size = stretch.samples;
    return part;
  });
}

/// Whether something sends out light.
RELIEF_KERNEL bool medium_walk_shines(const MediumWalk& walk)
{
  bool shines = !is_zero(walk.even.emission);
  for (int i = 0; i < walk.size; ++i) shines |= walk.media[i]->shines;
  return shines;
}

/// Samples that are wanted of a walk. With 3 to 8 noise for its time was the same within a tenth.
inline constexpr float kWantedSamples = 5.0f;
/// And so many more where a light is near.
inline constexpr float kNearSamples = 2.0f;
/// Below it little shows of what scatters.
inline constexpr float kLittleShows = 1.0f / 64.0f;

/// Asks for samples, spread by what shows.
/// @param u  [0, 1): where in their parts of the walk they are
RELIEF_KERNEL void medium_walk_sample(MediumWalk& walk, float u)
{
  float left = 1, start = 0, sum = 0;
  for (int i = 0; i < walk.num_stretches; ++i) {
    WalkStretch& stretch = walk.stretches[i];
    stretch.left = left;
    const WalkPart part = walk_samples(stretch, stretch.end - start);
    stretch.samples = part.size;
    sum += part.size;
    if (part.size > 0.0f && left > kLittleShows) {
      walk.reach = stretch.end < kInfinity ? stretch.end : start + 4.0f / part.fades;
    }
    left *= 1.0f / (1.0f + min_component(stretch.box.sigma_t) * (stretch.end - start));
    start = stretch.end;
  }
  if (!(sum > 0.0f)) return;
  walk.spacing = sum / kWantedSamples;
  walk.sample.next = walk.spacing * u;
  walk_place_sample(walk);
}

/// Goes on to the next sample that is near a light.
RELIEF_KERNEL void walk_near(MediumWalk& walk)
{
  const Equiangular& near = walk.near;
  walk.near_t = walk.near_angle < near.last ? near.nearest + near.distance * std::tan(walk.near_angle) : kInfinity;
  walk.near_angle += (near.last - near.first) * (1.0f / kNearSamples);
}

/// Asks for more samples near a light.
/// @param near  the walk, seen from there; its distance is above 0
/// @param u     [0, 1): where in their parts of it they are
RELIEF_KERNEL void medium_walk_approach(MediumWalk& walk, const Equiangular& near, float u)
{
  walk.near = near;
  walk.near_angle = near.first + (near.last - near.first) * (u * (1.0f / kNearSamples));
  walk_near(walk);
}

/// Samples a metre that are near a light.
RELIEF_KERNEL float medium_walk_near_rate(const MediumWalk& walk, float t)
{
  return walk.near.distance > 0.0f ? kNearSamples * equiangular_pdf(walk.near, t) : 0.0f;
}

/// Places of a walk that have been asked, and what the media are there.
struct MediumPlaces {
  MediumPlaces() {}
  int size = 0;
  float t[kMediumPoints];         ///< metres along the walk
  float rate[kMediumPoints];      ///< 1/m, of all places
  float corrects[kMediumPoints];  ///< 1/m, of collisions; 0: it is none
  Vec3f taken[kMediumPoints];     ///< sigma_t that the media are taken for, 1/m
  Vec3f passes[kMediumPoints];    ///< share of light that gets there, as they are taken for
  union {                         // of which media[medium < walk.size][place < size] are there
    Medium media[kMostMedia][kMediumPoints];
  };
};

/// Notes the next place, in order.
/// @return  false: there is none
RELIEF_KERNEL bool walk_next(MediumWalk& walk, MediumPlaces& out)
{
  for (;;) {
    const float t = min(walk.collision.t, min(walk.sample.t, walk.near_t));
    if (!(t < walk.length)) return false;
    const bool collides = walk.collision.t == t;
    if (collides) {
      walk_collide(walk);
    } else if (walk.sample.t == t) {
      walk.sample.next += walk.spacing;
      walk_place_sample(walk);
    } else {
      walk_near(walk);
      if (t < 0.0f) continue;
    }
    WalkPlace& at = walk.at;
    while (at.stretch + 1 < walk.num_stretches && !(t < walk.stretches[at.stretch].end)) {
      at.start = walk.stretches[at.stretch++].end;
    }
    const WalkStretch& stretch = walk.stretches[at.stretch];
    const RateBox& box = stretch.box;
    if (!(box.shows > 0.0f || box.residual > 0.0f)) continue;
    const float x = max(t - at.start, 0.0f), corrects = box.residual > 0.0f ? box.residual * walk.factor : 0.0f;
    float samples = medium_walk_near_rate(walk, t);
    if (walk.spacing > 0.0f) {
      const WalkPart part = walk_samples(stretch, stretch.end - at.start);
      samples += part.rate / (walk.spacing * sqr(1.0f + part.fades * x));
    }
    const int i = out.size++;
    out.t[i] = t;
    out.rate[i] = samples + corrects;
    out.corrects[i] = collides ? corrects : 0.0f;
    out.taken[i] = box.sigma_t;
    out.passes[i] = depth_transmittance(stretch.depth + box.sigma_t * x);
    return true;
  }
}

/// Asks the next places of a walk, all at once.
/// @return false: they were the last
RELIEF_KERNEL bool medium_walk_next(const KernelGlobals& g, MediumWalk& walk, const GraphRay& ray, MediumPlaces& out)
{
  out.size = 0;
  bool goes_on = true;
  while (goes_on && out.size < kMediumPoints) goes_on = walk_next(walk, out);
  if (out.size == 0) return false;
  Vec3f P[kMediumPoints];
  for (int k = 0; k < out.size; ++k) P[k] = walk.O + walk.D * out.t[k];
  for (int i = 0; i < walk.size; ++i) {
    varying_medium_eval(g, *walk.media[i], walk.instances[i], P, out.size, walk.D, ray, out.media[i]);
  }
  return goes_on;
}

/// All media at one of the places.
RELIEF_KERNEL MediaSum medium_place_media(const MediumWalk& walk, const MediumPlaces& places, int k)
{
  MediaSum sum = walk.even;
  for (int i = 0; i < walk.size; ++i) media_add(sum, places.media[i][k]);
  return sum;
}

/// What is left below this of light is more often followed no further, and counts for more where it is.
inline constexpr float kLittleLeft = 1.0f / 32.0f;

/// @param left  of light
/// @return      factor by which what is left is multiplied; 0: it ends
RELIEF_KERNEL float medium_walk_survive(MediumWalk& walk, Vec3f left)
{
  const float most = max_component(abs(left));
  if (!(most < kLittleLeft)) return 1.0f;
  const float chance = max(most / kLittleLeft, 0.25f);
  return counted_next(walk.numbers) < chance ? 1.0f / chance : 0.0f;
}

/// Corrects what is left of light at one of the places.
/// @param left     over what the media as they are taken for leave
/// @param sigma_t  that they really have there, 1/m
RELIEF_KERNEL void medium_walk_correct(MediumWalk& walk, const MediumPlaces& places, int k, Vec3f sigma_t, Vec3f& left)
{
  if (!(places.corrects[k] > 0.0f)) return;
  left *= Vec3f{1, 1, 1} - (sigma_t - places.taken[k]) / places.corrects[k];
  if (!is_zero(left)) left *= medium_walk_survive(walk, left * places.passes[k]);
}

/// Share of light that media let through, as a random number of that mean.
RELIEF_KERNEL Vec3f medium_walk_transmittance(const KernelGlobals& g, MediumWalk& walk, const GraphRay& ray)
{
  const Vec3f passes = depth_transmittance(walk.depth);
  if (!(walk.collision.t < walk.length)) return passes;
  Vec3f left = splat3(medium_walk_survive(walk, passes));
  MediumPlaces places;
  for (bool goes_on = true; goes_on && !is_zero(left);) {
    goes_on = medium_walk_next(g, walk, ray, places);
    for (int k = 0; k < places.size && !is_zero(left); ++k) {
      medium_walk_correct(walk, places, k, medium_place_media(walk, places, k).sigma_t, left);
    }
  }
  return is_zero(left) ? left : left * passes;
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
  const auto number = __builtin_bit_cast(std::uint32_t, from);
  MediumWalk walk =
      medium_walk_make(g, inside, way.O + way.D * from, way.D, to - from, hash_mix_32(way.seed ^ hash_mix_32(number)));
  return medium_walk_transmittance(g, walk, way.ray);
}

}  // namespace relief
