// Stage: a path whose ray met nothing.
#pragma once

#include "kernel/counters.h"
#include "kernel/globals.h"
#include "kernel/stage/emitter.h"

namespace relief {

/// Adds the radiance of suns that a ray meets which has met nothing else.
RELIEF_KERNEL void shade_sun_disks(const KernelGlobals& g, PathState& state, std::uint32_t path)
{
  const int scatterings = path_bounces(state.bounces[path], BounceKind::kAll);
  const Vec3f D = path_direction(state, path);
  for (std::uint32_t i = 0; i < g.lights.num_suns; ++i) {
    const std::uint32_t index = g.lights.suns[i];
    const Light& sun = g.lights.lights[index];
    if (!light_is_sun_disk(sun) || !sun_light_is_met(sun, D) || !path_sees_light(state, path, sun)) continue;
    if (path_leaves_to_photons(g, state.flags[path], static_cast<std::int32_t>(index))) continue;
    Vec3f radiance = sun_light_radiance(sun, D);
    if (!sun.is_even) radiance = emitter_radiance(g, sun, radiance, {{}, {}, -D, lamp_ray(g, state, path)});
    const Vec3f seen = path_throughput(state, path) * radiance;
    if (is_zero(seen)) continue;
    if (scatterings == 0) film_add_emission(g.film, state.pixel[path], seen);
    path_add_denoising(g, state, path, seen);
    const float pdf = state.pdf[path];
    const float weight = pdf > 0.0f ? path_bsdf_weight(g.light_technique, pdf,
                                                       lights_sun_pdf(g.lights, path_origin(state, path),
                                                                      path_scattered_at(state, path), D, index))
                                    : 1.0f;
    path_add_radiance(g, state, path, scatterings, seen * weight, sun.light_group);
  }
}

/// Adds the radiance of the environment and of suns, weighted against next-event estimation; nothing where it has been asked for in the
/// path's place (shade_medium_sky).
/// Reads the ray, throughput, pdf and scatter normal; writes the radiance. The path ends.
RELIEF_KERNEL void shade_background(const KernelGlobals& g, PathState& state, std::uint32_t path, Counters& counters)
{
  ++counters.background_hits;
  if (g.lights.has_sun_disks) shade_sun_disks(g, state, path);
  const int scatterings = path_bounces(state.bounces[path], BounceKind::kAll);
  const bool is_kept = scatterings == 0 && g.film.layout.environment >= 0;
  const bool is_shown = scatterings == 0 ? g.environment_visible_to_camera
                                         : (g.environment_hidden_from & path_ray_kind(state.flags[path])) == 0;
  // What has passed through clear glass, a filter, or media leaves as much of the film clear as it has kept of its light. Of media
  // that is so before surroundings that are seen, too: paths pass them by another chance than by what they let through.
  if ((!g.environment_visible_to_camera || state.media != nullptr) && (state.flags[path] & kPathCovers) == 0) {
    const float share = light_scalar(path_throughput(state, path));
    film_add_clear(g.film, state.pixel[path], (state.flags[path] & kPathSawSurface) != 0 ? share : share - 1.0f);
    if (scatterings > 0 && !g.environment_visible_to_camera) return;
  }
  if (!is_shown && !is_kept) return;
  if (state.media != nullptr && scatterings == 1 && state.media[path].is_lit_first && state.media[path].sky_is_asked)
    return;
  if (path_leaves_to_photons(g, state.flags[path], -1)) return;
  const Vec3f D = path_direction(state, path);
  const bool is_backdrop = scatterings == 0 && g.has_backdrop;
  Vec3f radiance = environment_eval(is_backdrop ? g.backdrop : g.lights.environment, D);
  if (is_zero(radiance)) return;
  if (is_kept) film_add_environment(g.film, state.pixel[path], path_throughput(state, path) * radiance);
  if (!is_shown) return;
  path_add_denoising(g, state, path, path_throughput(state, path) * radiance);
  const float pdf = state.pdf[path];
  if (pdf > 0.0f) {
    const float pdf_light =
        lights_environment_pdf(g.lights, path_origin(state, path), path_scattered_at(state, path), D);
    radiance *= path_bsdf_weight(g.light_technique, pdf, pdf_light);
  }
  path_add_radiance(g, state, path, scatterings, path_throughput(state, path) * radiance, g.environment_light_group);
}

}  // namespace relief
