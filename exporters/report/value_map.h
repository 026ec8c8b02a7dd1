// Maps of one number a pixel, with a legend.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "exporters/picture.h"

namespace relief {

/// One number a pixel, rows from the top.
struct ValueImage {
  int width = 0, height = 0;
  std::vector<float> values;
};

/// One channel of a picture. @pre channel < image.channels.size()
ValueImage value_image_of(const ImageView& image, std::size_t channel);

/// Means over squares of pixels, as large as it takes for no side to be longer than `most`.
/// @param factor  gets the squares' side
ValueImage value_image_reduced(const ValueImage& image, int most, int* factor);

/// From values to 0…1 along a map's colours.
struct ValueScale {
  double low = 0, high = 1;
  bool log = false;

  double at(double value) const;
  /// Round numbers along it.
  std::vector<double> ticks() const;
};

/// A scale for all but the extreme values, which get the colours at its ends: from the 1st percentile to the 99.8th if
/// logarithmic, otherwise from 0 to the largest.
/// @return of equal values, and of none above 0 if logarithmic: one in which they have a place
ValueScale value_scale_make(const std::vector<float>& values, bool log);

/// A figure: the map, in which a colour means what the legend below says, with the values' mean and largest.
/// @param unit  of the values; empty: none
std::string html_value_map(std::string_view title,
                           std::string_view meaning,
                           const ValueImage& image,
                           bool log,
                           std::string_view unit);

}  // namespace relief
