// The feature masks that surface kernels are instantiated for. Few, because each costs code and compile time; a
// material uses the first that has all its features.
#pragma once

#include "integrator/stages.h"
#include "kernel/feature_mask.h"

namespace relief {

/// Materials of closures; what glTF's lobes need is left out.
inline constexpr unsigned kMixtureFeatures =
    kFeatureMixture | kFeatureGraphs | kFeatureTextures | kFeatureTransparency | kFeatureTransmission;

inline constexpr unsigned kSurfaceKernelFeatures[kNumSurfaceKernels] = {
    0,
    kFeatureMetal,
    kFeatureTransmission,
    kFeatureMetal | kFeatureTextures | kFeatureNormalMaps | kFeatureTransparency,
    kFeatureAll,
    kFeatureGraphs | kFeatureMetal | kFeatureTextures | kFeatureNormalMaps | kFeatureTransparency,
    kFeatureGraphs | kFeatureAll,
    kMixtureFeatures,
    kFeatureCaustics,
    kFeatureCaustics | kFeatureAll,
    kFeatureCaustics | kFeatureGraphs | kFeatureAll,
    kFeatureCaustics | kMixtureFeatures,
};

/// Kernel for a material.
/// @param caustics  the render has a photon pass
inline int surface_kernel_index(const Material& material, bool caustics)
{
  const unsigned needed = feature_mask_of(material) | (caustics ? kFeatureCaustics : 0u);
  int index = 0;
  while ((needed & ~kSurfaceKernelFeatures[index]) != 0) ++index;
  return index;
}

}  // namespace relief
