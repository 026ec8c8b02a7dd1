#include "denoise/builtin.h"

#include <array>

#include "denoise/error_estimate.h"
#include "denoise/features.h"
#include "denoise/fit_tile.h"
#include "denoise/half_filter.h"

namespace relief {

DenoiseResult denoise_builtin(const DenoiseInput& input)
{
  const int width = input.width, height = input.height;
  Halves halves = halves_make(input);
  replace_fireflies(halves);
  find_independent_parts(halves);
  denoise_check_stop(input);
  std::vector<Candidate> candidates(kNumFits, Candidate(width, height));
  {
    const std::array<FeatureColumns, 2> features = features_filter(input);
    ColorPlanes variance = halves.variance;
    for (std::size_t c = 0; c < 3; ++c) {
      box_filter(variance[c], 1);
      for_pixels(variance[c], [&](int x, int y) { variance[c].row(y)[x] *= 2; });
      variance[c].extend();
      for (ColorPlanes& half : halves.color) half[c].extend();
    }
    for (std::size_t half = 0; half < 2; ++half) half_filter(input, halves, half, variance, features[half], candidates);
  }
  const Candidate picture = candidates_combine(halves, candidates);
  denoise_check_stop(input);

  DenoiseResult result;
  result.color.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * 3);
  for_pixels(halves.is_known, [&](int x, int y) {
    const std::size_t pixel =
        static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
    for (std::size_t c = 0; c < 3; ++c) result.color[3 * pixel + c] = picture.color[c].row(y)[x];
  });
  error_estimate(halves, picture, result);
  return result;
}

}  // namespace relief
