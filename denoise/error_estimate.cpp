#include "denoise/error_estimate.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace relief {

namespace {

/// What a picture is off by, one channel: its residual, and how the halves and their filtered forms differ.
struct Residual {
  Residual(int width, int height) : off(width, height), noise(width, height), noise_left(width, height) {}
  Plane off, noise, noise_left;
};

Residual residual_of(const Halves& halves, const Candidate& picture, std::size_t c)
{
  Residual to(halves.is_known.width(), halves.is_known.height());
  for_pixels(to.off, [&](int x, int y) {
    if (!(halves.is_known.row(y)[x] > 0)) return;
    const float even = halves.even_share.row(y)[x], scale = std::sqrt(even * (1.0f - even));
    to.off.row(y)[x] = picture.color[c].row(y)[x] - halves.mean(c, x, y);
    to.noise.row(y)[x] = scale * (halves.color[0][c].row(y)[x] - halves.color[1][c].row(y)[x]);
    to.noise_left.row(y)[x] = scale * picture.difference[c].row(y)[x];
  });
  return to;
}

/// The direction in which a picture changes least at a pixel, as the offset of a pixel that lies there.
struct Direction {
  int x, y;
};

Direction direction_along(const ColorPlanes& color, int x, int y)
{
  const auto at = [&](int dx, int dy) {
    const int at_x = std::clamp(x + dx, 0, color[0].width() - 1), at_y = std::clamp(y + dy, 0, color[0].height() - 1);
    return color[0].row(at_y)[at_x] + color[1].row(at_y)[at_x] + color[2].row(at_y)[at_x];
  };
  // Sobel's derivatives; along an edge is across them.
  const float across = 2 * (at(1, 0) - at(-1, 0)) + at(1, 1) - at(-1, 1) + at(1, -1) - at(-1, -1);
  const float down = 2 * (at(0, 1) - at(0, -1)) + at(1, 1) - at(1, -1) + at(-1, 1) - at(-1, -1);
  const float along_x = std::abs(down), along_y = std::abs(across);
  // Between 0, 26.6 and 45 degrees.
  constexpr float kFlat = 0.236f, kSteep = 0.721f;
  const float least = std::min(along_x, along_y), most = std::max(along_x, along_y);
  const int longer = least > kFlat * most && least <= kSteep * most ? 2 : 1, shorter = least > kFlat * most ? 1 : 0;
  const int sign = (down > 0) == (across > 0) ? -1 : 1;
  return along_x >= along_y ? Direction{longer, sign * shorter} : Direction{shorter, sign * longer};
}

/// Product of the systematic errors of a pixel and of those beside it, by chance far from the truth. An edge that is blurred
/// is too bright on one side and too dark on the other; so neighbours along it are taken.
float bias_product(const Residual& residual, Direction along, int x, int y)
{
  const int width = residual.off.width(), height = residual.off.height();
  float sum = 0, count = 0;
  const auto add = [&](int other_x, int other_y) {
    if (other_x < 0 || other_y < 0 || other_x >= width || other_y >= height) return;
    const auto here = [&](const Plane& plane) { return plane.row(y)[x]; };
    const auto there = [&](const Plane& plane) { return plane.row(other_y)[other_x]; };
    sum += here(residual.off) * there(residual.off) + here(residual.noise) * there(residual.noise_left) +
           there(residual.noise) * here(residual.noise_left) - here(residual.noise_left) * there(residual.noise_left);
    count += 1;
  };
  add(x - along.x, y - along.y);
  add(x + along.x, y + along.y);
  return count > 0 ? sum / count : 0.0f;
}

double sum_of(const Plane& plane)
{
  double sum = 0;
  for (int y = 0; y < plane.height(); ++y) {
    for (int x = 0; x < plane.width(); ++x) sum += static_cast<double>(plane.row(y)[x]);
  }
  return sum;
}

/// A mean that is known with a variance, less what chance makes of nothing: what is no more than that is none.
double significant(double mean, double variance, double num_variances = 2)
{
  return mean > 0 ? std::max(mean - num_variances * variance / mean, 0.0) : 0.0;
}

}  // namespace

void error_estimate(Halves& halves, const Candidate& picture, DenoiseResult& result)
{
  constexpr int kReach = 5, kLostReach = 8;
  // Pixels with the weight of one in two averages over 2·kReach + 1; pairs of pixels are counted twice.
  constexpr double kNumAveraged = 272, kNumPairs = 0.5;
  const int width = halves.is_known.width(), height = halves.is_known.height();
  const auto num_pixels = static_cast<double>(width) * height;
  result.error.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * 3);
  double total = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    box_filter(halves.lost[c], kLostReach);
    const Residual residual = residual_of(halves, picture, c);
    Plane noise(width, height), bias(width, height), bias_square(width, height), scale(width, height);
    Plane excess(width, height), excess_square(width, height);
    for_pixels(noise, [&](int x, int y) {
      const float left = residual.noise_left.row(y)[x], lost = halves.lost[c].row(y)[x];
      const float independent = halves.independent[c].row(y)[x] * left * left;
      noise.row(y)[x] = independent + lost * lost;
      excess.row(y)[x] = gain_of(halves, picture, c, x, y).error(1) - independent;
      excess_square.row(y)[x] = excess.row(y)[x] * excess.row(y)[x];
      bias.row(y)[x] = bias_product(residual, direction_along(picture.color, x, y), x, y);
      bias_square.row(y)[x] = bias.row(y)[x] * bias.row(y)[x];
      scale.row(y)[x] = halves.variance[c].row(y)[x];
    });
    // What the filter does wrong, known in two ways. The second knows of detail of one pixel's size, but rests on variances,
    // so it has to be twice as sure.
    const double blurred = significant(sum_of(bias), sum_of(bias_square) / kNumPairs);
    const double sum = sum_of(noise) + std::max(blurred, significant(sum_of(excess), sum_of(excess_square), 4));
    total += sum;
    // Errors stay where noise is: parts of it are averaged.
    box_filter(scale, 1);
    const auto floor = static_cast<float>(0.01 * sum_of(scale) / num_pixels + 1e-30);
    for_pixels(scale, [&](int x, int y) {
      scale.row(y)[x] += floor;
      noise.row(y)[x] /= scale.row(y)[x];
      bias.row(y)[x] /= scale.row(y)[x];
      bias_square.row(y)[x] = bias.row(y)[x] * bias.row(y)[x];
    });
    for (Plane* plane : {&noise, &bias, &bias_square}) {
      box_filter(*plane, kReach);
      box_filter(*plane, kReach);
    }
    Plane& error = noise;
    for_pixels(error, [&](int x, int y) {
      const double variance = static_cast<double>(bias_square.row(y)[x]) / (kNumPairs * kNumAveraged);
      const double known = significant(static_cast<double>(bias.row(y)[x]), variance);
      error.row(y)[x] = (error.row(y)[x] + static_cast<float>(known)) * scale.row(y)[x];
    });
    const double shape = sum_of(error), factor = shape > 0 ? sum / shape : 0;
    for_pixels(error, [&](int x, int y) {
      const double squared = factor * static_cast<double>(error.row(y)[x]);
      const std::size_t pixel =
          static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
      // Of one sample nothing is known: all of it may be wrong.
      const bool is_known = halves.is_known.row(y)[x] > 0;
      result.error[3 * pixel + c] =
          is_known ? static_cast<float>(std::sqrt(squared)) : std::abs(picture.color[c].row(y)[x]);
    });
  }
  const bool all_known = sum_of(halves.is_known) >= num_pixels;
  result.rmse = all_known ? std::sqrt(total / (3 * num_pixels)) : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace relief
