// A photon, the map of a pass as the kernel reads it, and the schedule by which its radius shrinks.
#pragma once

#include "kernel/math/octahedral.h"

namespace relief {

/// Light that arrived at a surface after one or more sharp reflections or refractions.
struct PhotonArrival {
  Vec3f power;                ///< W
  std::uint32_t wi = 0;       ///< octahedral, towards where it came from
  std::uint32_t Ng = 0;       ///< octahedral, geometric normal on the side it arrived at
  std::uint32_t bounces = 0;  ///< counts as the path state's, of all its scatterings but the first
};

struct Photon {
  Vec3f P;  ///< world, metres
  PhotonArrival arrival;
};

/// Photons of a pass in a hash grid: those of one cell are consecutive, those of cells that follow each other in x as
/// well (but for hash wrap-around).
struct PhotonMapView {
  const float *x = nullptr, *y = nullptr, *z = nullptr;  ///< world, metres
  const PhotonArrival* arrivals = nullptr;
  const std::uint32_t* bucket_begin = nullptr;  ///< bucket_mask + 2 entries
  std::uint32_t bucket_mask = 0;                ///< number of buckets − 1; a power of two
  float radius = 0;                             ///< of the search, metres; cells are twice as wide. 0: no photons
};

/// What the stages need of the caustic pass.
struct CausticsView {
  bool enabled = false;
  float roughness = 0;  ///< perceptual, see sharp_lobes
  PhotonMapView map;
};

/// Cell of a coordinate.
RELIEF_KERNEL std::int32_t photon_cell(float x, float inverse_cell)
{
  return static_cast<std::int32_t>(__builtin_floorf(clamp(x * inverse_cell, -1e9f, 1e9f)));
}

/// First bucket of a row of cells; cell (x, y, z) is in bucket (row + x) & mask.
RELIEF_KERNEL std::uint32_t photon_row(std::int32_t y, std::int32_t z)
{
  return static_cast<std::uint32_t>(y) * 0x9e3779b1u ^ static_cast<std::uint32_t>(z) * 0x85ebca77u;
}

/// Factor on the first pass's radius.
/// @param pass   counted from 0
/// @param alpha  (0, 1): 1 keeps the radius, and with it the bias; 2/3 makes squared bias and variance fall alike
/// @source Knaus and Zwicker 2011, "Progressive Photon Mapping: A Probabilistic Approach", Eq. 15
inline double photon_radius_factor(std::uint32_t pass, double alpha)
{
  double squared = 1.0;
  for (std::uint32_t i = 1; i <= pass; ++i) squared *= (i + alpha) / (i + 1.0);
  return __builtin_sqrt(squared);
}

}  // namespace relief
