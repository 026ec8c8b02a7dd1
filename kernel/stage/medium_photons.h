// Photons in media: where they are kept, and what paths find of them.
//
// A photon is kept once on each stretch that is lit by a caustic, at a place of its own, and goes on with the chance that it gets
// through. What is scattered there is the paths': they find the photon, and are scattered to it as often as they may. So photons end
// in media, and a path gathers them on all its stretches, whatever it has met before.
//
// Where a stretch has media that vary, none are kept and none are found, and light that comes there through casters is the paths'.
#pragma once

#include "kernel/photon/gather.h"
#include "kernel/photon/medium_photons.h"
#include "kernel/sample/dimensions.h"
#include "kernel/sample/sobol.h"
#include "kernel/stage/medium_stretch.h"
#include "kernel/stage/photon_queue.h"

namespace relief {

/// Adds the light of the photons along a stretch, scattered towards where a path comes from.
/// @pre the path may be scattered once more
[[gnu::noinline]] RELIEF_KERNEL void shade_medium_photons(const KernelGlobals& g,
                                                          PathState& state,
                                                          std::uint32_t path,
                                                          const MediumStretch& at,
                                                          const MediaSum& media)
{
  const MediumState& m = state.media[path];
  // Behind the event a path would have to go on by a caster.
  if (!(static_cast<int>(m.bounces) < g.limits.volume)) return;
  std::uint32_t bounces = 0;
  if (!photon_bounces_left(g.limits, state.bounces[path], BounceKind::kMedium, &bounces)) return;
  const MediumPhotonsView& map = g.caustics.in_media;
  const std::uint32_t name = media_name(m);
  Vec3f sum;
  photons_along(map, at.O, at.D, at.length, [&](std::uint32_t i, float distance, float squared) {
    const PhotonArrival& photon = map.arrivals[i];
    if (photon.Ng != name || !photon_bounces_allowed(photon.bounces, bounces)) return;
    const Vec3f f = media_eval(media, at.D, octahedral_decode(photon.wi)).f;
    const float kernel = (1.0f - squared) * map.inverse_radius_squared[i];
    sum += photon.power * f * medium_transmittance(media.sigma_t, distance) * kernel;
  });
  if (is_zero(sum)) return;
  const Vec3f radiance = path_throughput(state, path) * sum * (2.0f * kInvPi);
  PathColumn<Vec3f>& caustic = *state.caustic.radiance;
  caustic[path] = caustic[path] + radiance_clamped(radiance, g.clamp_indirect);
}

/// Keeps a photon on a stretch through media that are even, if it shows there.
RELIEF_KERNEL void photon_medium_keep(const KernelGlobals& g,
                                      const PathState& state,
                                      std::uint32_t path,
                                      const MediumStretch& at,
                                      const MediaSum& media,
                                      PhotonQueueView& photons)
{
  const std::uint32_t flags = state.flags[path];
  const bool arrives = g.limits.volume > 0 && (flags & kPathCaustic) != 0 && (flags & kPathAfterSoft) == 0 &&
                       (g.caustics.switched_off >> path_event(flags) & 1u) == 0;
  const Vec3f throughput = path_throughput(state, path);
  const Vec3f carried = abs(throughput) * medium_albedo(media);
  if (!arrives || !(at.length > 0.0f) || !(max_component(carried) > 0.0f)) return;
  const Vec3f chances = channel_chances(carried);
  const Vec2f u = sample_2d(at.hash, at.sample, dimension_medium(at.number, MediumDimension::kDistance));
  const float distance = free_distance_sample_within(channel_choose(media.sigma_t, chances, u.y), at.length, u.x);
  const float pdf = free_distance_pdf_within(media.sigma_t, chances, at.length, distance);
  if (!(pdf > 0.0f) || !(distance < kInfinity)) return;
  const Vec3f power = throughput * medium_transmittance(media.sigma_t, distance) / pdf;
  if (is_zero(power) || !is_finite(power)) return;
  photons.photons[photons.size++] = {
      at.O + at.D * distance,
      {power, octahedral_encode(-at.D), media_name(state.media[path]), state.bounces[path] - 1u}};
}

/// Takes a photon through the media between where its ray starts and what it has met.
/// @return  whether it gets there
RELIEF_KERNEL bool photon_medium_stretch(const KernelGlobals& g,
                                         PathState& state,
                                         std::uint32_t path,
                                         PhotonQueueView& photons)
{
  const MediumState& m = state.media[path];
  const MediumStretch at = medium_stretch_next(state, path);
  Vec3f left;
  if (media_vary(g, m)) {
    const std::uint32_t seed = hash_mix_32(at.hash ^ hash_mix_32(at.sample * 0x9e3779b9u + at.number));
    MediumWalk walk = medium_walk_make(g, m, at.O, at.D, at.length, seed);
    left = medium_walk_transmittance(g, walk,
                                     {path_ray_kinds(state, path), state.bounces[path],
                                      state.flags[path] >> kPathTransparentShift, 0.0f, path_time(state, path)});
  } else {
    const MediaSum media = path_media(g, m);
    photon_medium_keep(g, state, path, at, media, photons);
    left = medium_transmittance(media.sigma_t, at.length);
  }
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
  MediumState& m = state.media[path];
  const bool is_boundary = medium_meet(g, state, path, hit);
  if (m.size > 0 && !photon_medium_stretch(g, state, path, photons)) {
    m.hit_inside = kWholeWorld;
    return false;
  }
  if (!is_boundary) return true;
  medium_pass_boundary(state, path, next);
  return false;
}

}  // namespace relief
