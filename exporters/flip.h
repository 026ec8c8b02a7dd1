// ꟻLIP: how much a person who flips between two pictures would notice.
//
// @source P. Andersson, J. Nilsson, T. Akenine-Möller, M. Oskarsson, K. Åström, M. D. Fairchild 2020, "FLIP: A Difference
//         Evaluator for Alternating Images", Proc. ACM Comput. Graph. Interact. Tech. 3(2). Section and equation names
//         in flip.cpp are that paper's.
#pragma once

#include <vector>

#include "exporters/picture.h"

namespace relief {

struct FlipOptions {
  double exposure = 0;  ///< stops; linear values times 2^exposure, clamped to [0, 1], are what the sRGB display shows
  /// Pixels in a degree of the viewer's sight. The default is the paper's: a 0.7 m wide display of 3840 pixels seen from 0.7 m.
  double pixels_per_degree = 67.02;
};

/// The error of every pixel, in [0, 1]; row by row from the top. NaN counts as 0.
/// @param a, b  linear Rec.709 R, G, B as the first three channels, equal sizes
/// @source where we differ: the paper starts from sRGB-encoded 8-bit pictures, we from linear values, so nothing is
///         quantized. Pictures outside [0, 1] are judged at the one stated exposure, not at the range that HDR-FLIP scans.
/// @cost about 40 floats a pixel
std::vector<float> flip_map(const ImageView& a, const ImageView& b, const FlipOptions& options = {});

/// Mean of the map.
double flip_mean(const std::vector<float>& map);

}  // namespace relief
