// Spot light: a point light with a cone.
#pragma once

#include "kernel/light/point.h"

namespace relief {

/// Fraction of the axis' intensity that leaves under an angle.
/// @param cos_angle  between the spot's axis and the direction of travel
/// @source KHR_lights_punctual, "Inner and Outer Cone Angles"
RELIEF_KERNEL float spot_light_falloff(const Light& light, float cos_angle)
{
  // The extension's own lower bound on the width keeps equal angles (a hard edge) finite.
  const float width = max(light.cos_inner - light.cos_outer, 0.001f);
  return sqr(clamp((cos_angle - light.cos_outer) / width, 0.0f, 1.0f));
}

/// @return as point_light_sample; no sample outside the cone
RELIEF_KERNEL LightSample spot_light_sample(const Light& light, Vec3f P)
{
  LightSample sample = point_light_sample(light, P);
  if (sample.pdf == 0.0f) return sample;
  const float falloff = spot_light_falloff(light, -dot(sample.wi, light.axis));
  if (!(falloff > 0.0f)) return {};
  sample.radiance *= falloff;
  return sample;
}

}  // namespace relief
