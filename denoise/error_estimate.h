// How far a denoised picture is off, from the halves of its samples.
//
// The noise that is left is what the halves' filtered forms differ by. What the filter itself does wrong cannot be told from
// noise in one pixel: it would be (D − y)² less the variance of y, of which a tenth is wanted while it is known no better than
// that. But noise of neighbouring pixels is independent and the filter's error is alike. So their residuals' mean product,
// less what is left of the noise, tells it, without any variance.
#pragma once

#include "denoise/candidate.h"

namespace relief {

/// Fills in the error of a result.
/// @param halves  its `lost` is smoothed
void error_estimate(Halves& halves, const Candidate& picture, DenoiseResult& result);

}  // namespace relief
