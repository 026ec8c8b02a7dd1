// How much of a picture is lost above the brightest that its view shows.
#pragma once

#include "exporters/png_ocio.h"

namespace relief {

struct Clipping {
  double fraction = 0;  ///< of the pixels with geometry, those that are white
  double exposure = 0;  ///< stops at which the median of the pixels with geometry would be middle grey, 18 %
};

/// Looks at some 65,000 pixels of a picture, evenly spread.
/// @param image     R, G, B and coverage, linear
/// @param exposure  stops, as PngOptions::exposure
/// @return          fraction 0 if no pixel shows geometry
Clipping picture_clipping(const ImageView& image, const ColorView& view, double exposure);

}  // namespace relief
