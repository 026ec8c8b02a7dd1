// Point light: the same radiant intensity in every direction. With a radius it is a ball of constant radiance, or a disk of
// constant radiance that faces each point it shines on, as Blender has it; both fill a cone of directions, which is sampled
// uniformly. Points inside the ball see it all around them, and before a disk no point is inside.
#pragma once

#include "kernel/light/light_sample.h"
#include "kernel/sample/warp.h"

namespace relief {

/// One minus the cosine of the half angle of the cone that a ball or disk fills.
/// @param distance_squared  of its centre, m², > 0
/// @return                  (0, 2]; 2: the point is inside the ball
RELIEF_KERNEL float ball_light_cone(const Light& light, float distance_squared)
{
  const float ratio = sqr(light.radius) / distance_squared;
  if (light.faces_viewer) {
    // tan = radius / distance. The second form has no digits to lose and does not overflow.
    const float root = __builtin_sqrtf(1.0f + ratio);
    return ratio < 1.0f ? ratio / (root * (1.0f + root)) : 1.0f - 1.0f / root;
  }
  return ratio < 1.0f ? ratio / (1.0f + __builtin_sqrtf(1.0f - ratio)) : 2.0f;
}

/// Distance along a ray to a ball or disk: to where it is entered, from inside a ball to where it is left.
/// @param to_light  from the ray's origin to the centre, metres
/// @param D         unit
/// @return          negative: the ray misses
RELIEF_KERNEL float ball_light_distance(const Light& light, Vec3f to_light, Vec3f D)
{
  const float squared = length_squared(to_light);
  const float along = dot(to_light, D);
  const float missed_squared = length_squared(to_light - along * D);
  if (light.faces_viewer) {
    // The plane across `to_light` through the centre is met where the ray has come as far as the centre is.
    const float t = along > 0.0f ? squared / along : -1.0f;
    return length_squared(D * t - to_light) <= sqr(light.radius) ? t : -1.0f;
  }
  const bool is_inside = squared < sqr(light.radius);
  if (!(missed_squared <= sqr(light.radius))) return is_inside ? light.radius : -1.0f;
  const float half_chord = __builtin_sqrtf(sqr(light.radius) - missed_squared);
  return is_inside ? along + half_chord : along - half_chord;
}

/// Solid-angle density of point_light_sample.
/// @param wi  unit, towards the ball or disk
/// @return    0 for a point without a size
RELIEF_KERNEL float point_light_pdf(const Light& light, Vec3f P)
{
  const float squared = length_squared(light.P - P);
  return light.radius > 0.0f && squared > 1e-30f ? warp_cone_pdf(ball_light_cone(light, squared)) : 0.0f;
}

/// @param u  [0, 1)²: direction within the cone that the ball or disk fills
/// @return   without a size, intensity / distance² from the light's direction; no sample at the light itself
RELIEF_KERNEL LightSample point_light_sample(const Light& light, Vec3f P, Vec2f u)
{
  LightSample sample;
  const Vec3f to_light = light.P - P;
  const float squared = length_squared(to_light);
  // Closer, squares lose digits to underflow.
  if (!(squared > 1e-30f)) return {};
  const float distance = __builtin_sqrtf(squared);
  const Vec3f axis = to_light / distance;
  if (!(light.radius > 0.0f)) {
    sample.delta = true;
    sample.radiance = light.emission / squared;
    sample.distance = distance;
    sample.wi = axis;
    sample.pdf = 1.0f;
    return is_finite(sample.radiance) ? sample : LightSample{};
  }
  const float cone = ball_light_cone(light, squared);
  sample.wi = from_local(frame_from_normal(axis), warp_cone(cone, u));
  sample.radiance = light.emission * (kInvPi / sqr(light.radius));
  sample.pdf = warp_cone_pdf(cone);
  sample.distance = ball_light_distance(light, to_light, sample.wi);
  // At the rim rounding may miss it.
  if (!(sample.distance > 0.0f)) sample.distance = distance;
  return sample;
}

}  // namespace relief
