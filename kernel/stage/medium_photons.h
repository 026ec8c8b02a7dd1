// Photons in media: where they are kept, and what paths find of them.
//
// A photon is kept once at most on each stretch that is lit by a caustic, at a place of its own, with what is scattered there, and goes
// on with the chance that it gets through. Where it is scattered to is the paths': they find the photon, and are scattered to it as
// often as they may. So photons end in media, and a path gathers them on all its stretches, whatever it has met before.
//
// Through media that are even all photons along a stretch count. Where some vary, one stands for all: what is left of its light on the
// way costs a walk (medium_walk.h).
#pragma once

#include "kernel/photon/gather.h"
#include "kernel/photon/medium_photons.h"
#include "kernel/sample/dimensions.h"
#include "kernel/sample/sobol.h"
#include "kernel/stage/medium_stretch.h"
#include "kernel/stage/photon_queue.h"

namespace relief {

/// Whom a search along a stretch wants.
struct MediumPhotonQuery {
  std::uint32_t media = 0;    ///< see media_name
  std::uint32_t bounces = 0;  ///< as PhotonQuery::bounces
};

RELIEF_KERNEL bool photon_is_wanted(const PhotonArrival& photon, const MediumPhotonQuery& query)
{
  return photon.Ng == query.media && photon_bounces_allowed(photon.bounces, query.bounces);
}

/// @return  false: the path finds none
RELIEF_KERNEL bool medium_photon_query(const KernelGlobals& g,
                                       const PathState& state,
                                       std::uint32_t path,
                                       MediumPhotonQuery* query)
{
  const MediumState& m = state.media[path];
  // Behind the event a path would have to go on by a caster.
  if (g.caustics.in_media.num_levels == 0 || !(static_cast<int>(m.bounces) < g.limits.volume)) return false;
  query->media = media_name(m);
  return photon_bounces_left(g.limits, state.bounces[path], BounceKind::kMedium, &query->bounces);
}

RELIEF_KERNEL void medium_photons_add(const KernelGlobals& g, PathState& state, std::uint32_t path, Vec3f radiance)
{
  const Vec3f light = radiance_clamped(radiance, g.clamp_indirect);
  PathColumn<Vec3f>& caustic = *state.caustic.radiance;
  caustic[path] = caustic[path] + light;
  if (path_bounces(state.bounces[path], BounceKind::kAll) == 0) {
    state.media[path].caustic += light;
  } else if (__builtin_expect(state.light_passes != nullptr, 0)) {
    light_passes_add(state.light_passes[path], state.light_passes[path].found, true, light);
  }
}

/// Of each channel, f over what is scattered.
RELIEF_KERNEL Vec3f phase_of_scattered(Vec3f f, Vec3f sigma_s)
{
  const auto axis = [](float value, float all) { return all > 0.0f ? value / all : 0.0f; };
  return {axis(f.x, sigma_s.x), axis(f.y, sigma_s.y), axis(f.z, sigma_s.z)};
}

/// Adds the light of the photons along a stretch through media that are even, scattered towards where a path comes from.
/// @pre the path may be scattered once more
[[gnu::noinline]] RELIEF_KERNEL void shade_medium_photons(const KernelGlobals& g,
                                                          PathState& state,
                                                          std::uint32_t path,
                                                          const MediumStretch& at,
                                                          const MediaSum& media)
{
  MediumPhotonQuery query;
  if (!medium_photon_query(g, state, path, &query)) return;
  const MediumPhotonsView& map = g.caustics.in_media;
  Vec3f sum;
  photons_along(map, at.O, at.D, at.length, [&](std::uint32_t i, float distance, float squared) {
    const PhotonArrival& photon = map.arrivals[i];
    if (!photon_is_wanted(photon, query)) return;
    const Vec3f f = media_eval(media, at.D, octahedral_decode(photon.wi)).f;
    const float kernel = (1.0f - squared) * map.inverse_radius_squared[i];
    sum += photon.power * f * medium_transmittance(media.sigma_t, distance) * kernel;
  });
  if (is_zero(sum)) return;
  const Vec3f scattered = phase_of_scattered(sum, media.sigma_s) * (2.0f * kInvPi);
  medium_photons_add(g, state, path, path_throughput(state, path) * scattered);
}

/// The same where some of the media vary.
[[gnu::noinline]] RELIEF_KERNEL void shade_medium_photons_varying(const KernelGlobals& g,
                                                                  PathState& state,
                                                                  std::uint32_t path,
                                                                  const MediumStretch& at,
                                                                  std::uint32_t seed)
{
  MediumPhotonQuery query;
  if (!medium_photon_query(g, state, path, &query)) return;
  const MediumPhotonsView& map = g.caustics.in_media;
  CountedNumbers numbers{hash_mix_32(seed + 1u)};
  float total = 0.0f, share = 0.0f, distance = 0.0f, kernel = 0.0f;
  std::uint32_t chosen = 0;
  photons_along(map, at.O, at.D, at.length, [&](std::uint32_t i, float t, float squared) {
    const PhotonArrival& photon = map.arrivals[i];
    if (!photon_is_wanted(photon, query)) return;
    const float of_this = (1.0f - squared) * map.inverse_radius_squared[i];
    const float weight = of_this * max_component(abs(photon.power));
    total += weight;
    if (!(counted_next(numbers) * total < weight)) return;
    share = weight;
    chosen = i;
    distance = t;
    kernel = of_this;
  });
  if (!(share > 0.0f)) return;
  const PhotonArrival& photon = map.arrivals[chosen];
  MediumWalk walk = medium_walk_make(g, state.media[path], at.O, at.D, distance, hash_mix_32(seed + 2u));
  const GraphRay ray = medium_graph_ray(state, path);
  // What the media are at the photon, for its share of what is scattered has been asked for there.
  const Vec3f P{map.x[chosen], map.y[chosen], map.z[chosen]};
  Medium varying[kMostMedia];
  MediaSum media = walk.even;
  for (int i = 0; i < walk.size; ++i) {
    varying_medium_eval(g, *walk.media[i], walk.instances[i], &P, 1, at.D, ray, &varying[i]);
    media_add(media, varying[i]);
  }
  const Vec3f phase = phase_of_scattered(media_eval(media, at.D, octahedral_decode(photon.wi)).f, media.sigma_s);
  if (is_zero(phase)) return;
  const Vec3f left = medium_ray_transmittance(g, walk, ray, walk.numbers);
  medium_photons_add(
      g, state, path,
      path_throughput(state, path) * photon.power * phase * left * (kernel * (total / share) * (2.0f * kInvPi)));
}

/// Whether a photon's ray is lit by a caustic that media show.
RELIEF_KERNEL bool photon_shows_in_media(const KernelGlobals& g, const PathState& state, std::uint32_t path)
{
  const std::uint32_t flags = state.flags[path];
  return g.limits.volume > 0 && (flags & kPathCaustic) != 0 && (flags & kPathAfterSoft) == 0 &&
         (g.caustics.switched_off >> path_event(flags) & 1u) == 0;
}

/// @param power  what is scattered there, W
RELIEF_KERNEL void photon_medium_push(const PathState& state,
                                      std::uint32_t path,
                                      const MediumStretch& at,
                                      float distance,
                                      Vec3f power,
                                      PhotonQueueView& photons)
{
  if (is_zero(power) || !is_finite(power) || !(distance < kInfinity)) return;
  photons.photons[photons.size++] = {
      at.O + at.D * distance,
      {power, octahedral_encode(-at.D), media_name(state.media[path]), state.bounces[path] - 1u}};
}

/// Keeps a photon on a stretch through media that are even, if it shows there.
/// @return  share of its light that they let through
RELIEF_KERNEL Vec3f photon_medium_even(const KernelGlobals& g,
                                       const PathState& state,
                                       std::uint32_t path,
                                       const MediumStretch& at,
                                       PhotonQueueView& photons)
{
  const MediaSum media = path_media(g, state.media[path]);
  const Vec3f throughput = path_throughput(state, path);
  const Vec3f carried = abs(throughput) * medium_albedo(media);
  if (photon_shows_in_media(g, state, path) && at.length > 0.0f && max_component(carried) > 0.0f) {
    const Vec3f chances = channel_chances(carried);
    const Vec2f u = sample_2d(at.hash, at.sample, dimension_medium(at.number, MediumDimension::kDistance));
    const float distance = free_distance_sample_within(channel_choose(media.sigma_t, chances, u.y), at.length, u.x);
    const float pdf = free_distance_pdf_within(media.sigma_t, chances, at.length, distance);
    const Vec3f scattered = throughput * medium_transmittance(media.sigma_t, distance) * media.sigma_s;
    if (pdf > 0.0f) photon_medium_push(state, path, at, distance, scattered / pdf, photons);
  }
  return medium_transmittance(media.sigma_t, at.length);
}

/// The same where some of the media vary: one of the places that are asked is chosen by what is scattered there.
[[gnu::noinline]] RELIEF_KERNEL Vec3f photon_medium_varying(const KernelGlobals& g,
                                                            const PathState& state,
                                                            std::uint32_t path,
                                                            const MediumStretch& at,
                                                            PhotonQueueView& photons)
{
  MediumWalk walk = medium_walk_make(g, state.media[path], at.O, at.D, at.length, medium_seed(at));
  const GraphRay ray = medium_graph_ray(state, path);
  if (!photon_shows_in_media(g, state, path)) return medium_ray_transmittance(g, walk, ray, walk.numbers);
  const Vec3f throughput = path_throughput(state, path);
  medium_walk_sample(walk, counted_next(walk.numbers));
  Vec3f left{1, 1, 1}, kept;
  float total = 0.0f, share = 0.0f, distance = 0.0f;
  MediumPlaces places;
  for (bool goes_on = true; goes_on && !is_zero(left);) {
    goes_on = medium_walk_next(g, walk, ray, places);
    for (int k = 0; k < places.size && !is_zero(left); ++k) {
      const MediaSum media = medium_place_media(walk, places, k);
      const Vec3f scattered = throughput * left * places.passes[k] * media.sigma_s / places.rate[k];
      const float weight = max_component(abs(scattered));
      total += weight;
      if (weight > 0.0f && counted_next(walk.numbers) * total < weight) {
        share = weight;
        kept = scattered;
        distance = places.t[k];
      }
      medium_walk_correct(walk, places, k, media.sigma_t, left);
    }
  }
  left *= depth_transmittance(walk.depth);
  if (share > 0.0f) photon_medium_push(state, path, at, distance, kept * (total / share), photons);
  return left;
}

/// Takes a photon through the media between where its ray starts and what it has met.
/// @return  whether it gets there
RELIEF_KERNEL bool photon_medium_stretch(const KernelGlobals& g,
                                         PathState& state,
                                         std::uint32_t path,
                                         PhotonQueueView& photons)
{
  const MediumStretch at = medium_stretch_next(state, path);
  const Vec3f left = media_vary(g, state.media[path]) ? photon_medium_varying(g, state, path, at, photons)
                                                      : photon_medium_even(g, state, path, at, photons);
  // Roulette by what the media take, as at surfaces.
  const Vec3f throughput = path_throughput(state, path);
  const float survival = min(1.0f, max_component(abs(throughput * left)) / max_component(abs(throughput)));
  const float u = sample_1d(at.hash, at.sample, dimension_medium(at.number, MediumDimension::kFate));
  if (!(u < survival)) return false;
  state.throughput[path] = throughput * left * (1.0f / survival);
  return true;
}

/// Takes a photon to what it has met. Reads the ray, the hit and the path's media.
/// @param photons  gets one at most
/// @return         whether what it has met is shaded; else it has passed a boundary (pushed on `next`), or it ends
RELIEF_KERNEL bool photon_medium(const KernelGlobals& g,
                                 PathState& state,
                                 std::uint32_t path,
                                 MediumHit hit,
                                 QueueView& next,
                                 PhotonQueueView& photons)
{
  return medium_travel(g, state, path, hit, next, [&] { return photon_medium_stretch(g, state, path, photons); });
}

}  // namespace relief
