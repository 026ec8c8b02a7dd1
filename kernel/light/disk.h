// Disk light: an ellipse of constant radiance, sampled uniformly by area.
#pragma once

#include "kernel/light/light_sample.h"

namespace relief {

/// Maps the unit square to the unit disk, keeping areas' ratios and neighbours.
/// @source Shirley and Chiu 1997; the branches of Cline, published in Shirley's weblog 2011
RELIEF_KERNEL Vec2f disk_light_point(Vec2f u)
{
  const float x = 2.0f * u.x - 1.0f;
  const float y = 2.0f * u.y - 1.0f;
  if (x == 0.0f && y == 0.0f) return {};
  const bool wide = __builtin_fabsf(x) > __builtin_fabsf(y);
  const float r = wide ? x : y;
  const float phi = wide ? kPi / 4.0f * (y / x) : kPi / 2.0f - kPi / 4.0f * (x / y);
  return {r * std::cos(phi), r * std::sin(phi)};
}

/// @param u  [0, 1)²
RELIEF_KERNEL LightSample disk_light_sample(const Light& light, Vec3f P, Vec2f u)
{
  if (!light_faces(light, P)) return {};
  const Vec2f q = disk_light_point(u);
  return light_point_sample(light, P, light.P + light.edge_u * q.x + light.edge_v * q.y);
}

/// Solid-angle density of disk_light_sample.
RELIEF_KERNEL float disk_light_pdf(const Light& light, Vec3f P, Vec3f wi, float distance)
{
  return light_faces(light, P) ? light_area_pdf(light, wi, distance) : 0.0f;
}

}  // namespace relief
