// Colours for numbers, which people with any kind of colour vision can put in order.
#pragma once

#include <array>
#include <cstdint>

namespace relief {

/// From dark violet over blue, teal and green to light yellow; perceived lightness rises in proportion to t.
/// @param t  0…1; beyond, the ends. NaN is grey, which is not on the way
/// @return   sRGB codes
/// @source   Ottosson 2020, "A perceptual color space for image processing" (Oklab): lightness and hue are linear in t, chroma
///           is as much as sRGB has there, up to a bound
std::array<std::uint8_t, 3> color_map(double t);

}  // namespace relief
