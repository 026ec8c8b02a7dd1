// Disk light: an ellipse of constant radiance, sampled uniformly by area.
#pragma once

#include "kernel/light/light_sample.h"
#include "kernel/sample/warp.h"

namespace relief {

/// @param u  [0, 1)²
RELIEF_KERNEL LightSample disk_light_sample(const Light& light, Vec3f P, Vec2f u)
{
  if (!light_faces(light, P)) return {};
  const Vec2f q = warp_disk(u);
  return light_point_sample(light, P, light.P + light.edge_u * q.x + light.edge_v * q.y);
}

/// Solid-angle density of disk_light_sample.
RELIEF_KERNEL float disk_light_pdf(const Light& light, Vec3f P, Vec3f wi, float distance)
{
  return light_faces(light, P) ? light_area_pdf(light, wi, distance) : 0.0f;
}

}  // namespace relief
