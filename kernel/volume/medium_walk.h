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

#include "kernel/volume/distance.h"
#include "kernel/volume/medium_flight.h"

namespace relief {

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

/// A walk along a part of a ray.
struct MediumWalk : MediumRay {
  MediumWalk() {}
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

/// Collisions that are wanted on a ray at least, on average, where what they correct is large enough to be seen.
inline constexpr float kWantedCollisions = 3.0f;
/// And where it is not, of the square of its optical depth, which is what the noise is made of. 20 to 100 gave the same noise for its
/// time.
inline constexpr float kCollisionsOfSquare = 20.0f;

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

/// Finds the stretches of a walk.
RELIEF_KERNEL void walk_find(MediumWalk& walk)
{
  rate_boxes_visit(walk, [&walk](float end, const RateBox& box) {
    walk_add(walk, end, box);
    return true;
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
  medium_ray_enter(g, m, walk);
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

}  // namespace relief
