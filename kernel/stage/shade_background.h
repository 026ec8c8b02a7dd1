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
  if (scatterings == 0 && !g.environment_visible_to_camera) return;
  if (path_leaves_to_photons(g, state.flags[path], -1)) return;
  const Vec3f D = path_direction(state, path);
  Vec3f radiance = environment_eval(g.lights.environment, D);
  if (is_zero(radiance)) return;
  const float pdf = state.pdf[path];
  if (pdf > 0.0f) {
    const float pdf_light = lights_environment_pdf(g.lights, path_origin(state, path), path_scatter_N(state, path), D);
    radiance *= path_bsdf_weight(g.light_technique, pdf, pdf_light);
  }
  radiance *= path_transmittance(path_sigma_a(state, path), kInfinity);
  path_add_radiance(state, path, scatterings, path_throughput(state, path) * radiance, g.clamp_indirect);
}

}  // namespace relief
