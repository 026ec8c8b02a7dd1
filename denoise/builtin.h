// The built-in denoiser: first-order regression of the colours on features, each half of the samples filtered by weights
// from the other, in two widths. Every pixel moves towards the better one by as much as the halves say that it pays
// (candidate.h). The halves also tell the error that is left (error_estimate.h).
//
// Source: Bitterli et al. 2016, "Nonlinearly Weighted First-order Regression for Denoising Monte Carlo Renderings"; the weights
// are those of Rousselle et al. 2012, "Adaptive Rendering with Non-Local Means Filtering". We differ in this: fireflies are
// taken out first; regressions are centred at every second pixel; features of a half are its own, emitters' light in them is not
// filtered; and how errors are estimated.
#pragma once

#include "denoise/image.h"

namespace relief {

/// Denoises a picture. Where nothing varies, and where a pixel has less than two samples, it stays as it is.
/// @error DenoiseStopped
/// @cost  about 350 bytes a pixel; 1920 × 1080 pixels take 20 seconds of one processor with AVX2, 30 without
DenoiseResult denoise_builtin(const DenoiseInput& input);

}  // namespace relief
