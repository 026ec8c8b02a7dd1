// The photons of a pass that lie in media, in a tree of boxes that is the same whatever the number of threads.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "kernel/photon/photon.h"

namespace relief {

/// Owner of what a MediumPhotonsView points to. Storage is kept from pass to pass.
class MediumPhotonMap {
 public:
  /// Sorts photons along a space-filling curve and bounds each eight of them, each eight of these boxes, and so on.
  /// @param chunks  in an order that does not depend on threads
  /// @param radii   of the photons in their order, metres, > 0
  void build(const std::vector<std::vector<Photon>>& chunks, const std::vector<float>& radii);

  MediumPhotonsView view() const;
  std::size_t bytes() const;

 private:
  struct Place {
    std::uint64_t key;  ///< along the curve
    std::uint32_t number;
  };

  std::vector<float> x_, y_, z_, inverse_radius_squared_;
  std::vector<PhotonArrival> arrivals_;
  std::vector<Place> order_;
  std::array<std::vector<PhotonBoxes>, kMostPhotonLevels> nodes_;
  int num_levels_ = 0;
};

}  // namespace relief
