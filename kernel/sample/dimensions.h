// Which dimension of the sampler a random number of a path comes from. One table, so that no two uses collide.
#pragma once

#include <cstdint>

#include "kernel/kernel.h"

namespace relief {

/// Uses before the first surface.
enum class CameraDimension : std::uint32_t {
  kFilm,  ///< 2D: place within the pixel filter
  kLens,  ///< 2D: place on the aperture
  kCount
};

/// Uses at every surface that a path meets.
enum class BounceDimension : std::uint32_t {
  kBsdfLobe,      ///< 1D: which lobe scatters
  kBsdfUv,        ///< 2D: direction within the lobe
  kLightChoice,   ///< 1D: which light
  kLightUv,       ///< 2D: place on the light
  kRoulette,      ///< 1D: whether the path goes on
  kTransparency,  ///< 1D: whether a partly transparent surface is there
  kCount
};

inline constexpr std::uint32_t kDimensionsPerBounce = static_cast<std::uint32_t>(BounceDimension::kCount);

/// @return dimension for sample_2d
RELIEF_KERNEL constexpr std::uint32_t dimension_camera(CameraDimension use) { return static_cast<std::uint32_t>(use); }

/// Dimension for sample_1d that a path's dither between levels of detail is from; no bounce gets so far.
inline constexpr std::uint32_t kLodDimension = ~0u;

/// Dimension for sample_1d that chooses whether a surface's sharp or soft lobes have scattered a path.
/// @param surface  see path_surface
RELIEF_KERNEL constexpr std::uint32_t dimension_sharpness(int surface)
{
  return ~1u - static_cast<std::uint32_t>(surface);
}

/// Uses at the start of a photon; its bounces use the same dimensions as a camera path's.
enum class PhotonDimension : std::uint32_t {
  kSource,  ///< 1D: which light, towards which caster
  kLight,   ///< 2D: place on the light, or direction of the environment
  kAim,     ///< 2D: direction, or place across it
};

/// @return dimension for sample_1d or sample_2d, as the use says
RELIEF_KERNEL constexpr std::uint32_t dimension_photon(PhotonDimension use)
{
  return 0x80000000u + static_cast<std::uint32_t>(use);
}

/// @param bounce  scattering events of the path before this surface, >= 0
/// @return        dimension for sample_1d or sample_2d, as the use says
RELIEF_KERNEL constexpr std::uint32_t dimension_bounce(int bounce, BounceDimension use)
{
  return static_cast<std::uint32_t>(CameraDimension::kCount) +
         static_cast<std::uint32_t>(bounce) * kDimensionsPerBounce + static_cast<std::uint32_t>(use);
}

}  // namespace relief
