// First-order regression over one tile: the part of the built-in denoiser that takes its time, compiled once an
// instruction set.
#pragma once

#include <cstddef>

#include "kernel/math/lanes.h"

namespace relief {

/// Centres of regressions are every kFitStep-th pixel of tiles of kFitTile²; each takes in, and predicts, the pixels up to
/// kFitReach away, weighted by how alike the squares of pixels up to kFitPatch around them are.
inline constexpr int kFitTile = 32, kFitStep = 2, kFitReach = 9, kFitPatch = 3;
inline constexpr int kFitSide = 2 * kFitReach + 1, kFitOffsets = kFitSide * kFitSide;
inline constexpr int kFitCentres = kFitTile / kFitStep, kFitSpan = kFitTile + 2 * kFitReach;
/// Widths of the weights, as factors on the distance between patches; each gives a picture of its own.
inline constexpr int kNumFits = 2;
inline constexpr float kFitWidths[kNumFits] = {0.5f, 1.0f};

/// Views of whole planes; all have the stride and the border of Plane, but for what says otherwise.
struct FitPlanes {
  int width = 0, height = 0;
  std::ptrdiff_t stride = 0;
  const float* guide[3] = {};  ///< by which weights are judged, with its variance
  const float* guide_variance[3] = {};
  const float* is_known = nullptr;  ///< 1; 0 for pixels that nothing is to be learnt from, as in the border
  /// Of pixel after pixel, without a border: 1 and the features; what little they may vary by chance; R, G, B and 0.
  const float* design = nullptr;        ///< 8 a pixel
  const float* design_noise = nullptr;  ///< 8 a pixel: variances
  const float* data = nullptr;          ///< 4 a pixel
};

/// What a tile works in.
struct FitScratch {
  float rows[(kFitTile + 2 * kFitPatch) * 48];
  float distance[kFitCentres * kFitCentres][kFitOffsets];
  float weight[kFitOffsets];
  /// Sums over all predictions of a pixel: R, G, B, and the weights.
  F8 sums[kNumFits][kFitSpan * kFitSpan];
};

/// Fills scratch.sums for the square of kFitSpan² pixels that begins kFitReach before the tile.
/// @param x0, y0  first pixel of the tile
using FitTile = void (*)(const FitPlanes& planes, int x0, int y0, FitScratch& scratch);

/// The function for this processor; RELIEF_ISA=baseline asks for the one without AVX2.
FitTile fit_tile_select();

void fit_tile_baseline(const FitPlanes& planes, int x0, int y0, FitScratch& scratch);
void fit_tile_avx2(const FitPlanes& planes, int x0, int y0, FitScratch& scratch);

}  // namespace relief
