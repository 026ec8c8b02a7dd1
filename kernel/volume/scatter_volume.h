// Volume Scatter by the phase function of Henyey and Greenstein.
#pragma once

#include "kernel/volume/volume_inputs.h"

namespace relief {

struct ScatterVolume {
  static constexpr const char* kName = "scatter";
  static constexpr VolumeInput kInputs[] = {{"color", true, 0.8f},
                                            {"density", false, 1},
                                            {"anisotropy", false, 0, true}};
  static constexpr int kPhases = 1;
};

RELIEF_KERNEL void medium_add(ScatterVolume, float weight, VolumeNumbers& in, Medium& medium)
{
  const Vec3f sigma_s = medium_add_scattering(weight, in, medium);
  medium_add_phase(medium, sigma_s, in.number());
}

template <typename Bounds>
RELIEF_KERNEL void rate_add(ScatterVolume, float weight, Bounds& in, MediumRate& rate)
{
  rate_add_scattering(weight, in, rate);
}

}  // namespace relief
