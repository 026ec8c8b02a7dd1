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

/// The direction in which a picture changes least at a pixel: of its neighbours one that lies there.
struct Direction {
  int x, y;
};

Direction direction_along(const ColorPlanes& color, int x, int y)
{
  const auto at = [&](int dx, int dy) {
    const int at_x = std::clamp(x + dx, 0, color[0].width() - 1), at_y = std::clamp(y + dy, 0, color[0].height() - 1);
    return color[0].row(at_y)[at_x] + color[1].row(at_y)[at_x] + color[2].row(at_y)[at_x];
  };
  const auto change = [&](int dx, int dy) { return std::abs(at(dx, dy) - at(-dx, -dy)); };
  // Sobel's derivatives in all four directions; diagonal neighbours are further away.
  constexpr float kDiagonal = 0.70710678f;
  const float across = 2 * change(1, 0) + change(1, 1) + change(1, -1),
              down = 2 * change(0, 1) + change(1, 1) + change(-1, 1);
  const float falling = kDiagonal * (2 * change(1, 1)) + change(1, 0) + change(0, 1),
              rising = kDiagonal * (2 * change(1, -1)) + change(1, 0) + change(0, 1);
  const float least = std::min({across, down, falling, rising});
  if (across == least) return {1, 0};
  if (down == least) return {0, 1};
  return falling == least ? Direction{1, 1} : Direction{1, -1};
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

/// Part of the difference of halves that is the picture's noise; the rest is what each lacks of the other, as parts of one
/// point set complete each other.
float independent_part(const Halves& halves, std::size_t c)
{
  double variance = 0, of_halves = 0;
  for (int y = 0; y < halves.is_known.height(); ++y) {
    for (int x = 0; x < halves.is_known.width(); ++x) {
      const float even = halves.even_share.row(y)[x];
      const float noise = halves.color[0][c].row(y)[x] - halves.color[1][c].row(y)[x];
      variance += static_cast<double>(halves.variance[c].row(y)[x]);
      of_halves += static_cast<double>(even * (1.0f - even) * noise * noise);
    }
  }
  return of_halves > 0 ? static_cast<float>(std::clamp(variance / of_halves, 0.5, 1.0)) : 1.0f;
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
double significant(double mean, double variance)
{
  constexpr double kVariances = 2;
  return mean > 0 ? std::max(mean - kVariances * variance / mean, 0.0) : 0.0;
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
    const float part = independent_part(halves, c);
    Plane noise(width, height), bias(width, height), bias_square(width, height), scale(width, height);
    for_pixels(noise, [&](int x, int y) {
      const float left = residual.noise_left.row(y)[x], lost = halves.lost[c].row(y)[x];
      noise.row(y)[x] = part * left * left + lost * lost;
      bias.row(y)[x] = bias_product(residual, direction_along(picture.color, x, y), x, y);
      bias_square.row(y)[x] = bias.row(y)[x] * bias.row(y)[x];
      scale.row(y)[x] = halves.variance[c].row(y)[x];
    });
    const double sum = sum_of(noise) + significant(sum_of(bias), sum_of(bias_square) / kNumPairs);
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
