// How far one picture is from another: plain error measures of linear values. The perceptual one is in flip.h, the
// statistical one in z_test.h; metrics_json joins all three.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "exporters/picture.h"
#include "exporters/z_test.h"

namespace relief {

/// Errors of a picture a against a reference b; means are over all pixels and channels.
struct ImageErrors {
  double rmse = 0;            ///< √ mean (a − b)²
  double mae = 0;             ///< mean |a − b|
  double relmse = 0;          ///< mean (a − b)² / (b² + 0.01)
  double psnr = 0;            ///< 10·log10(1 / mean (a − b)²) dB, for a peak of 1; +∞ for equal pictures
  double bias = 0;            ///< mean a − b
  double max_difference = 0;  ///< largest |a − b|
  int max_x = 0, max_y = 0;   ///< where it is, in the stored window
  std::string max_channel;
  std::uint64_t num_values = 0;     ///< values compared
  std::uint64_t num_nonfinite = 0;  ///< values left out because one side is NaN or infinite
};

/// Compares two views. All sums are in double precision.
/// @pre equal sizes and numbers of channels; @return all zero, except num_nonfinite, if no value could be compared
ImageErrors image_errors(const ImageView& a, const ImageView& reference);

/// What `relief compare --json` writes: one indented object. Numbers that are not finite become null.
/// @param flip_mean  absent if the layer has no colours
std::string metrics_json(std::string_view file_a,
                         std::string_view file_b,
                         const ImageErrors& errors,
                         const std::optional<double>& flip_mean,
                         const std::optional<ZTestResult>& z_test);

}  // namespace relief
