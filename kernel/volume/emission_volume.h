// Emission of a volume; below 0 it takes light away, as in Cycles.
#pragma once

#include "kernel/volume/volume_inputs.h"

namespace relief {

struct EmissionVolume {
  static constexpr const char* kName = "emission";
  static constexpr VolumeInput kInputs[] = {{"color", true, 1, true}, {"strength", false, 1, true}};
  static constexpr int kPhases = 0;
};

RELIEF_KERNEL void medium_add(EmissionVolume, float weight, VolumeNumbers& in, Medium& medium)
{
  const Vec3f color = in.color();
  medium.emission += color * (weight * in.number());
}

template <typename Bounds>
RELIEF_KERNEL void rate_add(EmissionVolume, float, Bounds& in, MediumRate& rate)
{
  const ValueBounds color = in.color();
  rate.emits |= counts(color) && counts(in.number());
}

}  // namespace relief
