#include "exporters/image_metrics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "kernel/assert.h"

namespace relief {

ImageErrors image_errors(const ImageView& a, const ImageView& reference)
{
  RELIEF_ASSERT(a.width == reference.width && a.height == reference.height);
  RELIEF_ASSERT(a.channels.size() == reference.channels.size());
  ImageErrors errors;
  double sum = 0, sum_absolute = 0, sum_square = 0, sum_relative = 0;
  for (std::size_t c = 0; c < a.channels.size(); ++c) {
    for (int y = 0; y < a.height; ++y) {
      for (int x = 0; x < a.width; ++x) {
        const double value = double{a.channels[c].at(x, y)}, expected = double{reference.channels[c].at(x, y)};
        const double difference = value - expected;
        if (!std::isfinite(difference)) {
          ++errors.num_nonfinite;
          continue;
        }
        ++errors.num_values;
        sum += difference;
        sum_absolute += std::abs(difference);
        sum_square += difference * difference;
        sum_relative += difference * difference / (expected * expected + 0.01);
        if (std::abs(difference) > errors.max_difference) {
          errors.max_difference = std::abs(difference);
          errors.max_x = x;
          errors.max_y = y;
          errors.max_channel = a.channels[c].name;
        }
      }
    }
  }
  if (errors.num_values == 0) return errors;
  const double n = static_cast<double>(errors.num_values);
  errors.bias = sum / n;
  errors.mae = sum_absolute / n;
  errors.rmse = std::sqrt(sum_square / n);
  errors.relmse = sum_relative / n;
  errors.psnr = -10 * std::log10(sum_square / n);  // +∞ for 0
  return errors;
}

std::string metrics_json(std::string_view file_a,
                         std::string_view file_b,
                         const ImageErrors& errors,
                         const std::optional<double>& flip_mean,
                         const std::optional<ZTestResult>& z_test)
{
  nlohmann::ordered_json json = {
      {"a", file_a},
      {"b", file_b},
      {"rmse", errors.rmse},
      {"relmse", errors.relmse},
      {"psnr", errors.psnr},
      {"mae", errors.mae},
      {"bias", errors.bias},
      {"max_difference", errors.max_difference},
      {"max_at", {errors.max_x, errors.max_y}},
      {"max_channel", errors.max_channel},
      {"values", errors.num_values},
      {"nonfinite", errors.num_nonfinite},
  };
  if (flip_mean) json["flip"] = *flip_mean;
  if (z_test) {
    const ZTestResult& z = *z_test;
    json["z_test"] = {
        {"passed", z.passed},
        {"p", z.p},
        {"significance", z.significance},
        {"pixel_p", z.pixel_p},
        {"block_p", z.block_p},
        {"mean_p", z.mean_p},
        {"chi2_p", z.chi2_p},
        {"largest_pixel_z", z.largest_pixel.z},
        {"largest_pixel_at", {z.largest_pixel.x, z.largest_pixel.y}},
        {"largest_block_z", z.largest_block.z},
        {"largest_block_at", {z.largest_block.x, z.largest_block.y}},
        {"largest_mean_z", z.largest_mean.z},
        {"tests", z.num_tests},
        {"certain_differences", z.num_certain},
        {"nonfinite", z.num_nonfinite},
    };
  }
  return json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

}  // namespace relief
