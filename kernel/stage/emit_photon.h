// Stage: one photon from its number.
#pragma once

#include <concepts>

#include "kernel/globals.h"
#include "kernel/photon/sources.h"
#include "kernel/sample/dimensions.h"
#include "kernel/shape/surface_hit.h"
#include "kernel/stage/emitter.h"
#include "kernel/stage/path_access.h"

namespace relief {

/// A ray that carries light.
struct EmittedRay {
  Vec3f O{}, D{};
  Vec3f power{};  ///< W, over the density of the ray; 0: none
};

/// What light graphs are told of the ray that a photon comes by: as path_light_ray at the first hit of a path. Where it leads to
/// is not known yet, and lights whose graphs ask for that start no photons.
inline constexpr GraphRay kPhotonRay{0, 1, 0, 0.0f};

/// Parallel light that falls on a box from outside the scene, and from no further away: a ray from afar would miss what is
/// small by its rounding.
/// @param irradiance  W/m² across D
RELIEF_KERNEL EmittedRay
emit_from_afar(const PhotonSourcesView& sources, const Box3& box, Vec3f D, Vec3f irradiance, Vec2f u)
{
  const Vec3f P = box_aim_along(box, D, u);
  return {P - D * box_distance_out(sources.scene_box, P, -D), D, irradiance * box_shadow_area(box, D)};
}

/// What starts a photon.
struct PhotonAim {
  const PhotonSourcesView& sources;
  const Box3& box;
  Vec2f u_light, u;  ///< [0, 1)²: place on the light, or direction of a sun; direction, or place in the box
};

/// Light from a sun, a ball or a flat light towards a box.
RELIEF_KERNEL EmittedRay emit_from_light(FarLight, const KernelGlobals& g, const Light& light, const PhotonAim& aim)
{
  const LightSample sun = light_sample(SunLight{}, light, {}, aim.u_light);
  Vec3f irradiance = sun.radiance / sun.pdf;
  if (!light.is_even) irradiance = emitter_radiance(g, light, irradiance, {{}, {}, -sun.wi, kPhotonRay});
  return emit_from_afar(aim.sources, aim.box, -sun.wi, irradiance, aim.u);
}

template <std::derived_from<BallLight> Kind>
RELIEF_KERNEL EmittedRay emit_from_light(Kind kind, const KernelGlobals& g, const Light& light, const PhotonAim& aim)
{
  const Vec3f normal = warp_sphere(aim.u_light);
  const Vec3f O = light.P + normal * light.radius;
  const Vec2f u = aim.u;
  BoxDirection to_box;
  if (box_contains(aim.box, O)) {
    const float z = 1.0f - 2.0f * u.y;
    const float r = 2.0f * safe_sqrt(u.y * (1.0f - u.y));
    to_box = {{r * std::cos(2.0f * kPi * u.x), r * std::sin(2.0f * kPi * u.x), z}, 0.25f * kInvPi};
  } else {
    to_box = box_aim_from(aim.box, O, u);
  }
  if (!(to_box.pdf > 0.0f)) return {};
  float falloff = light_falloff(kind, light, dot(to_box.D, light.axis));
  // Radiance I / πr², over the density 1 / 4πr² of the place, by Lambert's cosine.
  if (light.radius > 0.0f) falloff *= 4.0f * max(0.0f, dot(to_box.D, normal));
  Vec3f intensity = light.emission;
  if (!light.is_even && falloff > 0.0f) {
    intensity = emitter_radiance(g, light, intensity, {O, {}, to_box.D, kPhotonRay});
  }
  return {O, to_box.D, intensity * (falloff / to_box.pdf)};
}

template <std::derived_from<FlatLight> Kind>
RELIEF_KERNEL EmittedRay emit_from_light(Kind kind, const KernelGlobals& g, const Light& light, const PhotonAim& aim)
{
  EmittedRay ray;
  const Vec2f q = light_coordinates(kind, aim.u_light);
  ray.O = light.P + light.edge_u * q.x + light.edge_v * q.y;
  float pdf = 0.0f;
  if (box_contains(aim.box, ray.O)) {
    // By the cosine, on a side chosen by chance where both shine.
    Vec3f axis = light.axis;
    Vec2f u = aim.u;
    if (light.two_sided) {
      if (u.x >= 0.5f) axis = -axis;
      u.x = 2.0f * (u.x >= 0.5f ? u.x - 0.5f : u.x);
    }
    const Vec3f local = warp_cosine_hemisphere(u);
    ray.D = from_local(frame_from_normal(axis), local);
    pdf = warp_cosine_hemisphere_pdf(local.z) * (light.two_sided ? 0.5f : 1.0f);
  } else {
    const BoxDirection to_box = box_aim_from(aim.box, ray.O, aim.u);
    ray.D = to_box.D;
    pdf = to_box.pdf;
  }
  const float cosine = dot(ray.D, light.axis);
  if (!(pdf > 0.0f) || !(light.two_sided || cosine > 0.0f)) return {};
  Vec3f radiance = light.emission * light_spread(light, cosine);
  // Of a mesh, whose lights are triangles here, the coordinates are weights of vertices; lamps do not ask for them.
  if (!light.is_even) radiance = emitter_radiance(g, light, radiance, {ray.O, q, ray.D, kPhotonRay});
  ray.power = radiance * (__builtin_fabsf(cosine) * light.area / pdf);
  if (light.instance_index >= 0) {
    const Vec3f error = gamma_bound(8) * (abs(light.P) + abs(light.edge_u) + abs(light.edge_v));
    ray.O = offset_ray_origin(ray.O, error, cosine > 0.0f ? light.axis : -light.axis);
  }
  return ray;
}

/// Starts a photon as path `path`. Its throughput is its power; its pixel, the group of casters it is aimed at.
/// @return false: it carries nothing
RELIEF_KERNEL bool emit_photon(const KernelGlobals& g,
                               const PhotonSourcesView& sources,
                               PathState& state,
                               std::uint32_t path,
                               std::uint64_t number)
{
  // No pixel of an image is there.
  const std::uint32_t hash = sample_pixel_hash(g.seed, -1, -1 - static_cast<int>(number >> 32));
  const auto index = static_cast<std::uint32_t>(number);
  const auto choice = static_cast<double>(sample_1d(hash, index, dimension_photon(PhotonDimension::kSource)));
  std::uint32_t low = 0;
  for (std::uint32_t length = sources.num_sources; length > 1;) {
    const std::uint32_t half = length / 2;
    if (sources.cdf[low + half] <= choice) low += half;
    length -= half;
  }
  const double probability = sources.cdf[low + 1] - sources.cdf[low];
  const PhotonSource& source = sources.sources[low];
  const Box3& box = sources.targets[source.target];
  const Vec2f u_light = sample_2d(hash, index, dimension_photon(PhotonDimension::kLight));
  const Vec2f u = sample_2d(hash, index, dimension_photon(PhotonDimension::kAim));

  EmittedRay ray;
  std::uint32_t hidden_from = 0;
  if (source.light.light_index < 0) {
    const EnvironmentSample sample = environment_sample_all(g.lights.environment, u_light);
    ray = emit_from_afar(sources, box, -sample.wi, sample.radiance / sample.pdf_solid_angle, u);
  } else {
    Light storage;
    const Light& light = lights_at(g.lights, source.light, storage, g.caustics.time);
    hidden_from = light.hidden_from;
    const PhotonAim aim{sources, box, u_light, u};
    ray = light_visit(light, [&](auto kind) { return emit_from_light(kind, g, light, aim); });
  }
  const float factor = sources.factors != nullptr ? sources.factors[low] : 1.0f;
  const Vec3f power = ray.power * (factor * static_cast<float>(1.0 / (probability * sources.photons_a_pass)));
  if (is_zero(power) || !is_finite(power)) return false;

  path_set_ray(state, path, ray.O, ray.D);
  state.throughput[path] = power;
  state.pixel[path] = source.target;
  state.sample_index[path] = index;
  state.pixel_hash[path] = hash;
  // One, since none means a camera ray.
  state.bounces[path] = 1;
  state.flags[path] = kPathPhoton | hidden_from << kPathHiddenShift;
  state.cone_width[path] = state.cone_spread[path] = 0.0f;
  state.least_pdf[path] = kInfinity;
  if (state.motion.time != nullptr) state.motion.time[path] = g.caustics.time;
  if (state.facets != nullptr) state.facets[path].height = 0.0f;
  return true;
}

}  // namespace relief
