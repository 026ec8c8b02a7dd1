// PNG files in memory.
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace relief {

/// A PNG file of sRGB codes as they are; alpha is not associated with the colours, as PNG wants it.
/// @param codes  rows from the top, 1 to 4 codes a pixel: grey, grey and alpha, RGB or RGBA
/// @pre   width, height >= 0; as many codes for every pixel
/// @error OutputError, of a file called "PNG": no pixels, more than libpng takes (a million a side), or out of memory
/// @{
std::string png_encode(int width, int height, std::span<const std::uint8_t> codes);
std::string png_encode(int width, int height, std::span<const std::uint16_t> codes);
/// @}

}  // namespace relief
