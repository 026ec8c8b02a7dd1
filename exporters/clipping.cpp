#include "exporters/clipping.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace relief {

Clipping picture_clipping(const ImageView& image, const ColorView& view, double exposure)
{
  constexpr double kMostPixels = 65536;
  const double num_pixels = static_cast<double>(image.width) * image.height;
  const int step = std::max(1, static_cast<int>(std::ceil(std::sqrt(num_pixels / kMostPixels))));
  const float gain = static_cast<float>(std::exp2(exposure));
  std::vector<float> rgb;
  std::vector<float> luminances;
  for (int y = step / 2; y < image.height; y += step) {
    for (int x = step / 2; x < image.width; x += step) {
      const float r = image.channels[0].at(x, y), g = image.channels[1].at(x, y), b = image.channels[2].at(x, y);
      const float luminance = 0.2126f * r + 0.7152f * g + 0.0722f * b;
      if (!(image.channels[3].at(x, y) > 0.5f) || !std::isfinite(luminance)) continue;
      luminances.push_back(luminance);
      rgb.insert(rgb.end(), {r * gain, g * gain, b * gain});
    }
  }
  if (luminances.empty()) return {};
  view.apply(rgb);
  // What rounds to the last of 256 codes in every channel.
  constexpr float kWhite = 254.5f / 255.0f;
  std::size_t num_white = 0;
  for (std::size_t i = 0; i < rgb.size(); i += 3) {
    if (std::min({rgb[i], rgb[i + 1], rgb[i + 2]}) >= kWhite) ++num_white;
  }
  const auto median = luminances.begin() + static_cast<std::ptrdiff_t>(luminances.size() / 2);
  std::nth_element(luminances.begin(), median, luminances.end());
  constexpr double kMiddleGrey = 0.18;
  return {static_cast<double>(num_white) / static_cast<double>(luminances.size()),
          std::log2(kMiddleGrey / std::max(static_cast<double>(*median), 1e-30))};
}

}  // namespace relief
