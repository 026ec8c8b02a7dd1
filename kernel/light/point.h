// Point light: the same radiant intensity in every direction; with a radius, from a ball of constant radiance. No ray hits
// either: light sampling alone finds them.
#pragma once

#include "kernel/light/light_sample.h"
#include "kernel/sample/warp.h"

namespace relief {

/// @param u  [0, 1)²: direction within the cone that the ball fills
/// @return   intensity / distance² from the light's direction; a ball's visible side as a whole, seen at one of its points
///           by chance. No sample at the light itself or inside the ball
RELIEF_KERNEL LightSample point_light_sample(const Light& light, Vec3f P, Vec2f u)
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
  if (!(light.radius > 0.0f)) return sample;

  const float sin_squared = sqr(light.radius) / squared;
  if (!(sin_squared < 1.0f)) return {};
  const float one_minus_cos = sin_squared / (1.0f + __builtin_sqrtf(1.0f - sin_squared));
  // Radiance I / πr² times solid angle 2π(1 − cos), with r² = d²(1 − cos)(1 + cos).
  sample.radiance *= 2.0f / (2.0f - one_minus_cos);
  const Vec3f local = warp_cone(one_minus_cos, u);
  const float missed_squared = squared * (sqr(local.x) + sqr(local.y));
  sample.wi = from_local(frame_from_normal(sample.wi), local);
  sample.distance = sample.distance * local.z - safe_sqrt(sqr(light.radius) - missed_squared);
  return sample;
}

}  // namespace relief
