// Sun: parallel light from infinitely far away.
#pragma once

#include "kernel/light/light_sample.h"

namespace relief {

RELIEF_KERNEL LightSample sun_light_sample(const Light& light)
{
  LightSample sample;
  sample.wi = -light.axis;
  sample.distance = kInfinity;
  sample.radiance = light.emission;
  sample.pdf = 1.0f;
  sample.delta = true;
  return sample;
}

}  // namespace relief
