// Where photons start: pairs of a light and a group of casters, chosen by an estimate of the light that one sends to the
// other. Photons are aimed at the group's box; those that meet anything but its casters first are dropped, so that boxes
// may overlap and no ray is counted by two pairs.
#pragma once

#include "kernel/photon/box_aim.h"

namespace relief {

struct PhotonSource {
  LightRef light;
  std::uint32_t target = 0;  ///< group of casters
};

struct PhotonSourcesView {
  const PhotonSource* sources = nullptr;
  const double* cdf = nullptr;  ///< num_sources + 1, from 0 to 1
  std::uint32_t num_sources = 0;
  const Box3* targets = nullptr;            ///< world bounds of each group of casters
  const std::int32_t* target_of = nullptr;  ///< of each instance; −1: no caster
  Box3 scene_box;                           ///< around everything that light can hit
  double photons_a_pass = 1;
  const float* factors = nullptr;  ///< on the power that each source sends; null: 1
};

}  // namespace relief
