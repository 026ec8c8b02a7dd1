// Denoised pictures to choose from, and what is made of them.
#pragma once

#include <vector>

#include "denoise/halves.h"

namespace relief {

/// A denoised picture, and what it is of the first half alone less what it is of the second.
struct Candidate {
  Candidate(int width, int height) : color(color_planes(width, height)), difference(color_planes(width, height)) {}
  ColorPlanes color, difference;
};

/// What one channel of a denoised picture D gains over the picture as it is, y. Both are by chance far from the truth in one
/// pixel: only sums tell something.
struct Gain {
  float square;  ///< of D − y
  float noise;   ///< of Var(y) − Cov(D, y): the noise that D takes away
  float own;     ///< of Var(y)
  /// Of the squared error of y + part·(D − y):  Var(y) − 2 part (Var(y) − Cov(D, y)) + part² (D − y)².
  float error(float part) const { return own - 2 * part * noise + part * part * square; }
};

/// Cov(D, y) follows from what the halves and their filtered forms differ by, as a half's filtered form knows nothing of the
/// noise of the other; Var(y) from what the halves differ by, of which only a part is noise of both (independent_part).
Gain gain_of(const Halves& halves, const Candidate& candidate, std::size_t channel, int x, int y);

/// Puts together the best parts of the candidates. Of those each pixel gets as much as pays: the picture as it is moves towards
/// the best candidate by
///   Σ (Var(y) − Cov(D, y)) / Σ (D − y)²,  at least 0 and at most 1,
/// which makes the estimated error least, and by less where a few pixels make all of that. So what nobody denoised well stays
/// as it was, and the error does not grow but by chance. Sums are over the neighbourhood without the pixel itself: what is
/// chosen by a pixel's own noise is better than it should be, and the error that is left would be estimated too low.
/// @return the picture as it is where it is not known, or certain all around
/// @source James & Stein 1961, with the error of a linear estimate in place of that of none
Candidate candidates_combine(const Halves& halves, const std::vector<Candidate>& candidates);

}  // namespace relief
