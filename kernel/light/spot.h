// Spot light: a point light with a cone. A ball or disk, too, sends into each direction what the cone says of that direction.
#pragma once

#include "kernel/light/point.h"

namespace relief {

/// Fraction of the axis' intensity that leaves under an angle.
/// @param cos_angle  between the spot's axis and the direction of travel
/// @source KHR_lights_punctual, "Inner and Outer Cone Angles", for SpotFalloff::kSquare
RELIEF_KERNEL float spot_light_falloff(const Light& light, float cos_angle)
{
  // Keep equal angles (a hard edge) finite: the extension's own lower bound on the width, and the least that is not noise.
  const float narrowest = light.falloff == SpotFalloff::kSquare ? 0.001f : 1e-6f;
  const float width = max(light.cos_inner - light.cos_outer, narrowest);
  const float t = clamp((cos_angle - light.cos_outer) / width, 0.0f, 1.0f);
  if (light.falloff == SpotFalloff::kSquare) return sqr(t);
  const float smooth = sqr(t) * (3.0f - 2.0f * t);
  return light.falloff == SpotFalloff::kSmooth ? smooth : smooth * cos_angle;
}

/// @return as point_light_sample; no sample outside the cone
RELIEF_KERNEL LightSample spot_light_sample(const Light& light, Vec3f P, Vec2f u)
{
  LightSample sample = point_light_sample(light, P, u);
  if (sample.pdf == 0.0f) return sample;
  const float falloff = spot_light_falloff(light, -dot(sample.wi, light.axis));
  if (!(falloff > 0.0f)) return {};
  sample.radiance *= falloff;
  return sample;
}

/// Radiance that a point or spot with a size sends against a ray that arrives at it.
/// @param wi  unit, direction of travel of the ray, towards the light
RELIEF_KERNEL Vec3f ball_light_emitted(const Light& light, Vec3f wi)
{
  const float falloff = light.kind == LightKind::kSpot ? spot_light_falloff(light, -dot(wi, light.axis)) : 1.0f;
  return light.emission * (falloff * kInvPi / sqr(light.radius));
}

}  // namespace relief
