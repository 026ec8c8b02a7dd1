// A picture of where and how two pictures differ, for people.
#pragma once

#include <filesystem>

#include "exporters/picture.h"

namespace relief {

/// Writes a PNG with three panels side by side: a, b (both through the sRGB curve), and a − b averaged over the channels: blue
/// where a is darker, white where they agree, red where a is brighter, green where a value is not finite. A bar below the third
/// panel carries its scale, with numbers at both ends.
/// @param exposure  stops by which a and b are brightened; the difference is not
/// @pre equal sizes and numbers of channels, at least one channel
/// @return the value that full red stands for; its negative is full blue
/// @error OutputError
/// @source the scale is the 99.5th percentile of |a − b|, rounded up to 1, 2 or 5 times a power of ten: outliers saturate
///         instead of hiding everything else
double difference_picture_write(const std::filesystem::path& path,
                                const ImageView& a,
                                const ImageView& b,
                                double exposure = 0);

}  // namespace relief
