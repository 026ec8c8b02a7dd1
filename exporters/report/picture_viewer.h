// A picture whose exposure people choose, and a wipe between it and another one.
#pragma once

#include <string>

#include "exporters/picture.h"

namespace relief {

struct ViewedPicture {
  ImageView image;   ///< red, green and blue first, linear; no channels: there is none
  std::string name;  ///< shown in its corner
};

/// Where the pictures lie in the whole one, and how they are shown first.
struct ViewerOptions {
  int crop_x = 0, crop_y = 0;
  double exposure = 0;  ///< stops
};

/// The viewer with its pixels: all that the page needs for it, once.
/// @pre `second` has no channels, or is as large as `first`
std::string html_picture_viewer(const ViewedPicture& first, const ViewedPicture& second, const ViewerOptions& options);

}  // namespace relief
