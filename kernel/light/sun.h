// Sun: light from infinitely far away, parallel or of the same radiance from all of a cone of directions. What it looks like
// does not depend on the place, however far from the origin that is.
#pragma once

#include "kernel/light/light_sample.h"
#include "kernel/sample/warp.h"

namespace relief {

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
RELIEF_KERNEL LightSample sun_light_sample(const Light& light, Vec2f u)
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

/// Solid-angle density of sun_light_sample for a direction that meets the sun; 0 for one without an angle.
RELIEF_KERNEL float sun_light_pdf(const Light& light) { return light.cone > 0.0f ? warp_cone_pdf(light.cone) : 0.0f; }

}  // namespace relief
