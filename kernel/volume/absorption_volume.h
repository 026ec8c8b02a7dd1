// Volume Absorption takes away what its colour is not.
#pragma once

#include "kernel/volume/volume_inputs.h"

namespace relief {

struct AbsorptionVolume {
  static constexpr const char* kName = "absorption";
  static constexpr VolumeInput kInputs[] = {{"color", true, 0.8f}, {"density", false, 1}};
  static constexpr int kPhases = 0;
};

RELIEF_KERNEL void medium_add(AbsorptionVolume, float weight, VolumeNumbers& in, Medium& medium)
{
  const Vec3f color = in.color();
  medium.sigma_t += max(Vec3f{1, 1, 1} - color, Vec3f{}) * (weight * max(in.number(), 0.0f));
}

template <typename Bounds>
RELIEF_KERNEL void rate_add(AbsorptionVolume, float weight, Bounds& in, MediumRate& rate)
{
  const ValueBounds color = in.color();
  rate.sigma_t += bounds_product(1.0f - color.low, bounds_product(weight, in.number().high));
}

}  // namespace relief
