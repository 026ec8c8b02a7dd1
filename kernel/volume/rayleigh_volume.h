// Volume Scatter by Rayleigh's phase function, of what is much smaller than a wavelength.
#pragma once

#include "kernel/volume/volume_inputs.h"

namespace relief {

struct RayleighVolume {
  static constexpr const char* kName = "rayleigh";
  static constexpr VolumeInput kInputs[] = {{"color", true, 0.8f}, {"density", false, 1}};
  static constexpr int kPhases = 1;
};

RELIEF_KERNEL void medium_add(RayleighVolume, float weight, VolumeNumbers& in, Medium& medium)
{
  const Vec3f sigma_s = medium_add_scattering(weight, in, medium);
  medium.phases[medium.num_phases++] = {sigma_s, 0.0f, 1.0f, PhaseKind::kDraine};
}

template <typename Bounds>
RELIEF_KERNEL void rate_add(RayleighVolume, float weight, Bounds& in, MediumRate& rate)
{
  rate_add_scattering(weight, in, rate);
}

}  // namespace relief
