// Volume Scatter by what stands for Mie's phase function of water droplets, of clouds and fog.
#pragma once

#include "kernel/volume/volume_inputs.h"

namespace relief {

struct MieVolume {
  static constexpr const char* kName = "mie";
  static constexpr VolumeInput kInputs[] = {{"color", true, 0.8f}, {"density", false, 1}, {"diameter", false, 20}};
  static constexpr int kPhases = 2;
};

RELIEF_KERNEL void medium_add(MieVolume, float weight, VolumeNumbers& in, Medium& medium)
{
  const Vec3f sigma_s = medium_add_scattering(weight, in, medium);
  const MieFit fit = mie_fit(in.number());
  medium.phases[medium.num_phases++] = {sigma_s * (1.0f - fit.share), limited_anisotropy(fit.g_henyey_greenstein)};
  medium.phases[medium.num_phases++] = {sigma_s * fit.share, limited_anisotropy(fit.g_draine), fit.alpha,
                                        PhaseKind::kDraine};
}

template <typename Bounds>
RELIEF_KERNEL void rate_add(MieVolume, float weight, Bounds& in, MediumRate& rate)
{
  rate_add_scattering(weight, in, rate);
}

}  // namespace relief
