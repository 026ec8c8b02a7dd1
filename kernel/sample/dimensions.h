// Which dimension of the sampler a random number of a path comes from. One table, so that no two uses collide.
#pragma once

#include <cstdint>

#include "kernel/kernel.h"

namespace relief {

/// Uses before the first surface. The comment says which of sample_1d, sample_2d the use calls.
enum class CameraUse : std::uint32_t {
  kPixelFilter,  ///< 2d
  kLens,         ///< 2d
  kNum
};

/// Uses at every surface a path meets.
enum class BounceUse : std::uint32_t {
  kLobe,             ///< 1d, which lobe scatters
  kBsdf,             ///< 2d, direction within the lobe
  kLightChoice,      ///< 1d, which light
  kLight,            ///< 2d, point on the light
  kRussianRoulette,  ///< 1d
  kTransparency,     ///< 1d, whether a partly transparent surface is there
  kNum
};

RELIEF_KERNEL constexpr std::uint32_t sample_dimension(CameraUse use) { return static_cast<std::uint32_t>(use); }

/// @param bounce  surfaces the path has met before, transparent ones included
RELIEF_KERNEL constexpr std::uint32_t sample_dimension(std::uint32_t bounce, BounceUse use)
{
  return static_cast<std::uint32_t>(CameraUse::kNum) + bounce * static_cast<std::uint32_t>(BounceUse::kNum) +
         static_cast<std::uint32_t>(use);
}

}  // namespace relief
