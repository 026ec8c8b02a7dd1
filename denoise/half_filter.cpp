#include "denoise/half_filter.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <memory>

#include "denoise/fit_tile.h"

namespace relief {

void half_filter(const DenoiseInput& input,
                 const Halves& halves,
                 std::size_t half,
                 const ColorPlanes& variance,
                 const FeatureColumns& features,
                 std::vector<Candidate>& candidates)
{
  const int width = halves.is_known.width(), height = halves.is_known.height();
  const auto pixel_of = [width](int x, int y) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
  };
  const std::size_t num_pixels = pixel_of(0, height);
  std::vector<float> data(4 * num_pixels);
  for_pixels(halves.is_known, [&](int x, int y) {
    float* to = data.data() + 4 * pixel_of(x, y);
    for (std::size_t c = 0; c < 3; ++c) to[c] = halves.color[half][c].row(y)[x];
  });
  FitPlanes planes;
  planes.width = width;
  planes.height = height;
  planes.stride = halves.is_known.stride();
  for (std::size_t c = 0; c < 3; ++c) {
    planes.guide[c] = halves.color[1 - half][c].row(0);
    planes.guide_variance[c] = variance[c].row(0);
  }
  planes.is_known = halves.is_known.row(0);
  planes.design = features.value.data();
  planes.design_noise = features.noise.data();
  planes.data = data.data();

  const FitTile fit_tile = fit_tile_select();
  std::array<std::vector<F8>, kNumFits> sums;
  for (std::vector<F8>& of_width : sums) of_width.assign(num_pixels, F8{});
  tbb::enumerable_thread_specific<std::unique_ptr<FitScratch>> scratches([] { return std::make_unique<FitScratch>(); });
  const int tiles_x = (width + kFitTile - 1) / kFitTile, tiles_y = (height + kFitTile - 1) / kFitTile;
  // Tiles predict beyond their edges. Of those two apart none touches another's pixels, and every pixel has its sums in one
  // order, whatever the number of threads.
  static_assert(kFitSpan <= 2 * kFitTile);
  for (int phase = 0; phase < 4; ++phase) {
    const int first_x = phase & 1, first_y = phase >> 1;
    const int num_x = (tiles_x - first_x + 1) / 2, num_y = (tiles_y - first_y + 1) / 2;
    tbb::parallel_for(0, num_x * num_y, [&](int i) {
      denoise_check_stop(input);
      const int x0 = (first_x + 2 * (i % num_x)) * kFitTile, y0 = (first_y + 2 * (i / num_x)) * kFitTile;
      FitScratch& scratch = *scratches.local();
      fit_tile(planes, x0, y0, scratch);
      const int begin_x = std::max(x0 - kFitReach, 0), end_x = std::min(x0 + kFitTile + kFitReach, width);
      const int begin_y = std::max(y0 - kFitReach, 0), end_y = std::min(y0 + kFitTile + kFitReach, height);
      for (std::size_t fit = 0; fit < kNumFits; ++fit) {
        for (int y = begin_y; y < end_y; ++y) {
          const F8* from = scratch.sums[fit] + (y - y0 + kFitReach) * kFitSpan - x0 + kFitReach;
          F8* to = sums[fit].data() + pixel_of(0, y);
          for (int x = begin_x; x < end_x; ++x) to[x] += from[x];
        }
      }
    });
  }

  for (std::size_t fit = 0; fit < kNumFits; ++fit) {
    for_pixels(halves.is_known, [&](int x, int y) {
      const F8 sum = sums[fit][pixel_of(x, y)];
      const float even = halves.even_share.row(y)[x], share = half == 0 ? even : 1.0f - even;
      for (std::size_t c = 0; c < 3; ++c) {
        const float value = sum[3] > 0 ? sum[static_cast<int>(c)] / sum[3] : halves.color[half][c].row(y)[x];
        candidates[fit].color[c].row(y)[x] += share * value;
        candidates[fit].difference[c].row(y)[x] += half == 0 ? value : -value;
      }
    });
  }
}

}  // namespace relief
