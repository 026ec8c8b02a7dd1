// The photons of a pass in a hash grid, built in parallel and the same whatever the number of threads.
#pragma once

#include <cstdint>
#include <vector>

#include "kernel/photon/photon.h"

namespace relief {

/// Owner of what a PhotonMapView points to. Storage is kept from pass to pass.
class PhotonMap {
 public:
  /// Sorts photons into cells twice as wide as the radius of searches: a search so meets at most eight.
  ///
  /// A hash grid, because all searches of a pass have one radius: a tree would find the same photons in more steps.
  /// @param chunks  in an order that does not depend on threads; the order within cells follows from it
  /// @param radius  metres, > 0
  /// @cost          36 bytes a photon, and 4 to 8 for buckets
  void build(const std::vector<std::vector<Photon>>& chunks, float radius);

  PhotonMapView view() const;
  std::size_t size() const { return arrivals_.size(); }
  std::size_t bytes() const;

 private:
  std::vector<float> x_, y_, z_;
  std::vector<PhotonArrival> arrivals_;
  std::vector<std::uint32_t> bucket_begin_;
  std::vector<std::uint64_t> order_;  ///< bucket << 32 | number of a photon
  float radius_ = 0;
};

/// A radius within which the median photon finds `wanted` others: where light is, not where space is. Estimated from a part
/// of them. (That of four of five photons blurred a lamp's caustic by 4 % where an even sky lit the same glass.) Of fewer
/// than twice as many photons, the radius within which they find half of all.
/// @return metres; 0 where there is no distance between them
float photon_radius_for(const std::vector<std::vector<Photon>>& chunks, double wanted);

}  // namespace relief
