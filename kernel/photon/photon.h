// A photon, the map of a pass as the kernel reads it, and the schedule by which its radius shrinks.
#pragma once

#include "kernel/math/box.h"
#include "kernel/math/octahedral.h"

namespace relief {

/// Light that arrived at a surface, or in a medium, after one or more sharp reflections or refractions.
struct PhotonArrival {
  Vec3f power;                ///< W; in media, what of it is scattered
  std::uint32_t wi = 0;       ///< octahedral, towards where it came from
  std::uint32_t Ng = 0;  ///< octahedral, geometric normal on the side it arrived at; in media those, see media_name
  std::uint32_t bounces = 0;  ///< counts as the path state's, of all its scatterings but the first
};

struct Photon {
  Vec3f P;  ///< world, metres
  PhotonArrival arrival;
};

/// Octaves of radii that have a grid of their own; the last has all smaller ones.
inline constexpr int kPhotonOctaves = 8;

/// Photons of a pass in hash grids, one for each octave of their radii: those of one cell are consecutive, those of cells
/// that follow each other in x as well (but for hash wrap-around).
struct PhotonMapView {
  const float *x = nullptr, *y = nullptr, *z = nullptr;  ///< world, metres
  const float* inverse_radius_squared = nullptr;         ///< 1/m²
  const PhotonArrival* arrivals = nullptr;
  const std::uint32_t* bucket_begin = nullptr;  ///< bucket_mask + 2 entries
  std::uint32_t bucket_mask = 0;                ///< number of buckets − 1; a power of two
  const Box3* bounds = nullptr;                 ///< of photons, for each octave
  std::uint32_t octaves = 0;  ///< bit i: there are photons of radii in largest_radius · (2^−i−1, 2^−i]
  float largest_radius = 0;   ///< metres; 0: no photons. Cells are twice as wide as an octave's largest
  const std::uint8_t* near =
      nullptr;                  ///< near_mask + 1 entries, by photon_near; bit i: a photon of octave i reaches there
  std::uint32_t near_mask = 0;  ///< a power of two − 1
};

/// Photons of a leaf, and children of a node.
inline constexpr int kPhotonTreeWidth = 8;

/// Levels that trees have at most: more photons than 32 bits count.
inline constexpr int kMostPhotonLevels = 11;

/// Boxes of eight children.
struct PhotonBoxes {
  float low[3][kPhotonTreeWidth], high[3][kPhotonTreeWidth];
};

/// Photons of a pass that lie in media. The columns of numbers have whole leaves; what fills the last one has an infinite inverse radius.
struct MediumPhotonsView {
  const float *x = nullptr, *y = nullptr, *z = nullptr;  ///< world, metres
  const float* inverse_radius_squared = nullptr;         ///< 1/m²
  const PhotonArrival* arrivals = nullptr;               ///< power times metres, W m; Ng is medium_name
  const PhotonBoxes* nodes[kMostPhotonLevels] = {};      ///< of each level; the lowest one's children are photons
  std::uint32_t num_photons = 0;
  int num_levels = 0;
};

/// What the stages need of the caustic pass.
struct CausticsView {
  bool enabled = false;
  std::uint32_t switched_off = 0;  ///< bit PathEvent: light that was scattered so last lights nothing diffuse
  float roughness = 0;             ///< perceptual, see sharp_lobes
  PhotonMapView map;
  MediumPhotonsView in_media;
  float time = 0;  ///< of all photons of the pass, and of all paths that gather them
};

/// Cell of a coordinate.
RELIEF_KERNEL std::int32_t photon_cell(float x, float inverse_cell)
{
  return static_cast<std::int32_t>(__builtin_floorf(clamp(x * inverse_cell, -1e9f, 1e9f)));
}

/// First bucket of a row of cells; cell (x, y, z) is in bucket (row + x) & mask.
RELIEF_KERNEL std::uint32_t photon_row(std::int32_t y, std::int32_t z, int octave)
{
  return (static_cast<std::uint32_t>(y) * 0x9e3779b1u ^ static_cast<std::uint32_t>(z) * 0x85ebca77u) +
         static_cast<std::uint32_t>(octave) * 0xc2b2ae35u;
}

/// Entry of PhotonMapView::near for a cell as wide as the largest radius. Cells may share one.
RELIEF_KERNEL std::uint32_t photon_near(std::int32_t x, std::int32_t y, std::int32_t z, std::uint32_t mask)
{
  return (photon_row(y, z, kPhotonOctaves) + static_cast<std::uint32_t>(x)) & mask;
}

/// Octave of a photon's radius.
/// @param inverse_squared  1/m², of its radius; least_inverse of the largest
RELIEF_KERNEL int photon_octave(float inverse_squared, float least_inverse)
{
  int octave = 0;
  for (float next = 4.0f * least_inverse; octave + 1 < kPhotonOctaves && inverse_squared >= next; next *= 4.0f)
    ++octave;
  return octave;
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
