// Volume Scatter by Draine's phase function, of dust.
#pragma once

#include "kernel/volume/volume_inputs.h"

namespace relief {

struct DraineVolume {
  static constexpr const char* kName = "draine";
  static constexpr VolumeInput kInputs[] = {{"color", true, 0.8f},
                                            {"density", false, 1},
                                            {"anisotropy", false, 0, true},
                                            {"alpha", false, 0.5f}};
  static constexpr int kPhases = 1;
};

RELIEF_KERNEL void medium_add(DraineVolume, float weight, VolumeNumbers& in, Medium& medium)
{
  const Vec3f sigma_s = medium_add_scattering(weight, in, medium);
  const float g = limited_anisotropy(in.number());
  medium.phases[medium.num_phases++] = {sigma_s, g, max(in.number(), 0.0f), PhaseKind::kDraine};
}

template <typename Bounds>
RELIEF_KERNEL void rate_add(DraineVolume, float weight, Bounds& in, MediumRate& rate)
{
  rate_add_scattering(weight, in, rate);
}

}  // namespace relief
