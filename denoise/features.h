// The features that colours are regressed on, cleaned of their own noise: of lenses, of motion, of edges.
#pragma once

#include <array>
#include <vector>

#include "denoise/image.h"

namespace relief {

/// Features as the regression wants them: 8 floats for pixel after pixel, the first of which is 1 (0 of the noise).
struct FeatureColumns {
  std::vector<float> value;
  std::vector<float> noise;  ///< variances of what may still differ by chance
};

/// Filters albedo, normal and depth, each by itself, by non-local means whose weights for one half come from the other.
/// @return of either half by itself: where edges are noisy, features and colours are so together, and features of both
///         halves would bring the one half's noise into the other
/// @source Rousselle et al. 2013, "Robust Denoising using Feature and Color Information", §5
std::array<FeatureColumns, 2> features_filter(const DenoiseInput& input);

}  // namespace relief
