// Stage: a path whose ray met nothing.
#pragma once

#include "kernel/counters.h"
#include "kernel/globals.h"
#include "kernel/stage/path_access.h"

namespace relief {

/// Adds the environment's radiance, weighted against next-event estimation.
/// Reads the ray, throughput, pdf, scatter normal and medium; writes the radiance. The path ends.
RELIEF_KERNEL void shade_background(const KernelGlobals& g, PathState& state, std::uint32_t path, Counters& counters)
{
  ++counters.background_hits;
  const int scatterings = path_bounces(state.bounces[path], BounceKind::kAll);
  const bool is_kept = scatterings == 0 && g.film.layout.environment >= 0;
  const bool is_shown = scatterings > 0 ? (g.environment_hidden_from >> path_event(state.flags[path]) & 1u) == 0
                                        : g.environment_visible_to_camera;
  if (!is_shown && !is_kept) return;
  if (path_leaves_to_photons(g, state.flags[path], -1)) return;
  const Vec3f D = path_direction(state, path);
  const bool is_backdrop = scatterings == 0 && g.has_backdrop;
  Vec3f radiance = environment_eval(is_backdrop ? g.backdrop : g.lights.environment, D);
  if (is_zero(radiance)) return;
  radiance *= path_transmittance(path_sigma_a(state, path), kInfinity);
  if (is_kept) film_add_environment(g.film, state.pixel[path], path_throughput(state, path) * radiance);
  if (!is_shown) return;
  path_add_denoising(g, state, path, path_throughput(state, path) * radiance);
  const float pdf = state.pdf[path];
  if (pdf > 0.0f) {
    const float pdf_light = lights_environment_pdf(g.lights, path_origin(state, path), path_scatter_N(state, path), D);
    radiance *= path_bsdf_weight(g.light_technique, pdf, pdf_light);
  }
  path_add_radiance(state, path, scatterings, path_throughput(state, path) * radiance, g.clamp_indirect);
}

}  // namespace relief
