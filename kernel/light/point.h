// Point light: the same radiant intensity in every direction. With a radius it is a ball of constant radiance, or a disk of
// constant radiance that faces each point it shines on, as Blender has it; both fill a cone of directions, which is sampled
// uniformly. Points inside the ball see it all around them, and before a disk no point is inside.
#pragma once

#include "kernel/light/light_sample.h"
#include "kernel/sample/warp.h"

namespace relief {

/// A point in space that shines around itself, with or without a size.
struct BallLight {
  static constexpr LightBody kBody = LightBody::kOwn;
  static constexpr bool kIsQuad = false;
};

struct PointLight : BallLight {};

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

/// Solid-angle density of light_sample.
/// @return  0 for a point without a size
RELIEF_KERNEL float light_pdf(BallLight, const Light& light, Vec3f P, Vec3f, float)
{
  const float squared = length_squared(light.P - P);
  return light.radius > 0.0f && squared > 1e-30f ? warp_cone_pdf(ball_light_cone(light, squared)) : 0.0f;
}

/// @param u  [0, 1)²: direction within the cone that the ball or disk fills
/// @return   without a size, intensity / distance² from the light's direction; no sample at the light itself
RELIEF_KERNEL LightSample light_sample(PointLight, const Light& light, Vec3f P, Vec2f u)
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

/// Part of the intensity that leaves under an angle.
RELIEF_KERNEL float light_falloff(PointLight, const Light&, float) { return 1.0f; }

/// Radiance that a ball sends against a ray that arrives at it.
/// @param falloff  towards there
RELIEF_KERNEL Vec3f ball_light_emitted(const Light& light, float falloff)
{
  return light.emission * (falloff * kInvPi / sqr(light.radius));
}

/// @param wi  unit, direction of travel of the ray, towards the light
RELIEF_KERNEL Vec3f light_emitted(PointLight, const Light& light, Vec3f) { return ball_light_emitted(light, 1.0f); }

/// Box around a ball or a point, and how much it sends; whither is not said.
RELIEF_KERNEL LightBounds ball_light_bounds(const Light& light, float emission)
{
  LightBounds bounds;
  bounds.low = light.P - splat3(light.radius);
  bounds.high = light.P + splat3(light.radius);
  bounds.intensity = emission;
  return bounds;
}

RELIEF_KERNEL LightBounds light_bounds(PointLight, const Light& light, float emission)
{
  LightBounds bounds = ball_light_bounds(light, emission);
  bounds.spread = {{0, 0, 1}, kPi};
  bounds.falloff = 0.5f * kPi;
  light_bounds_add_profile(bounds, {});
  return bounds;
}

RELIEF_KERNEL bool light_is_met(BallLight, const Light& light) { return light.radius > 0.0f; }

RELIEF_KERNEL Vec3f light_half_extent(BallLight, const Light& light) { return splat3(light.radius); }

/// A ray meets a ball once: where it enters, or, started inside, where it leaves.
RELIEF_KERNEL float light_distance(BallLight, const Light& light, Vec3f O, Vec3f D)
{
  return ball_light_distance(light, light.P - O, D);
}

/// Of a point the place is known without the rounding of a distance: patterns have edges at round numbers.
RELIEF_KERNEL LightPlace light_place(BallLight, const Light& light, Vec3f P, Vec3f wo)
{
  if (!(light.radius > 0.0f)) return {light.P, wo};
  return {P, light.faces_viewer ? wo : normalize(P - light.P)};
}

/// Around the point, 0 to 1, the second one up.
RELIEF_KERNEL Vec2f light_uv(PointLight, const Light&, const Affine3& object_from_world, LightPlace at, Vec3f)
{
  const Vec3f d = normalize(transform_vector(object_from_world, at.N));
  return {0.5f - std::atan2(d.x, d.y) * (0.5f * kInvPi), 1.0f - std::acos(clamp(d.z, -1.0f, 1.0f)) * kInvPi};
}

RELIEF_KERNEL LightRay light_emit(PointLight, const Light& light, Vec2f u, Vec2f, bool)
{
  const Vec3f wo = warp_sphere(u);
  return {light.P + wo * light.radius, wo, 1.0f};
}

}  // namespace relief
