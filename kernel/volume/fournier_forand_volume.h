// Volume Scatter by Fournier and Forand's phase function, of water and what floats in it.
#pragma once

#include "kernel/volume/volume_inputs.h"

namespace relief {

struct FournierForandVolume {
  static constexpr const char* kName = "fournier-forand";
  static constexpr VolumeInput kInputs[] = {{"color", true, 0.8f},
                                            {"density", false, 1},
                                            {"ior", false, 1.33f},
                                            {"backscatter", false, 0.1f, true}};
  static constexpr int kPhases = 1;
};

RELIEF_KERNEL void medium_add(FournierForandVolume, float weight, VolumeNumbers& in, Medium& medium)
{
  const Vec3f sigma_s = medium_add_scattering(weight, in, medium);
  const float index = in.number();
  medium.phases[medium.num_phases++] = fournier_forand_phase(sigma_s, in.number(), index);
}

template <typename Bounds>
RELIEF_KERNEL void rate_add(FournierForandVolume, float weight, Bounds& in, MediumRate& rate)
{
  rate_add_scattering(weight, in, rate);
}

}  // namespace relief
