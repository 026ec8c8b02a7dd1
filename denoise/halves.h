// A picture as two pictures of half of the samples each, cleaned of what no filter should touch.
#pragma once

#include <array>

#include "denoise/image.h"
#include "denoise/plane.h"

namespace relief {

using ColorPlanes = std::array<Plane, 3>;

ColorPlanes color_planes(int width, int height);

struct Halves {
  Halves(int width, int height);

  /// Of the even-numbered samples and of the odd-numbered ones.
  std::array<ColorPlanes, 2> color;
  ColorPlanes variance;     ///< of the pixel's mean, both halves together
  Plane even_share;         ///< part of the pixel's samples that are even-numbered
  Plane is_known;           ///< 0: fewer than two samples, or values that are no numbers; 0 in the border, too
  ColorPlanes lost;         ///< what replace_fireflies has taken away of the pixel's mean
  ColorPlanes independent;  ///< see find_independent_parts; 1 before

  /// The mean of all samples.
  float mean(std::size_t channel, int x, int y) const
  {
    const float even = even_share.row(y)[x];
    return even * color[0][channel].row(y)[x] + (1.0f - even) * color[1][channel].row(y)[x];
  }
};

/// Pixels that are not known get the picture's values as they are, or 0 where those are no numbers.
Halves halves_make(const DenoiseInput& input);

/// Replaces fireflies by the mean of their neighbours, and counts them as lost: single pixels of one half far above all
/// around them in both. A regression would make blobs of them, whose size is its reach.
void replace_fireflies(Halves& halves);

/// Fills in the part of the halves' squared difference, times their shares, that is the variance of the picture. It is all of
/// it if halves are independent. But they are of one point set, in which each has what the other lacks: they differ by more
/// than the picture is off. Taken for noise, that would be denoised away at the cost of detail.
void find_independent_parts(Halves& halves);

}  // namespace relief
