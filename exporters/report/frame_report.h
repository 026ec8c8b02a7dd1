// The page about one rendered frame: its picture, its error, and what it cost.
#pragma once

#include <string>

#include "exporters/picture.h"

namespace relief {

/// What a report is made of. Layers without channels are not there, and the page goes without them.
struct FrameReport {
  std::string name;             ///< of the picture
  ImageView beauty;             ///< red, green and blue first, linear
  ImageView variance, samples;  ///< those layers
  ImageView steps;              ///< the layer displacement_steps
  ImageView reference;          ///< as large as the beauty
  int crop_x = 0, crop_y = 0;   ///< where all of them lie in the whole picture
  Attributes attributes;        ///< of the picture's file
  std::string statistics;       ///< text of the render's `--stats`; empty: there is none
  std::string statistics_file;  ///< its name, for messages
};

/// Views of a picture's layers, as a report wants them. @error InputError: no red, green and blue
FrameReport frame_report_of(const Picture& picture);

/// The whole page.
/// @error InputError: what should be statistics is something else
std::string frame_report_html(const FrameReport& report);

}  // namespace relief
