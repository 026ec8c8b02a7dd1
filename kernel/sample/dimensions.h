// Which dimension of the sampler a random number of a path comes from. One table, so that no two uses collide.
#pragma once

#include <cstdint>

#include "kernel/sample/choice.h"

namespace relief {

/// Uses before the first surface.
enum class CameraDimension : std::uint32_t {
  kFilm,  ///< 2D: place within the pixel filter
  kLens,  ///< 2D: place on the aperture
  kCount
};

/// Uses at every surface that a path meets. The first four are drawn together, see scatter_samples.
enum class BounceDimension : std::uint32_t {
  kLight,         ///< 2D: which light, and the place on it
  kBsdf,          ///< 2D: which lobe scatters, and the direction within it
  kBranch,        ///< 2D: whether what the direction is known of reflects or transmits; the second is left
  kFate,          ///< 2D: whether the path goes on; whether sharp or soft lobes have scattered it
  kTransparency,  ///< 1D: whether a partly transparent surface is there
  kCount
};

inline constexpr std::uint32_t kDimensionsPerBounce = static_cast<std::uint32_t>(BounceDimension::kCount);

/// @return dimension for sample_2d
RELIEF_KERNEL constexpr std::uint32_t dimension_camera(CameraDimension use) { return static_cast<std::uint32_t>(use); }

/// Dimension for sample_1d that a path's dither between levels of detail is from; no bounce gets so far.
inline constexpr std::uint32_t kLodDimension = ~0u;

/// Dimension for sample_2d of a camera path's ray for ambient occlusion; no bounce gets so far.
inline constexpr std::uint32_t kAmbientDimension = ~0u - 1;

/// Dimension for sample_1d of a path's time while the shutter is open; no bounce gets so far.
inline constexpr std::uint32_t kTimeDimension = ~0u - 2;

/// Uses at every surface that is a level of a height map, see FacetState.
enum class FacetDimension : std::uint32_t {
  kJitter,  ///< 2D: where the facets are
  kChoice,  ///< 2D: which one is met; at what height
  kLeave,   ///< 1D: whether the ray that leaves the facet before gets out
  kCount
};

/// @param bounce  as in dimension_bounce; no bounce gets as far as the first of these
/// @return        dimension for sample_1d or sample_2d, as the use says
RELIEF_KERNEL constexpr std::uint32_t dimension_facet(int bounce, FacetDimension use)
{
  return 0x20000000u + static_cast<std::uint32_t>(bounce) * static_cast<std::uint32_t>(FacetDimension::kCount) +
         static_cast<std::uint32_t>(use);
}

/// Uses in every stretch of a path's ray that is in media. The first four are drawn together.
enum class MediumDimension : std::uint32_t {
  kLight,     ///< 2D: which light, and the place on it
  kPhase,     ///< 2D: which phase function, and the direction
  kDistance,  ///< 2D: how far the path gets; which channel that is asked of
  kDirect,    ///< 2D: where light is asked for; how that is chosen
  kPivot,     ///< 2D: the light around which it is
  kFate,      ///< 1D: whether the path goes on
  kCount
};

/// @param stretch  of the path's rays, from 0 on; few get as far as the first of those that photons use
/// @return         dimension for sample_1d or sample_2d, as the use says
RELIEF_KERNEL constexpr std::uint32_t dimension_medium(std::uint32_t stretch, MediumDimension use)
{
  return 0x30000000u + stretch * static_cast<std::uint32_t>(MediumDimension::kCount) + static_cast<std::uint32_t>(use);
}

/// Dimension for sample_2d of where in a stretch that is in media the environment is asked for.
RELIEF_KERNEL constexpr std::uint32_t dimension_medium_sky(std::uint32_t stretch) { return 0x38000000u + stretch; }

/// Uses at the start of a photon; its bounces use the same dimensions as a camera path's.
enum class PhotonDimension : std::uint32_t {
  kSource,  ///< 1D: which light, towards which caster
  kLight,   ///< 2D: place on the light, or direction of the environment
  kAim,     ///< 2D: direction, or place across it
};

/// @return dimension for sample_1d or sample_2d, as the use says
RELIEF_KERNEL constexpr std::uint32_t dimension_photon(PhotonDimension use)
{
  return 0x40000000u + static_cast<std::uint32_t>(use);
}

/// Numbers of a walk below a surface that are stratified, and of a probe: pairs.
inline constexpr int kPairsBelow = 12;

/// @param bounce  surfaces that the path has met before
/// @param pair    below kPairsBelow
/// @return        dimension for sample_1d or sample_2d, as the use says
RELIEF_KERNEL constexpr std::uint32_t dimension_below(int bounce, int pair)
{
  return 0x80000000u + static_cast<std::uint32_t>(bounce * kPairsBelow + pair);
}

/// @param bounce  surfaces that the path has met before, see path_surface
/// @return        dimension for sample_1d or sample_2d, as the use says
RELIEF_KERNEL constexpr std::uint32_t dimension_bounce(int bounce, BounceDimension use)
{
  return static_cast<std::uint32_t>(CameraDimension::kCount) +
         static_cast<std::uint32_t>(bounce) * kDimensionsPerBounce + static_cast<std::uint32_t>(use);
}

/// The numbers that one scattering event may ask for, each in [0, 1).
struct ScatterSamples {
  ChoicePoint light;
  Vec2f bsdf;
  float branch, roulette, sharpness;
};

/// @param bounce  as in dimension_bounce; the rest as in sample_2d
RELIEF_KERNEL ScatterSamples scatter_samples(std::uint32_t pixel_hash, std::uint32_t sample_index, int bounce)
{
  const Sample2dX4 u = sample_2d_x4(pixel_hash, sample_index, dimension_bounce(bounce, BounceDimension::kLight));
  return {choice_point(u.first_bits[0], u.first_bits[1]), u.at[1], u.at[2].x, u.at[3].x, u.at[3].y};
}

}  // namespace relief
