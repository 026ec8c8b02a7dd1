// The photons of a pass in a hash grid, built in parallel and the same whatever the number of threads.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "kernel/photon/photon.h"

namespace relief {

/// Owner of what a PhotonMapView points to. Storage is kept from pass to pass.
class PhotonMap {
 public:
  /// Sorts photons into the cells of grids, one for each octave of radii. Cells are twice as wide as their grid's largest
  /// radius, so that a search meets at most eight of each.
  /// @param chunks  in an order that does not depend on threads; the order within cells follows from it
  /// @param radii   of the photons in their order, metres, > 0
  /// @cost          48 bytes a photon, and 4 to 8 for buckets
  void build(const std::vector<std::vector<Photon>>& chunks, const std::vector<float>& radii);

  PhotonMapView view() const;
  std::size_t size() const { return arrivals_.size(); }
  std::size_t bytes() const;

 private:
  /// Marks the cells that photons reach into, see PhotonMapView::near.
  void mark_near(const std::vector<const Photon*>& photons, const std::vector<float>& radii);

  std::vector<float> x_, y_, z_, inverse_radius_squared_;
  std::vector<PhotonArrival> arrivals_;
  std::vector<std::uint32_t> bucket_begin_;
  std::vector<std::uint8_t> near_;
  std::vector<std::uint64_t> order_;  ///< bucket << 32 | number of a photon
  std::array<Box3, kPhotonOctaves> bounds_{};
  std::uint32_t octaves_ = 0;
  float largest_radius_ = 0;
};

/// Where photons lie, by the dimensions of what they fill.
enum class PhotonPlaces : int { kSurfaces = 2, kMedia = 3 };

/// The geometric mean of the radii within which photons find `wanted` others: where light is, not where space is. Estimated
/// from a part of them. (The median jumps where bright and dim caustics have like shares of the photons.) Of fewer than
/// twice as many photons, the radii within which they find half of all.
/// @return metres; 0 where there is no distance between them
float photon_radius_for(const std::vector<std::vector<Photon>>& chunks,
                        double wanted,
                        PhotonPlaces places = PhotonPlaces::kSurfaces);

/// A radius for each photon, so that about `wanted` lie within: small where light is bright, wide where it is dim. Photons
/// are counted in cells of several sizes; the finest that has half as many as wanted around a photon says how dense they
/// lie. The radius depends on the other photons and not on what this one carries, so the mean is not biased by it
/// (Silverman 1986, §5.3: bandwidths of the square root of a pilot density).
/// @param typical  as photon_radius_for, metres: none is more than four times as wide, so that light does not creep far
/// @param shift    of the cells: others for other passes, so that no border between cells shows in the end
std::vector<float> photon_radii(const std::vector<std::vector<Photon>>& chunks,
                                double wanted,
                                float typical,
                                std::uint32_t shift,
                                PhotonPlaces places = PhotonPlaces::kSurfaces);

}  // namespace relief
