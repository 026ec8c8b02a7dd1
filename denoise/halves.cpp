#include "denoise/halves.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <functional>

namespace relief {

namespace {

float luminance_at(const ColorPlanes& planes, int x, int y)
{
  return 0.2126f * planes[0].row(y)[x] + 0.7152f * planes[1].row(y)[x] + 0.0722f * planes[2].row(y)[x];
}

Plane luminance_plane(const ColorPlanes& planes)
{
  Plane to(planes[0].width(), planes[0].height());
  tbb::parallel_for(0, to.height(), [&](int y) {
    for (int x = 0; x < to.width(); ++x) to.row(y)[x] = luminance_at(planes, x, y);
  });
  return to;
}

/// The fourth-largest value of the 5×5 pixels around one, without its own: as bright as a line of one pixel's width.
float bright_neighbour(const Plane& plane, int x, int y)
{
  std::array<float, 24> around;
  std::size_t count = 0;
  for (int dy = -2; dy <= 2; ++dy) {
    for (int dx = -2; dx <= 2; ++dx) {
      if (dx != 0 || dy != 0) around[count++] = plane.row(y + dy)[x + dx];
    }
  }
  std::nth_element(around.begin(), around.begin() + 3, around.end(), std::greater<>());
  return around[3];
}

/// Marks the fireflies of one half.
/// @param own, other  luminances of both halves
/// @return            1 for a firefly, with the border of the edge's values
Plane fireflies_of(const Plane& own, const Plane& other)
{
  // Far above: four times what is bright around; and so rare that less than one value in 30 is like it, which is what
  // tells a firefly from the noise of a light that is seldom found.
  constexpr float kAbove = 4, kAboveMean = 30;
  constexpr int kReach = 8;
  const int width = own.width(), height = own.height();
  Plane mean(width, height);
  tbb::parallel_for(0, height, [&](int y) {
    for (int x = 0; x < width; ++x) mean.row(y)[x] = own.row(y)[x] + other.row(y)[x];
  });
  box_filter(mean, kReach);
  Plane marks(width, height);
  tbb::parallel_for(0, height, [&](int y) {
    for (int x = 0; x < width; ++x) {
      const float value = own.row(y)[x];
      const auto side = [](int at, int size) { return std::min(at + kReach, size - 1) - std::max(at - kReach, 0) + 1; };
      const auto num_values = static_cast<float>(2 * side(x, width) * side(y, height));
      const float mean_of_others = (0.5f * mean.row(y)[x] * num_values - value) / (num_values - 1);
      if (!(value > kAboveMean * mean_of_others) || !(value > kAbove * other.row(y)[x])) continue;
      if (!(value > kAbove * std::max(bright_neighbour(own, x, y), bright_neighbour(other, x, y)))) continue;
      marks.row(y)[x] = 1;
    }
  });
  marks.extend();
  return marks;
}

/// Mean of the 5×5 pixels that are not marked; the pixel's own value if all are.
float mean_of_unmarked(const Plane& plane, const Plane& marks, int x, int y)
{
  float sum = 0, count = 0;
  for (int dy = -2; dy <= 2; ++dy) {
    for (int dx = -2; dx <= 2; ++dx) {
      const int at_x = std::clamp(x + dx, 0, plane.width() - 1), at_y = std::clamp(y + dy, 0, plane.height() - 1);
      if (marks.row(at_y)[at_x] > 0) continue;
      sum += plane.row(at_y)[at_x];
      count += 1;
    }
  }
  return count > 0 ? sum / count : plane.row(y)[x];
}

}  // namespace

ColorPlanes color_planes(int width, int height)
{
  return {Plane(width, height), Plane(width, height), Plane(width, height)};
}

Halves::Halves(int width, int height)
    : color{color_planes(width, height), color_planes(width, height)},
      variance(color_planes(width, height)),
      even_share(width, height),
      is_known(width, height),
      lost(color_planes(width, height)),
      independent(color_planes(width, height))
{
  for (Plane& plane : independent) {
    for_pixels(plane, [&](int x, int y) { plane.row(y)[x] = 1; });
  }
}

Halves halves_make(const DenoiseInput& input)
{
  Halves halves(input.width, input.height);
  tbb::parallel_for(0, input.height, [&](int y) {
    for (int x = 0; x < input.width; ++x) {
      const float even_share = even_share_of(input.samples.at(x, y));
      bool is_known = even_share < 1;
      for (std::size_t c = 0; c < 3; ++c) {
        const float mean = input.beauty[c].at(x, y), even = input.half[c].at(x, y),
                    variance = input.variance[c].at(x, y);
        // Of numbers as large as there are the other half may be none.
        const float odd = (mean - even_share * even) / (1.0f - even_share);
        is_known =
            is_known && std::isfinite(mean) && std::isfinite(even) && std::isfinite(odd) && std::isfinite(variance);
        halves.color[0][c].row(y)[x] = even;
        halves.color[1][c].row(y)[x] = odd;
        halves.variance[c].row(y)[x] = std::max(variance, 0.0f);
      }
      halves.even_share.row(y)[x] = even_share;
      halves.is_known.row(y)[x] = is_known ? 1.0f : 0.0f;
      if (is_known) continue;
      for (std::size_t c = 0; c < 3; ++c) {
        const float mean = input.beauty[c].at(x, y);
        for (ColorPlanes& half : halves.color) half[c].row(y)[x] = std::isfinite(mean) ? mean : 0.0f;
        halves.variance[c].row(y)[x] = 0;
      }
    }
  });
  return halves;
}

void replace_fireflies(Halves& halves)
{
  const Plane luminances[2] = {luminance_plane(halves.color[0]), luminance_plane(halves.color[1])};
  const Plane marks[2] = {fireflies_of(luminances[0], luminances[1]), fireflies_of(luminances[1], luminances[0])};
  const int width = halves.is_known.width(), height = halves.is_known.height();
  // Neighbours are not marked, so their values stay as they are read.
  tbb::parallel_for(0, height, [&](int y) {
    for (int x = 0; x < width; ++x) {
      for (std::size_t half = 0; half < 2; ++half) {
        if (!(marks[half].row(y)[x] > 0)) continue;
        const float share = half == 0 ? halves.even_share.row(y)[x] : 1.0f - halves.even_share.row(y)[x];
        for (std::size_t c = 0; c < 3; ++c) {
          float& value = halves.color[half][c].row(y)[x];
          const float replaced = mean_of_unmarked(halves.color[half][c], marks[half], x, y);
          halves.lost[c].row(y)[x] += share * (value - replaced);
          value = replaced;
        }
      }
    }
  });
  Plane any(width, height);
  tbb::parallel_for(0, height, [&](int y) {
    for (int x = 0; x < width; ++x) any.row(y)[x] = std::max(marks[0].row(y)[x], marks[1].row(y)[x]);
  });
  for (Plane& variance : halves.variance) {
    tbb::parallel_for(0, height, [&](int y) {
      for (int x = 0; x < width; ++x) {
        if (any.row(y)[x] > 0) variance.row(y)[x] = mean_of_unmarked(variance, any, x, y);
      }
    });
  }
}

void find_independent_parts(Halves& halves)
{
  // As far as light and its noise are of one kind; a tenth is what smooth light and many samples come to. More than all is
  // chance, which cut off at 1 would leave a mean that is too low.
  constexpr int kReach = 8;
  constexpr float kLeast = 0.1f, kMost = 2;
  for (std::size_t c = 0; c < 3; ++c) {
    Plane& part = halves.independent[c];
    Plane variance(part.width(), part.height()), of_halves(part.width(), part.height());
    for_pixels(part, [&](int x, int y) {
      const float even = halves.even_share.row(y)[x];
      const float noise = halves.color[0][c].row(y)[x] - halves.color[1][c].row(y)[x];
      variance.row(y)[x] = halves.variance[c].row(y)[x];
      of_halves.row(y)[x] = even * (1.0f - even) * noise * noise;
    });
    box_filter(variance, kReach);
    box_filter(of_halves, kReach);
    for_pixels(part, [&](int x, int y) {
      const float whole = of_halves.row(y)[x];
      part.row(y)[x] = whole > 0 ? std::clamp(variance.row(y)[x] / whole, kLeast, kMost) : 1.0f;
    });
  }
}

}  // namespace relief
