// Compiled once an instruction set, so nothing here may end up in a symbol that another object shares.
#include "denoise/fit_tile.h"

namespace relief {

namespace {

constexpr int kLane = 8;
constexpr int kRow = 48;  // of FitScratch::rows: a tile, its patches, and what whole vectors read beyond
constexpr int kNumTerms = 8, kNumValues = 3;

/// Fills in the mean squared difference of patches between every centre and the pixel at an offset from it, in units of
/// what noise makes of equal ones.
/// @source Rousselle et al. 2012, Eq. 3 to 5
void distances_at(const FitPlanes& planes, int x0, int y0, int dx, int dy, FitScratch& scratch)
{
  // Differences of pictures without noise: below what eight bits show of a grey of .01.
  constexpr float kLeastVariance = 1e-10f, kMost = 1000.0f;
  const int offset = (dy + kFitReach) * kFitSide + dx + kFitReach;
  for (int row = 0; row < kFitTile + 2 * kFitPatch; ++row) {
    const std::ptrdiff_t at = (y0 + row - kFitPatch) * planes.stride + x0 - kFitPatch;
    const std::ptrdiff_t other = at + dy * planes.stride + dx;
    for (int x = 0; x < kFitTile + 2 * kFitPatch; x += kLane) {
      F8 sum{};
      for (int c = 0; c < 3; ++c) {
        const F8 difference = load8(planes.guide[c] + at + x) - load8(planes.guide[c] + other + x);
        const F8 v = load8(planes.guide_variance[c] + at + x), w = load8(planes.guide_variance[c] + other + x);
        sum += (difference * difference - (v + min(v, w))) / (v + w + kLeastVariance);
      }
      store8(scratch.rows + row * kRow + x, min(sum, splat8(kMost)));
    }
  }
  constexpr float kScale = 1.0f / (3.0f * (2 * kFitPatch + 1) * (2 * kFitPatch + 1));
  for (int cy = 0; cy < kFitCentres; ++cy) {
    float columns[kRow];
    for (int x = 0; x < kFitTile + 2 * kFitPatch; x += kLane) {
      F8 sum{};
      for (int i = 0; i <= 2 * kFitPatch; ++i) sum += load8(scratch.rows + (cy * kFitStep + i) * kRow + x);
      store8(columns + x, sum);
    }
    for (int cx = 0; cx < kFitCentres; ++cx) {
      float sum = 0;
      for (int i = 0; i <= 2 * kFitPatch; ++i) sum += columns[cx * kFitStep + i];
      scratch.distance[cy * kFitCentres + cx][offset] = sum * kScale;
    }
  }
}

/// exp(−d), nearly, and 0 from d = 8 on.
float weight_of(float d)
{
  const float a = d > 0.0f ? 1.0f - d * 0.125f : 1.0f;
  if (!(a > 0.0f)) return 0.0f;
  const float a2 = a * a, a4 = a2 * a2;
  return a4 * a4;
}

/// Solves the ridge regression of three values by Cholesky's method.
/// @param m, r  sums of weighted products of the terms, and of terms and values
/// @param to    coefficients: to[k][c] of term k for value c; lane 3 gives 1 for every pixel
void solve(const F8* m, const F8* r, const float* noise, F8* to)
{
  constexpr double kRidge = 1e-4;
  double l[kNumTerms][kNumTerms];
  const double total = static_cast<double>(m[0][0]);
  for (int i = 0; i < kNumTerms; ++i) {
    for (int j = 0; j <= i; ++j) {
      double sum = static_cast<double>(m[i][j]);
      if (i == j && i > 0) {
        const double mean = static_cast<double>(m[i][0]) / total;
        const double variance = sum / total - mean * mean;
        sum += total * ((variance > 0 ? kRidge * variance : 0.0) + static_cast<double>(noise[i]));
      }
      for (int k = 0; k < j; ++k) sum -= l[i][k] * l[j][k];
      // The ridge keeps the pivot positive but for rounding; then the term is left out.
      l[i][j] = i == j ? (sum > 0 ? __builtin_sqrt(sum) : 1e30) : sum / l[j][j];
    }
  }
  for (int c = 0; c < kNumValues; ++c) {
    double b[kNumTerms];
    for (int i = 0; i < kNumTerms; ++i) {
      b[i] = static_cast<double>(r[c][i]);
      for (int k = 0; k < i; ++k) b[i] -= l[i][k] * b[k];
      b[i] /= l[i][i];
    }
    for (int i = kNumTerms - 1; i >= 0; --i) {
      for (int k = i + 1; k < kNumTerms; ++k) b[i] -= l[k][i] * b[k];
      b[i] /= l[i][i];
      to[i][c] = static_cast<float>(b[i]);
    }
  }
  for (int i = 0; i < kNumTerms; ++i) {
    to[i][kNumValues] = i == 0 ? 1.0f : 0.0f;
    for (int c = kNumValues + 1; c < kLane; ++c) to[i][c] = 0.0f;
  }
}

/// One regression, and its predictions for all pixels that it took in.
/// @param x, y  of the centre
/// @param sums  of the pixel kFitReach to the left of and above the centre, in rows of kFitSpan
void fit_centre(const FitPlanes& planes, int x, int y, const float* distance, float width, float* weight, F8* sums)
{
  constexpr float kLeastWeight = 1e-4f;
  const auto pixel = [&](int dx, int dy) { return static_cast<std::ptrdiff_t>(y + dy) * planes.width + x + dx; };
  F8 centre = load8(planes.design + pixel(0, 0) * kNumTerms);
  centre[0] = 0.0f;
  F8 m[kNumTerms] = {}, r[kNumValues] = {};
  const float scale = 1.0f / (width * width);
  for (int dy = -kFitReach; dy <= kFitReach; ++dy) {
    const float* known = planes.is_known + (y + dy) * planes.stride + x;
    for (int dx = -kFitReach; dx <= kFitReach; ++dx) {
      const int offset = (dy + kFitReach) * kFitSide + dx + kFitReach;
      const float w = weight_of(distance[offset] * scale) * known[dx];
      weight[offset] = w > kLeastWeight ? w : 0.0f;
      if (!(w > kLeastWeight)) continue;
      const F8 term = load8(planes.design + pixel(dx, dy) * kNumTerms) - centre;
      const float* value = planes.data + pixel(dx, dy) * (kNumValues + 1);
      const F8 weighted = term * w;
      for (int k = 0; k < kNumTerms; ++k) m[k] += weighted * term[k];
      for (int c = 0; c < kNumValues; ++c) r[c] += weighted * value[c];
    }
  }
  if (!(m[0][0] > 0.0f)) return;
  F8 coefficients[kNumTerms];
  solve(m, r, planes.design_noise + pixel(0, 0) * kNumTerms, coefficients);
  for (int dy = -kFitReach; dy <= kFitReach; ++dy) {
    F8* to = sums + (dy + kFitReach) * kFitSpan;
    for (int dx = -kFitReach; dx <= kFitReach; ++dx) {
      const float w = weight[(dy + kFitReach) * kFitSide + dx + kFitReach];
      if (!(w > 0.0f)) continue;
      const F8 term = load8(planes.design + pixel(dx, dy) * kNumTerms) - centre;
      F8 predicted{};
      for (int k = 0; k < kNumTerms; ++k) predicted += coefficients[k] * term[k];
      to[dx + kFitReach] += predicted * w;
    }
  }
}

}  // namespace

void RELIEF_FIT_TILE(const FitPlanes& planes, int x0, int y0, FitScratch& scratch)
{
  for (int dy = -kFitReach; dy <= kFitReach; ++dy) {
    for (int dx = -kFitReach; dx <= kFitReach; ++dx) distances_at(planes, x0, y0, dx, dy, scratch);
  }
  for (int fit = 0; fit < kNumFits; ++fit) {
    for (F8& sum : scratch.sums[fit]) sum = F8{};
    for (int cy = 0; cy < kFitCentres; ++cy) {
      for (int cx = 0; cx < kFitCentres; ++cx) {
        const int x = x0 + cx * kFitStep, y = y0 + cy * kFitStep;
        if (x >= planes.width || y >= planes.height) continue;
        fit_centre(planes, x, y, scratch.distance[cy * kFitCentres + cx], kFitWidths[fit], scratch.weight,
                   scratch.sums[fit] + cy * kFitStep * kFitSpan + cx * kFitStep);
      }
    }
  }
}

}  // namespace relief
