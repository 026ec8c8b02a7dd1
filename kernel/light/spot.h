// Spot light: a point light with a cone. A ball or disk, too, sends into each direction what the cone says of that direction.
#pragma once

#include "kernel/light/point.h"

namespace relief {

struct SpotLight : BallLight {};

/// Fraction of the axis' intensity that leaves under an angle.
/// @param cos_angle  between the spot's axis and the direction of travel
/// @source KHR_lights_punctual, "Inner and Outer Cone Angles", for SpotFalloff::kSquare
RELIEF_KERNEL float light_falloff(SpotLight, const Light& light, float cos_angle)
{
  // Keep equal angles (a hard edge) finite: the extension's own lower bound on the width, and the least that is not noise.
  const float narrowest = light.falloff == SpotFalloff::kSquare ? 0.001f : 1e-6f;
  const float width = max(light.cos_inner - light.cos_outer, narrowest);
  const float t = clamp((cos_angle - light.cos_outer) / width, 0.0f, 1.0f);
  if (light.falloff == SpotFalloff::kSquare) return sqr(t);
  const float smooth = sqr(t) * (3.0f - 2.0f * t);
  return light.falloff == SpotFalloff::kSmooth ? smooth : smooth * cos_angle;
}

/// @return as of a point; no sample outside the cone
RELIEF_KERNEL LightSample light_sample(SpotLight kind, const Light& light, Vec3f P, Vec2f u)
{
  LightSample sample = light_sample(PointLight{}, light, P, u);
  if (sample.pdf == 0.0f) return sample;
  const float falloff = light_falloff(kind, light, -dot(sample.wi, light.axis));
  if (!(falloff > 0.0f)) return {};
  sample.radiance *= falloff;
  return sample;
}

/// @param wi  unit, direction of travel of the ray, towards the light
RELIEF_KERNEL Vec3f light_emitted(SpotLight kind, const Light& light, Vec3f wi)
{
  return ball_light_emitted(light, light_falloff(kind, light, -dot(wi, light.axis)));
}

RELIEF_KERNEL LightBounds light_bounds(SpotLight, const Light& light, float emission)
{
  LightBounds bounds = ball_light_bounds(light, emission);
  const float inner = std::acos(clamp(light.cos_inner, -1.0f, 1.0f));
  const float outer = std::acos(clamp(light.cos_outer, -1.0f, 1.0f));
  bounds.spread = {light.axis, min(inner, outer)};
  bounds.falloff = max(outer - inner, 0.0f);
  light_bounds_add_profile(bounds, light_cone_profile(std::cos(0.5f * (inner + outer))));
  return bounds;
}

/// Within the cone, 0 to 1, the second one up.
RELIEF_KERNEL Vec2f light_uv(SpotLight, const Light& light, const Affine3& object_from_world, LightPlace, Vec3f wo)
{
  const Vec3f d = transform_vector(object_from_world, wo);
  const float half_width = -d.z * safe_sqrt(1.0f - sqr(light.cos_outer)) / light.cos_outer;
  return {0.5f + 0.5f * d.x / half_width, 0.5f + 0.5f * d.y / half_width};
}

RELIEF_KERNEL LightRay light_emit(SpotLight kind, const Light& light, Vec2f u, Vec2f, bool)
{
  const Vec3f wo = from_local(frame_from_normal(light.axis), warp_cone(1.0f - light.cos_outer, u));
  return {light.P + wo * light.radius, wo, light_falloff(kind, light, dot(wo, light.axis))};
}

}  // namespace relief
