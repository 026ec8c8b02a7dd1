// Sun: light from infinitely far away, parallel or from a cone of directions. What it looks like does not depend on the place,
// however far from the origin that is.
#pragma once

#include "kernel/light/light_sample.h"
#include "kernel/sample/warp.h"

namespace relief {

/// Light from so far away that it has a direction and no place.
struct FarLight {
  static constexpr LightBody kBody = LightBody::kNone;
  static constexpr bool kIsQuad = false;
};

struct SunLight : FarLight {};

/// Squared radius of the disk across a flat sun's axis, at a distance of 1, over which it is sampled evenly.
/// @source  Cycles before 4.0, which has all its suns so
RELIEF_KERNEL float sun_light_disk(const Light& light)
{
  const float cosine = 1.0f - light.cone;
  return light.cone * (2.0f - light.cone) / (cosine * cosine);
}

/// Solid-angle density of light_sample for a direction that meets the sun; 0 for one without an angle.
/// @param wi  unit, towards the sun
RELIEF_KERNEL float sun_light_pdf(const Light& light, Vec3f wi)
{
  if (!(light.cone > 0.0f)) return 0.0f;
  if (!light.faces_viewer) return warp_cone_pdf(light.cone);
  const float cosine = -dot(wi, light.axis);
  return kInvPi / (sun_light_disk(light) * cosine * cosine * cosine);
}

/// Radiance of a sun that fills a cone, by its irradiance on a plane across the axis: even, or of a flat one by its density.
/// @param wi  unit, towards the sun
RELIEF_KERNEL Vec3f sun_light_radiance(const Light& light, Vec3f wi)
{
  if (!light.faces_viewer) return light.emission * (kInvPi / (light.cone * (2.0f - light.cone)));
  // What a disk of radius tan θ causes is its mean cosine, 2 cos θ / (1 + cos θ).
  const float cosine = 1.0f - light.cone;
  return light.emission * (sun_light_pdf(light, wi) * (1.0f + cosine) / (2.0f * cosine));
}

/// Whether a direction is within the cone. By the difference of two unit vectors: the cosine of a narrow cone has no digits.
/// @param wi  unit, towards the sun
RELIEF_KERNEL bool sun_light_is_met(const Light& light, Vec3f wi)
{
  return length_squared(wi + light.axis) <= 2.0f * light.cone;
}

/// Direction to a sun of an angle, about its axis.
/// @param u  [0, 1)²
RELIEF_KERNEL Vec3f sun_light_direction(const Light& light, Vec2f u)
{
  if (!light.faces_viewer) return warp_cone(light.cone, u);
  const float squared = u.x * sun_light_disk(light), cosine = 1.0f / __builtin_sqrtf(1.0f + squared);
  const float sine = __builtin_sqrtf(squared) * cosine;
  const SinCos phi = sin_cos_turn(u.y);
  return {sine * phi.cos, sine * phi.sin, cosine};
}

/// @param u  [0, 1)²: direction within the cone
RELIEF_KERNEL LightSample light_sample(SunLight, const Light& light, Vec3f, Vec2f u)
{
  LightSample sample;
  sample.distance = kInfinity;
  if (light.cone > 0.0f) {
    sample.wi = from_local(frame_from_normal(-light.axis), sun_light_direction(light, u));
    sample.radiance = sun_light_radiance(light, sample.wi);
    sample.pdf = sun_light_pdf(light, sample.wi);
    return sample;
  }
  sample.wi = -light.axis;
  sample.radiance = light.emission;
  sample.pdf = 1.0f;
  sample.delta = true;
  return sample;
}

RELIEF_KERNEL float light_pdf(SunLight, const Light& light, Vec3f, Vec3f wi, float) { return sun_light_pdf(light, wi); }

/// None: suns are no part of the light tree.
RELIEF_KERNEL LightBounds light_bounds(FarLight, const Light&, float) { return {}; }

RELIEF_KERNEL LightPlace light_place(FarLight, const Light&, Vec3f, Vec3f wo) { return {wo, wo}; }

RELIEF_KERNEL Vec2f light_uv(FarLight, const Light&, const Affine3&, LightPlace, Vec3f) { return {0.5f, 0.5f}; }

RELIEF_KERNEL LightRay light_emit(SunLight, const Light& light, Vec2f u, Vec2f, bool)
{
  const Vec3f wo =
      light_is_sun_disk(light) ? from_local(frame_from_normal(light.axis), sun_light_direction(light, u)) : light.axis;
  return {{}, wo, 1.0f};
}

}  // namespace relief
