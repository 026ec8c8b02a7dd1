#include "exporters/shared_exponent.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "kernel/assert.h"

namespace relief {

SharedExponentImage shared_exponent_encode(const ImageView& image)
{
  RELIEF_ASSERT(image.channels.size() >= 3);
  constexpr int kBias = 128, kLargestExponent = 127;
  SharedExponentImage encoded{image.width, image.height, {}, {}};
  const std::size_t num_pixels = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  encoded.mantissas.reserve(3 * num_pixels);
  encoded.exponents.reserve(num_pixels);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      std::array<float, 3> rgb{};
      for (std::size_t c = 0; c < 3; ++c) {
        const float value = image.channels[c].at(x, y);
        rgb[c] = std::isfinite(value) ? std::max(value, 0.f) : 0.f;
      }
      int exponent = 0;
      std::frexp(*std::max_element(rgb.begin(), rgb.end()), &exponent);
      const bool is_black = exponent <= -kBias || rgb == std::array<float, 3>{};
      exponent = std::min(exponent, kLargestExponent);
      for (const float value : rgb) {
        const float mantissa = is_black ? 0.f : std::ldexp(value, 8 - exponent);
        encoded.mantissas.push_back(static_cast<std::uint8_t>(std::min(mantissa, 255.f)));
      }
      encoded.exponents.push_back(static_cast<std::uint8_t>(is_black ? 0 : exponent + kBias));
    }
  }
  return encoded;
}

}  // namespace relief
