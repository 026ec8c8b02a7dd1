// Linear colours in four bytes, for pages that let people choose the exposure.
#pragma once

#include <cstdint>
#include <vector>

#include "exporters/picture.h"

namespace relief {

/// A pixel's colour is (mantissa + ½) · 2^(exponent − 136), and black where the exponent is 0: within 0.4 % of its largest
/// channel.
/// @source Ward 1991, "Real Pixels"
struct SharedExponentImage {
  int width = 0, height = 0;
  std::vector<std::uint8_t> mantissas;  ///< red, green, blue
  std::vector<std::uint8_t> exponents;  ///< one a pixel
};

/// @param image  red, green and blue first; what is negative or not finite becomes 0
/// @pre   three channels or more
SharedExponentImage shared_exponent_encode(const ImageView& image);

}  // namespace relief
