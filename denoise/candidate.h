// Denoised pictures to choose from, and the choice.
#pragma once

#include <vector>

#include "denoise/halves.h"

namespace relief {

/// A denoised picture, and what it is of the first half alone less what it is of the second.
struct Candidate {
  Candidate(int width, int height) : color(color_planes(width, height)), difference(color_planes(width, height)) {}
  ColorPlanes color, difference;
};

/// Puts together the candidates' best parts, by errors that follow from the halves:
///   E (D − y)² = MSE(D) + Var(y) − 2 Cov(D, y),
/// where y is the picture, D the denoised one, and Cov(D, y) the mean product of what the halves and their filtered forms
/// differ by: a half's filtered form knows nothing of the noise of the other. What Var(y) is plays no part in the choice.
/// @param candidates  the last one is the picture as it is, which stays where it is not known or certain all around
Candidate candidates_choose(const Halves& halves, const std::vector<Candidate>& candidates);

}  // namespace relief
