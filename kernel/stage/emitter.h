// What a point of a light sends out that does not shine evenly.
#pragma once

#include "kernel/shape/material_lookup.h"
#include "kernel/shape/surface_hit.h"
#include "kernel/stage/path_access.h"

namespace relief {

/// The ray of a path that asks for light at its present hit: of no kind, as in Cycles, and after one event more than the path
/// has had, which is what a path that goes on to the light counts there.
/// @param distance  metres to the light
RELIEF_KERNEL GraphRay path_light_ray(const PathState& state, std::uint32_t path, float distance)
{
  return {0, state.bounces[path] + 1u, state.flags[path] >> kPathTransparentShift, distance};
}

/// What the graph of a lamp is told of a path's ray that met it. As in Cycles, the ray is of no kind, and counts as one event more
/// than the path has had; but where light is asked for as well it counts as there, for the sum of both must not depend on how
/// light is found.
RELIEF_KERNEL GraphRay lamp_ray(const KernelGlobals& g, const PathState& state, std::uint32_t path)
{
  const std::uint32_t depths = state.bounces[path] + (state.pdf[path] > 0.0f ? 0u : 1u);
  return {0, depths, state.flags[path] >> kPathTransparentShift, path_ray_length(g, state, path)};
}

/// @param emitter  not even, in world space
/// @param even     what it sends to there without its graph: counts for all but meshes
/// @return         radiance, or what `even` is; of meshes it is not asked which side shines
[[gnu::noinline]] RELIEF_KERNEL Vec3f
emitter_radiance(const KernelGlobals& g, const Light& emitter, Vec3f even, const EmitterPoint& at)
{
  if (emitter.instance_index < 0) return even * g.emitter_radiance(g, emitter, at);
  const InstanceView& instance = g.instances[emitter.instance_index];
  const Material& material = g.materials[instance.material_index];
  if (material.emission_index >= 0) return g.emitter_radiance(g, emitter, at);
  return triangle_emission(material, g.textures, g.meshes[instance.mesh_index],
                           static_cast<std::uint32_t>(emitter.triangle_index), at.barycentric);
}

/// Aims a shadow ray at a light's sample.
/// @param light    sampled at P
/// @param emitter  the light, world; null: the environment
/// @param O        where the ray starts, at P or a little beside
/// @param D, t_max get its direction and length
RELIEF_KERNEL void shadow_ray_aim(const LightSample& light,
                                  const Light* emitter,
                                  Vec3f P,
                                  Vec3f O,
                                  Vec3f& D,
                                  float& t_max)
{
  D = light.wi;
  t_max = light.distance;
  if (!(t_max < kInfinity)) return;
  Vec3f target = P + light.wi * light.distance;
  if (emitter != nullptr && emitter->instance_index >= 0) {
    // Stop short of the emitter itself by the error bound of a point on it.
    const Vec3f error = gamma_bound(8) * (abs(emitter->P) + abs(emitter->edge_u) + abs(emitter->edge_v) + abs(P));
    target = offset_ray_origin(target, error, dot(emitter->axis, light.wi) < 0.0f ? emitter->axis : -emitter->axis);
  }
  const Vec3f to_target = target - O;
  t_max = length(to_target);
  D = to_target / t_max;
}

}  // namespace relief
