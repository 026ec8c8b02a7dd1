// What a point of a mesh light sends out.
#pragma once

#include "kernel/globals.h"
#include "kernel/shape/material_lookup.h"

namespace relief {

/// @param emitter   triangle, or rectangle of two, in world space
/// @param wo        unit, from the emitter to where its light goes
/// @param distance  metres that the light goes
/// @return          radiance; which side shines is not asked
RELIEF_KERNEL Vec3f
emitter_radiance(const KernelGlobals& g, const Light& emitter, Vec2f barycentric, Vec3f wo, float distance)
{
  const InstanceView& instance = g.instances[emitter.instance_index];
  const Material& material = g.materials[instance.material_index];
  if (material.emission_index >= 0) return g.emitter_radiance(g, emitter, barycentric, wo, distance);
  return triangle_emission(material, g.textures, g.meshes[instance.mesh_index],
                           static_cast<std::uint32_t>(emitter.triangle_index), barycentric);
}

}  // namespace relief
