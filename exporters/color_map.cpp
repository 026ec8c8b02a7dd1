#include "exporters/color_map.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "exporters/png_ocio.h"

namespace relief {

namespace {

using Rgb = std::array<double, 3>;

Rgb linear_from_oklch(double lightness, double chroma, double hue)
{
  const double a = chroma * std::cos(hue), b = chroma * std::sin(hue);
  const double l = std::pow(lightness + 0.3963377774 * a + 0.2158037573 * b, 3);
  const double m = std::pow(lightness - 0.1055613458 * a - 0.0638541728 * b, 3);
  const double s = std::pow(lightness - 0.0894841775 * a - 1.2914855480 * b, 3);
  return {4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
          -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
          -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s};
}

bool is_displayable(const Rgb& c)
{
  return std::all_of(c.begin(), c.end(), [](double v) { return v >= 0 && v <= 1; });
}

std::array<std::uint8_t, 3> color_make(double t)
{
  const double lightness = 0.22 + 0.71 * t, hue = (315 - 210 * t) * std::numbers::pi / 180;
  double low = 0, high = 0.17;
  for (int i = 0; i < 24; ++i) {
    const double middle = 0.5 * (low + high);
    (is_displayable(linear_from_oklch(lightness, middle, hue)) ? low : high) = middle;
  }
  const Rgb linear = linear_from_oklch(lightness, low, hue);
  std::array<std::uint8_t, 3> codes{};
  for (std::size_t c = 0; c < 3; ++c) {
    codes[c] = static_cast<std::uint8_t>(std::lround(255 * srgb_from_linear(static_cast<float>(linear[c]))));
  }
  return codes;
}

}  // namespace

std::array<std::uint8_t, 3> color_map(double t)
{
  if (std::isnan(t)) return {128, 128, 128};
  constexpr std::size_t kNumColors = 256;
  static const std::array<std::array<std::uint8_t, 3>, kNumColors> colors = [] {
    std::array<std::array<std::uint8_t, 3>, kNumColors> made{};
    for (std::size_t i = 0; i < kNumColors; ++i) made[i] = color_make(static_cast<double>(i) / (kNumColors - 1));
    return made;
  }();
  return colors[static_cast<std::size_t>(std::lround(std::clamp(t, 0.0, 1.0) * (kNumColors - 1)))];
}

}  // namespace relief
