// Point light: the same radiant intensity in every direction.
#pragma once

#include "kernel/light/light_sample.h"

namespace relief {

/// @return intensity / distance² from the light's direction; no sample at the light itself
RELIEF_KERNEL LightSample point_light_sample(const Light& light, Vec3f P)
{
  LightSample sample;
  const Vec3f to_light = light.P - P;
  const float squared = length_squared(to_light);
  sample.delta = true;
  sample.radiance = light.emission / squared;
  // Closer, squares lose digits to underflow.
  if (!(squared > 1e-30f) || !is_finite(sample.radiance)) return {};
  sample.distance = __builtin_sqrtf(squared);
  sample.wi = to_light / sample.distance;
  sample.pdf = 1.0f;
  return sample;
}

}  // namespace relief
