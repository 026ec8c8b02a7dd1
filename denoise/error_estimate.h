// How far a denoised picture is off, from the halves of its samples.
//
// The noise that is left is what the halves' filtered forms differ by. What the filter itself does wrong is known in two ways:
// - Noise of neighbouring pixels is independent and the filter's error is alike. So their residuals' mean product, less what is
//   left of the noise, tells it, without any variance. Detail of one pixel's size is not alike in neighbours, and is missed.
// - (D − y)² less the variance of y, and what of it is in D, knows of all detail (candidate.h). But it is a small difference of
//   large numbers where much was denoised, and the variance is known to a tenth.
// The larger is taken, if it is more than chance makes of nothing.
#pragma once

#include "denoise/candidate.h"

namespace relief {

/// Fills in the error of a result.
/// @param halves  its `lost` is smoothed
void error_estimate(Halves& halves, const Candidate& picture, DenoiseResult& result);

}  // namespace relief
