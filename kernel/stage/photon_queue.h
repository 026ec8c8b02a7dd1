// Photons that a batch of photon paths leaves behind.
#pragma once

#include "kernel/photon/photon.h"

namespace relief {

struct PhotonQueueView {
  Photon* photons = nullptr;
  std::uint32_t size = 0;
};

}  // namespace relief
