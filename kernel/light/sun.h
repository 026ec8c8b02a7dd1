// Sun: light from infinitely far away, parallel or of the same radiance from all of a cone of directions. What it looks like
// does not depend on the place, however far from the origin that is.
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

/// Radiance of a sun that fills a cone: its irradiance over the cone's solid angle as the plane across the axis sees it.
RELIEF_KERNEL Vec3f sun_light_radiance(const Light& light)
{
  return light.emission * (kInvPi / (light.cone * (2.0f - light.cone)));
}

/// Whether a direction is within the cone. By the difference of two unit vectors: the cosine of a narrow cone has no digits.
/// @param wi  unit, towards the sun
RELIEF_KERNEL bool sun_light_is_met(const Light& light, Vec3f wi)
{
  return length_squared(wi + light.axis) <= 2.0f * light.cone;
}

/// @param u  [0, 1)²: direction within the cone
RELIEF_KERNEL LightSample light_sample(SunLight, const Light& light, Vec3f, Vec2f u)
{
  LightSample sample;
  sample.distance = kInfinity;
  if (light.cone > 0.0f) {
    sample.wi = from_local(frame_from_normal(-light.axis), warp_cone(light.cone, u));
    sample.radiance = sun_light_radiance(light);
    sample.pdf = warp_cone_pdf(light.cone);
    return sample;
  }
  sample.wi = -light.axis;
  sample.radiance = light.emission;
  sample.pdf = 1.0f;
  sample.delta = true;
  return sample;
}

/// Solid-angle density of light_sample for a direction that meets the sun; 0 for one without an angle.
RELIEF_KERNEL float sun_light_pdf(const Light& light) { return light.cone > 0.0f ? warp_cone_pdf(light.cone) : 0.0f; }

RELIEF_KERNEL float light_pdf(SunLight, const Light& light, Vec3f, Vec3f, float) { return sun_light_pdf(light); }

/// None: suns are no part of the light tree.
RELIEF_KERNEL LightBounds light_bounds(FarLight, const Light&, float) { return {}; }

RELIEF_KERNEL LightPlace light_place(FarLight, const Light&, Vec3f, Vec3f wo) { return {wo, wo}; }

RELIEF_KERNEL Vec2f light_uv(FarLight, const Light&, const Affine3&, LightPlace, Vec3f) { return {0.5f, 0.5f}; }

RELIEF_KERNEL LightRay light_emit(SunLight, const Light& light, Vec2f u, Vec2f, bool)
{
  const Vec3f wo =
      light_is_sun_disk(light) ? from_local(frame_from_normal(light.axis), warp_cone(light.cone, u)) : light.axis;
  return {{}, wo, 1.0f};
}

}  // namespace relief
