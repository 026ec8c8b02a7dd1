// Stage: a path's ray has been searched, and is in media. It is weakened or scattered on its way to what it has met; and where its
// hit is no surface but a boundary, it goes on behind it.
//
// Light is asked for at a point of its own on every stretch, not where the path scatters: in thin fog few paths do. The point is by
// how light is weakened or, near a small light, as often by how near that is, and weighed as the sum of both (Kulla and Fajardo
// 2012). Against lights that paths meet, what is found is weighed by direction, as at surfaces.
//
// Photons are gathered all along a stretch (medium_photons.h).
//
// Where media vary, light is asked for and the path is scattered at one of the places that are asked on the way (medium_walk.h), each
// chosen by what it carries. The walk always goes to the end of the stretch, so that light is asked for on every one of these as well.
// Of what is thick and scatters more than once, and behind the first event, paths go by collisions instead, and ask for light where they
// are scattered (medium_flight.h): that takes less than half of the time, and no weights multiply from one event to the next.
#pragma once

#include "kernel/counters.h"
#include "kernel/sample/dimensions.h"
#include "kernel/sample/sobol.h"
#include "kernel/stage/light_ask.h"
#include "kernel/stage/medium_photons.h"
#include "kernel/stage/path_end.h"

namespace relief {

/// Where on a stretch light is asked for, or the path is scattered.
struct MediumPlace {
  float distance = 0;  ///< metres from its start
  float pdf = 0;       ///< a metre; 0: nowhere
  Vec3f carried{};     ///< what gets there of the path's light
};

/// Small lights that are farther from the ray than light gets on average, so many times, are not looked for along it: what they
/// light there is as even as the medium.
inline constexpr float kNearLight = 4.0f;

/// A stretch as it is seen from one of the small lights that light it.
/// @param middle  metres along the stretch, from where lights are chosen
/// @return        its distance is 0 where there is none
RELIEF_KERNEL Equiangular medium_near(const KernelGlobals& g, const MediumStretch& at, float middle, float time)
{
  if (g.lights.num_lights == g.lights.num_suns) return {};
  const Vec2f v = sample_2d(at.hash, at.sample, dimension_medium(at.number, MediumDimension::kPivot));
  const auto bits = [](float x) { return static_cast<std::uint32_t>(x * 0x1p24f) << 8; };
  const Vec3f P = at.O + at.D * middle;
  const LightsChoice chosen = lights_choose(g.lights, P, {}, choice_point(bits(v.x), bits(v.y)));
  if (!(chosen.probability > 0.0f && chosen.ref.light_index >= 0)) return {};
  Light storage;
  const Light& emitter = lights_at(g.lights, chosen.ref, storage, time);
  const LightSample light = lights_sample_chosen(g.lights, chosen, &emitter, P, {});
  if (!(light.pdf > 0.0f && light.distance < kInfinity)) return {};
  return equiangular_make(at.O, at.D, at.length, P + light.wi * light.distance);
}

/// Chooses where light is asked for.
RELIEF_KERNEL MediumPlace medium_place(const KernelGlobals& g, const MediumStretch& at, Vec3f sigma_t, float time)
{
  const Vec2f u = sample_2d(at.hash, at.sample, dimension_medium(at.number, MediumDimension::kDirect));
  const float sigma = channel_choose(sigma_t, at.chances, u.y);
  const float densest = max_component(sigma_t);
  Equiangular near = medium_near(g, at, min(0.5f * at.length, densest > 0.0f ? 1.0f / densest : at.length), time);
  if (near.distance * densest > kNearLight) near.distance = 0.0f;
  MediumPlace place;
  float x = u.x;
  const bool is_near = near.distance > 0.0f;
  if (is_near && x < 0.5f) {
    place.distance = min(equiangular_sample(near, 2.0f * x), at.length);
  } else {
    if (is_near) x = 2.0f * x - 1.0f;
    place.distance = free_distance_sample_within(sigma, at.length, x);
  }
  place.pdf = free_distance_pdf_within(sigma_t, at.chances, at.length, place.distance);
  if (is_near) place.pdf = 0.5f * (place.pdf + equiangular_pdf(near, place.distance));
  return place;
}

/// What becomes of a path on a stretch.
struct MediumFate {
  bool asks_sky = false;  ///< the environment is asked for in its place, should it be scattered
  float offered = 1;      ///< by how much of what is scattered it is, beside what passes
};

/// Queues a shadow ray from a place on a stretch.
/// @param fate  of the path: how likely it finds the light itself
RELIEF_KERNEL void shade_medium_light_at(const KernelGlobals& g,
                                         const PathState& state,
                                         std::uint32_t path,
                                         const MediumStretch& at,
                                         const MediaSum& media,
                                         MediumPlace place,
                                         MediumFate fate,
                                         ChoicePoint u,
                                         ShadowQueue& shadow)
{
  const Vec3f P = at.O + at.D * place.distance;
  const LightsChoice chosen = lights_choose(g.lights, P, {}, u);
  if (!(chosen.probability > 0.0f)) return;
  Light storage;
  const LightAnswer answer = light_ask(g, state, path, chosen, P, {}, storage);
  const LightSample& light = answer.sample;
  if (!(light.pdf > 0.0f) || is_zero(answer.radiance)) return;
  if (answer.emitter != nullptr && (answer.emitter->hidden_from & kHiddenFromScattered) != 0) return;
  const PhaseEval phase = media_eval(media, at.D, light.wi);
  const float found = fate.asks_sky && answer.emitter == nullptr ? phase.pdf : phase.pdf * fate.offered;
  const bool is_found_here_alone = light.delta || (answer.emitter != nullptr && !answer.emitter->multiple_importance);
  const float weight = path_light_weight(g.light_technique, light.pdf, found, is_found_here_alone);
  const Vec3f gain = place.carried * phase.f * answer.radiance * (weight / (light.pdf * place.pdf));
  if (is_zero(gain)) return;
  Vec3f D;
  float t_max = 0;
  shadow_ray_aim(light, answer.emitter, P, P, D, t_max);
  const RayCone cone =
      ray_cone_propagate({state.cone_width[path], state.cone_spread[path]}, state.t_min[path] + place.distance);
  const int bounces = path_bounces(state.bounces[path], BounceKind::kAll);
  shadow_queue_push(shadow, path, P, D, t_max, cone, gain,
                    path_shadow_scatterings(state, path, bounces + 1, asked_light_group(g, answer.emitter)) |
                        (bounces == 0 ? kMediumRay : 0u));
}

/// Asks the environment, from a place on a stretch, for what a path that is scattered there finds of it.
RELIEF_KERNEL void shade_medium_sky_at(const KernelGlobals& g,
                                       const PathState& state,
                                       std::uint32_t path,
                                       const MediumStretch& at,
                                       const MediaSum& media,
                                       MediumPlace place,
                                       ShadowQueue& shadow)
{
  if (g.film.layout.denoising && (state.flags[path] & kPathSawFeature) == 0) {
    film_add_denoising(g.film, state.pixel[path], sample_is_even(at.sample, g.log2_stream),
                       place.carried * media.sigma_s * (1.0f / place.pdf), {});
  }
  const Vec3f P = at.O + at.D * place.distance;
  const Vec2f u = sample_2d(at.hash, at.sample, dimension_medium_sky(at.number));
  const Vec3f wi = media_sample(media, at.D, u);
  const PhaseEval phase = media_eval(media, at.D, wi);
  if (!(phase.pdf > 0.0f)) return;
  const float weight = path_bsdf_weight(g.light_technique, phase.pdf, lights_environment_pdf(g.lights, P, {}, wi)) /
                       (phase.pdf * place.pdf);
  const Vec3f gain = place.carried * phase.f * environment_eval(g.lights.environment, wi) * weight;
  if (is_zero(gain)) return;
  const RayCone cone =
      ray_cone_propagate({state.cone_width[path], state.cone_spread[path]}, state.t_min[path] + place.distance);
  shadow_queue_push(shadow, path, P, wi, kInfinity, cone, gain,
                    path_shadow_scatterings(state, path, 1, g.environment_light_group) | kMediumRay);
}

/// Below this share of the light the environment is left to paths, and above the other one it is always asked for.
inline constexpr float kLittleSky = 0.2f, kMuchSky = 0.3f;

/// Decides what becomes of a path on a stretch.
///
/// One that is scattered for the last time finds lights alone, most of whose light has been asked for. Where a bright floor is seen
/// through a dense cloud, 1 has three times the noise, and .1 twice as much in front of a sky that is left to paths.
///
/// Where such a stretch is what the camera sees the sky is asked for as well, by where the medium scatters light to, and next to nothing
/// is left for the path to find: so it passes. Fog under a sky and a sun has a third of the noise so.
/// @param distance  metres: from where it is seen how much light comes from the sky. Where light is asked for and the path is scattered at
///                  different places, it must not depend on these
RELIEF_KERNEL MediumFate
medium_fate(const KernelGlobals& g, const PathState& state, std::uint32_t path, const MediumStretch& at, float distance)
{
  if (static_cast<int>(state.media[path].bounces) < g.limits.volume) return {};
  if (path_bounces(state.bounces[path], BounceKind::kAll) == 0) {
    const float share = lights_sky_share(g.lights, at.O + at.D * distance);
    const float chance = (share - kLittleSky) * (1.0f / (kMuchSky - kLittleSky));
    if (chance > 0.0f && sample_1d(at.hash, at.sample, dimension_medium(at.number, MediumDimension::kFate)) < chance) {
      return {true, 0.05f};
    }
  }
  return {false, 0.4f};
}

/// Chance with which light is asked for on a stretch: always on what the camera sees, and else by what is scattered there, as thin
/// media are passed more often than they are seen.
/// @param scattered  share of the path's light, at most 1
/// @return           0: it is not asked for this time
RELIEF_KERNEL float medium_asks(const PathState& state, std::uint32_t path, const MediumStretch& at, float scattered)
{
  const float chance = min(1.0f, 2.0f * scattered);
  if (path_bounces(state.bounces[path], BounceKind::kAll) == 0 || !(chance < 1.0f)) return 1.0f;
  // What the number decides else is of no account where it is asked for light.
  const float u = sample_1d(at.hash, at.sample, dimension_medium(at.number, MediumDimension::kFate));
  return u < chance ? chance : 0.0f;
}

/// Queues a shadow ray from a place on a stretch through media that are even.
RELIEF_KERNEL void shade_medium_light(const KernelGlobals& g,
                                      const PathState& state,
                                      std::uint32_t path,
                                      const MediumStretch& at,
                                      const MediaSum& media,
                                      MediumFate fate,
                                      ChoicePoint u,
                                      ShadowQueue& shadow)
{
  const float chance =
      medium_asks(state, path, at, max_component(Vec3f{1, 1, 1} - medium_transmittance(media.sigma_t, at.length)));
  if (!(chance > 0.0f)) return;
  MediumPlace place = medium_place(g, at, media.sigma_t, path_time(state, path));
  place.pdf *= chance;
  if (!(place.pdf > 0.0f) || !(place.distance < kInfinity)) return;
  place.carried = path_throughput(state, path) * medium_transmittance(media.sigma_t, place.distance);
  shade_medium_light_at(g, state, path, at, media, place, fate, u, shadow);
}

/// Decides what becomes of a path on a stretch through media that are even, and asks the environment if that is so, from a place by how
/// they weaken light.
RELIEF_KERNEL MediumFate shade_medium_fate(const KernelGlobals& g,
                                           const PathState& state,
                                           std::uint32_t path,
                                           const MediumStretch& at,
                                           const MediaSum& media,
                                           ShadowQueue& shadow)
{
  const Vec2f u = sample_2d(at.hash, at.sample, dimension_medium(at.number, MediumDimension::kDirect));
  MediumPlace place;
  place.distance = free_distance_sample_within(channel_choose(media.sigma_t, at.chances, u.y), at.length, u.x);
  const MediumFate fate = medium_fate(g, state, path, at, min(0.5f * at.length, 1.0f / max_component(media.sigma_t)));
  if (!fate.asks_sky || !(place.distance < kInfinity)) return fate;
  place.pdf = free_distance_pdf_within(media.sigma_t, at.chances, at.length, place.distance);
  if (!(place.pdf > 0.0f)) return fate;
  place.carried = path_throughput(state, path) * medium_transmittance(media.sigma_t, place.distance);
  shade_medium_sky_at(g, state, path, at, media, place, shadow);
  return fate;
}

/// Notes that a path is scattered: it covers the film whatever becomes of it, and a surface that it meets is not what the camera sees
/// there.
RELIEF_KERNEL void medium_cover(const KernelGlobals& g, PathState& state, std::uint32_t path)
{
  if ((state.flags[path] & kPathSawSurface) != 0) return;
  state.flags[path] |= kPathSawSurface;
  film_add_clear(g.film, state.pixel[path], -1.0f);
}

/// Notes for denoising where a path is first scattered.
/// @param albedo  of the place, with what the path has passed
RELIEF_KERNEL void shade_medium_feature(const KernelGlobals& g,
                                        PathState& state,
                                        std::uint32_t path,
                                        const MediumStretch& at,
                                        Vec3f albedo)
{
  if (!g.film.layout.denoising || (state.flags[path] & kPathSawFeature) != 0) return;
  state.flags[path] |= kPathSawFeature;
  film_add_denoising(g.film, state.pixel[path], sample_is_even(at.sample, g.log2_stream), albedo, {});
}

/// Sends a path on from where it is scattered, or ends it.
/// @param place   what is carried there is by the density of the place
/// @param albedo  of the place, with what the path has passed
RELIEF_KERNEL void shade_medium_scatter(const KernelGlobals& g,
                                        PathState& state,
                                        std::uint32_t path,
                                        const MediumStretch& at,
                                        const MediaSum& media,
                                        MediumPlace place,
                                        Vec3f albedo,
                                        MediumFate fate,
                                        Vec2f u,
                                        QueueView& next)
{
  medium_cover(g, state, path);
  // Where the environment is asked for, what is scattered has been told.
  shade_medium_feature(g, state, path, at, fate.asks_sky ? Vec3f{} : albedo);
  const Vec3f wi = media_sample(media, at.D, u);
  const PhaseEval phase = media_eval(media, at.D, wi);
  if (!(phase.pdf > 0.0f)) return;
  Vec3f throughput = place.carried * (phase.f / phase.pdf);
  const bool first = path_bounces(state.bounces[path], BounceKind::kAll) == 0;
  const float carried = max_component(abs(throughput));
  if (first) {
    state.first_throughput[path] = min(1.0f, carried);
    MediumState& m = state.media[path];
    m.is_lit_first = true;
    m.sky_is_asked = fate.asks_sky;
    m.before[0] = state.direct[path];
    m.before[1] = state.indirect[path];
  } else {
    const float roulette = sample_1d(at.hash, at.sample, dimension_medium(at.number, MediumDimension::kFate));
    const float survival = min(1.0f, kSurvivalRate * carried / state.first_throughput[path]);
    if (!(roulette < survival)) return;
    throughput *= 1.0f / survival;
  }
  if (is_zero(throughput)) return;
  RayCone cone =
      ray_cone_propagate({state.cone_width[path], state.cone_spread[path]}, state.t_min[path] + place.distance);
  cone = ray_cone_scatter(cone, 1.0f);
  path_set_ray(state, path, at.O + at.D * place.distance, wi);
  state.throughput[path] = throughput;
  state.pdf[path] = phase.pdf * fate.offered;
  state.least_pdf[path] = min(state.least_pdf[path], phase.pdf);
  path_set_scattered_at(state, path, {});
  state.bounces[path] += 1u;
  // Where the path comes from photons have been gathered.
  if (g.caustics.enabled) state.flags[path] = path_flags_left_to_paths(state.flags[path]) | kPathAfterSoft;
  state.flags[path] |= kPathScattered | kPathCovers;
  state.cone_width[path] = cone.width;
  state.cone_spread[path] = cone.spread;
  if (static_cast<int>(++state.media[path].bounces) > g.limits.volume) state.flags[path] |= kPathLast;
  queue_push(next, path);
}

/// Adds what media on a stretch send towards where the path came from.
RELIEF_KERNEL void shade_medium_emission(const KernelGlobals& g, PathState& state, std::uint32_t path, Vec3f emitted)
{
  const int bounce = path_bounces(state.bounces[path], BounceKind::kAll);
  if (bounce == 0) film_add_emission(g.film, state.pixel[path], emitted);
  path_add_denoising(g, state, path, emitted);
  path_add_radiance(g, state, path, bounce, emitted, 0);
}

/// One of several places, each kept as likely as by what it carries.
struct KeptPlace {
  KeptPlace() {}
  float total = 0;  ///< what all of them carry, channels added
  float share = 0;  ///< what this one does
  float distance = 0;
  Vec3f weight;  ///< what gets there of the path's light, over the rate
  union {        // of which those of the media that vary are there
    Medium varying[kMostMedia];
  };
};

/// Whether the latest of several offers takes the place of those before.
/// @param total  of all so far
/// @param u      [0, 1), used up bit by bit
RELIEF_KERNEL bool offer_wins(float total, float share, float& u)
{
  const float chance = share / total;
  const bool wins = u < chance;
  u = min(wins ? u / chance : (u - chance) / (1.0f - chance), 1.0f - 0x1p-24f);
  return wins;
}

/// @param k  its place among the places
/// @param u  see offer_wins
RELIEF_KERNEL void place_offer(KeptPlace& kept,
                               const MediumWalk& walk,
                               const MediumPlaces& places,
                               int k,
                               Vec3f weight,
                               float share,
                               float& u)
{
  kept.total += share;
  if (!offer_wins(kept.total, share, u)) return;
  kept.share = share;
  kept.distance = places.t[k];
  kept.weight = weight;
  for (int i = 0; i < walk.size; ++i) new (&kept.varying[i]) Medium(places.media[i][k]);
}

RELIEF_KERNEL MediaSum place_media(const MediumWalk& walk, const KeptPlace& kept)
{
  MediaSum sum = walk.even;
  for (int i = 0; i < walk.size; ++i) media_add(sum, kept.varying[i]);
  return sum;
}

/// Optical depth from which on the camera's rays go by collisions, too. Below, what passes and what is scattered both show, and a look at
/// all of the way has less noise; as it has at any depth where light is scattered only once (a fire with smoke: half).
inline constexpr float kThick = 2.0f;

/// Whether a path behind its first event goes by collisions: so do all but those that are near a small light, of which light is asked for
/// with less noise by how near it is.
RELIEF_KERNEL bool medium_flies(const KernelGlobals& g,
                                const PathState& state,
                                std::uint32_t path,
                                const MediumStretch& at)
{
  if (g.lights.num_lights == g.lights.num_suns) return true;
  if (state.media[path].bounces == 0) return false;
  const Equiangular near = medium_near(g, at, 0.0f, path_time(state, path));
  return !(near.distance > 0.0f && near.distance < at.length);
}

/// Takes a path that may be scattered once more to its next collision, and asks for light there.
/// @return  as shade_medium_stretch
[[gnu::noinline]] RELIEF_KERNEL bool shade_medium_flight(const KernelGlobals& g,
                                                         PathState& state,
                                                         std::uint32_t path,
                                                         const MediumStretch& at,
                                                         const MediumRay& ray,
                                                         std::uint32_t seed,
                                                         QueueView& next,
                                                         ShadowQueue& shadow)
{
  CountedNumbers numbers{seed};
  MediumFlight flight;
  medium_fly(g, ray, medium_graph_ray(state, path), numbers, path_throughput(state, path), flight);
  if (!is_zero(flight.emitted)) shade_medium_emission(g, state, path, flight.emitted);
  if (!flight.scatters) {
    state.throughput[path] = flight.left;
    return !is_zero(flight.left) || path_bounces(state.bounces[path], BounceKind::kAll) == 0;
  }
  const Sample2dX4 u = sample_2d_x4(at.hash, at.sample, dimension_medium(at.number, MediumDimension::kLight));
  const MediaSum media = flight_media(ray, flight);
  const Vec3f albedo = path_throughput(state, path) * medium_albedo(media);
  const MediumFate fate = medium_fate(g, state, path, at, flight.distance);
  if (fate.asks_sky) {
    shade_medium_sky_at(g, state, path, at, media, {flight.distance, 1.0f, flight.left}, shadow);
  } else {
    shade_medium_feature(g, state, path, at, albedo);
  }
  medium_cover(g, state, path);
  if (g.has_lights) {
    shade_medium_light_at(g, state, path, at, media, {flight.distance, 1.0f, flight.left}, fate,
                          choice_point(u.first_bits[0], u.first_bits[1]), shadow);
  }
  if (!(u.at[2].x < fate.offered)) return false;
  const MediumPlace place{flight.distance, 1.0f, flight.left * (1.0f / fate.offered)};
  shade_medium_scatter(g, state, path, at, media, place, albedo, fate, u.at[1], next);
  return false;
}

/// As shade_medium_stretch, where some of the media vary.
[[gnu::noinline]] RELIEF_KERNEL bool shade_medium_varying(const KernelGlobals& g,
                                                          PathState& state,
                                                          std::uint32_t path,
                                                          const MediumStretch& at,
                                                          QueueView& next,
                                                          ShadowQueue& shadow)
{
  const bool is_first = path_bounces(state.bounces[path], BounceKind::kAll) == 0;
  const bool last = path_is_last(g, state, path);
  const Vec3f throughput = path_throughput(state, path);
  const std::uint32_t seed = medium_seed(at);
  if (g.caustics.enabled && !last) shade_medium_photons_varying(g, state, path, at, seed);
  if (!is_first && !last && medium_flies(g, state, path, at)) {
    const MediumRay ray = medium_ray_make(g, state.media[path], at.O, at.D, at.length);
    return shade_medium_flight(g, state, path, at, ray, seed, next, shadow);
  }
  const bool goes_on_scattered = static_cast<int>(state.media[path].bounces) < g.limits.volume;
  MediumWalk walk = medium_walk_make(g, state.media[path], at.O, at.D, at.length, seed);
  Sample2dX4 u = sample_2d_x4(at.hash, at.sample, dimension_medium(at.number, MediumDimension::kLight));
  if (!last || medium_walk_shines(walk)) medium_walk_sample(walk, u.at[3].x);
  Equiangular near;
  if (!last && g.has_lights && walk.reach > 0.0f) {
    near = medium_near(g, at, 0.5f * min(walk.reach, at.length), path_time(state, path));
  }
  if (near.distance > 0.0f && near.distance < walk.reach) {
    medium_walk_approach(walk, near, counted_next(walk.numbers));
  } else if (is_first && !last && goes_on_scattered && min_component(walk.depth) > kThick) {
    return shade_medium_flight(g, state, path, at, walk, seed, next, shadow);
  }
  const GraphRay ray = medium_graph_ray(state, path);
  Vec3f emitted, left{1, 1, 1};
  KeptPlace scattered, lit;
  MediumPlaces places;
  for (bool goes_on = !is_zero(throughput); goes_on && !is_zero(left);) {
    goes_on = medium_walk_next(g, walk, ray, places);
    for (int k = 0; k < places.size && !is_zero(left); ++k) {
      const MediaSum media = medium_place_media(walk, places, k);
      const Vec3f weight = throughput * left * places.passes[k] / places.rate[k];
      emitted += weight * media.emission;
      const float share = last ? 0.0f : carried_share(weight * media.sigma_s);
      if (share > 0.0f) {
        place_offer(scattered, walk, places, k, weight, share, u.at[2].y);
        // Light is asked for as likely as it is near, or where there is nothing like that.
        const float nearness = 1.0f + medium_walk_near_rate(walk, places.t[k]) * walk.reach;
        if (g.has_lights) place_offer(lit, walk, places, k, weight, share * nearness, u.at[3].y);
      }
      medium_walk_correct(walk, places, k, media.sigma_t, left);
    }
  }
  const Vec3f carried = throughput * left * depth_transmittance(walk.depth);
  if (!is_zero(emitted)) shade_medium_emission(g, state, path, emitted);
  const float passing = carried_share(carried);
  const MediumFate fate =
      scattered.total > 0.0f ? medium_fate(g, state, path, at, 0.5f * min(walk.reach, at.length)) : MediumFate{};
  if (fate.asks_sky) {
    shade_medium_sky_at(g, state, path, at, place_media(walk, scattered),
                        {scattered.distance, scattered.share / scattered.total, scattered.weight}, shadow);
  }
  if (lit.total > 0.0f) {
    const float asked = medium_asks(state, path, at, scattered.total / (scattered.total + passing));
    if (asked > 0.0f) {
      shade_medium_light_at(g, state, path, at, place_media(walk, lit),
                            {lit.distance, asked * lit.share / lit.total, lit.weight}, fate,
                            choice_point(u.first_bits[0], u.first_bits[1]), shadow);
    }
  }
  const float offered = scattered.total * fate.offered;
  const float chance = offered > 0.0f ? offered / (offered + passing) : 0.0f;
  if (u.at[2].x < chance) {
    const MediaSum media = place_media(walk, scattered);
    const MediumPlace place{scattered.distance, 1.0f,
                            scattered.weight * (scattered.total / (scattered.share * chance))};
    shade_medium_scatter(g, state, path, at, media, place, throughput * medium_albedo(media), fate, u.at[1], next);
    return false;
  }
  state.throughput[path] = passing > 0.0f ? carried / (1.0f - chance) : Vec3f{};
  return passing > 0.0f || is_first;
}

/// Takes a path through the media between where its ray starts and what it has met.
/// @return  whether it gets there; else it has gone on elsewhere, or ended
RELIEF_KERNEL bool shade_medium_stretch(const KernelGlobals& g,
                                        PathState& state,
                                        std::uint32_t path,
                                        QueueView& next,
                                        ShadowQueue& shadow)
{
  const MediumState& m = state.media[path];
  MediumStretch at = medium_stretch_next(state, path);
  if (media_vary(g, m)) return shade_medium_varying(g, state, path, at, next, shadow);
  const MediaSum media = path_media(g, m);
  const Vec3f sigma_t = media.sigma_t;
  const Vec3f throughput = path_throughput(state, path);
  if (!is_zero(media.emission)) {
    const Vec3f emitted = throughput * media.emission * medium_transmittance_integral(sigma_t, at.length);
    // What shines on an infinite way, and takes nothing away, has no radiance.
    if (is_finite(emitted)) shade_medium_emission(g, state, path, emitted);
  }
  const bool is_first = path_bounces(state.bounces[path], BounceKind::kAll) == 0;
  const Vec3f carried = throughput * medium_albedo(media);
  if (path_is_last(g, state, path) || !(at.length > 0.0f) || !(max_component(carried) > 0.0f)) {
    state.throughput[path] = throughput * medium_transmittance(sigma_t, at.length);
    return !is_zero(path_throughput(state, path)) || is_first;
  }
  if (g.caustics.enabled) shade_medium_photons(g, state, path, at, media);
  at.chances = channel_chances(carried);
  const Sample2dX4 u = sample_2d_x4(at.hash, at.sample, dimension_medium(at.number, MediumDimension::kLight));
  const MediumFate fate = shade_medium_fate(g, state, path, at, media, shadow);
  if (g.has_lights) {
    shade_medium_light(g, state, path, at, media, fate, choice_point(u.first_bits[0], u.first_bits[1]), shadow);
  }
  // Of what each channel decides, the part that scatters.
  const Vec3f passes = medium_transmittance(sigma_t, at.length);
  const float offered = fate.offered;
  const auto scatters = [offered](float pass) { return offered * (1.0f - pass) / (offered * (1.0f - pass) + pass); };
  const Vec3f q{scatters(passes.x), scatters(passes.y), scatters(passes.z)};
  const float chosen = channel_choose(q, at.chances, u.at[2].y);
  if (u.at[2].x < chosen) {
    const float sigma = channel_choose(sigma_t, at.chances, u.at[2].y);
    const float distance = free_distance_sample_within(sigma, at.length, u.at[2].x / chosen);
    const Vec3f left = medium_transmittance(sigma_t, distance);
    const float pdf = free_distance_pdf_within(sigma_t, at.chances * q, at.length, distance);
    if (!(pdf > 0.0f)) return false;
    const MediumPlace place{distance, pdf, throughput * left / pdf};
    shade_medium_scatter(g, state, path, at, media, place, carried, fate, u.at[1], next);
    return false;
  }
  const float chance = dot(at.chances, Vec3f{1, 1, 1} - q);
  state.throughput[path] = chance > 0.0f ? throughput * passes / chance : Vec3f{};
  return chance > 0.0f || is_first;
}

/// Takes one path to what it has met. Reads the ray, the hit and the path's media; where the path is scattered it writes what
/// shade_surface does.
/// @return  whether what it has met is shaded; else it is scattered or has passed a boundary (pushed on `next`), or it ends
RELIEF_KERNEL bool shade_medium(const KernelGlobals& g,
                                PathState& state,
                                std::uint32_t path,
                                MediumHit hit,
                                QueueView& next,
                                ShadowQueue& shadow)
{
  return medium_travel(g, state, path, hit, next, [&] { return shade_medium_stretch(g, state, path, next, shadow); });
}

}  // namespace relief
