// Stage: a path whose ray met the surface of an area light (rectangle, disk, or ball). Such lights shine and let rays pass,
// as Blender's do; an emissive mesh is a surface and is shaded by shade_surface.
#pragma once

#include "kernel/counters.h"
#include "kernel/globals.h"
#include "kernel/math/rounding.h"
#include "kernel/stage/emitter.h"

namespace relief {

/// Adds the light's radiance, weighted against next-event estimation, and sends the ray on behind the light.
/// Reads the ray, hit, throughput, pdf and scatter normal; writes the radiance and t_min.
/// Next: intersect closest.
RELIEF_KERNEL void shade_light(const KernelGlobals& g, PathState& state, std::uint32_t path)
{
  const auto light_index = static_cast<std::int32_t>(g.area_light_index[state.hit_object[path] - g.num_instances]);
  Light storage;
  const float time = path_time(state, path);
  const Light& light = lights_at(g.lights, {light_index}, storage, time);
  const int scatterings = path_bounces(state.bounces[path], BounceKind::kAll);
  const Vec3f D = path_direction(state, path);
  const float t = state.hit_t[path];
  Vec3f radiance = light_emitted(light, D);
  const bool by_photons = path_leaves_to_photons(g, state.flags[path], light_index);
  if (!path_sees_light(state, path, light)) radiance = {};
  if (!light.is_even && !is_zero(radiance) && !by_photons) {
    radiance =
        emitter_radiance(g, light, radiance, {path_origin(state, path) + D * t, {}, -D, lamp_ray(g, state, path)});
  }
  if (!is_zero(radiance) && !by_photons) {
    const Vec3f seen = path_throughput(state, path) * radiance;
    if (scatterings == 0) film_add_emission(g.film, state.pixel[path], seen);
    path_add_denoising(g, state, path, seen);
    const float pdf = state.pdf[path];
    if (pdf > 0.0f) {
      const float pdf_light =
          lights_pdf(g.lights, path_origin(state, path), path_scattered_at(state, path), {light_index}, D, t, time);
      radiance *= path_bsdf_weight(g.light_technique, pdf, pdf_light);
    }
    path_add_radiance(g, state, path, scatterings, path_throughput(state, path) * radiance, light.light_group);
  }
  state.t_min[path] = t_min_behind(t);
}

}  // namespace relief
