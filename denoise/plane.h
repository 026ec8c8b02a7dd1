// Planes that own their values, with a border of copies of the nearest pixels: filters read past the edge without asking.
#pragma once

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstddef>
#include <vector>

namespace relief {

class Plane {
 public:
  /// A border on the left and above; on the right and below there is a tile's side more, as the last tile may be cut.
  static constexpr int kBorder = 24, kFarBorder = kBorder + 32;

  Plane(int width, int height)
      : width_(width),
        height_(height),
        stride_(width + kBorder + kFarBorder),
        values_(static_cast<std::size_t>(stride_) * static_cast<std::size_t>(height + kBorder + kFarBorder))
  {
  }

  int width() const { return width_; }
  int height() const { return height_; }
  std::ptrdiff_t stride() const { return stride_; }
  /// Pixels of a row from x = 0 on. @param y  −kBorder … height + kFarBorder − 1
  float* row(int y) { return values_.data() + (y + kBorder) * stride_ + kBorder; }
  const float* row(int y) const { return values_.data() + (y + kBorder) * stride_ + kBorder; }

  /// Fills the border from the pixels.
  void extend()
  {
    for (int y = 0; y < height_; ++y) {
      std::fill_n(row(y) - kBorder, kBorder, row(y)[0]);
      std::fill_n(row(y) + width_, kFarBorder, row(y)[width_ - 1]);
    }
    for (int y = -kBorder; y < height_ + kFarBorder; ++y) {
      if (y < 0 || y >= height_) std::copy_n(row(y < 0 ? 0 : height_ - 1) - kBorder, stride_, row(y) - kBorder);
    }
  }

 private:
  int width_, height_;
  std::ptrdiff_t stride_;
  std::vector<float> values_;
};

/// Calls body(x, y) for all pixels, rows side by side.
template <class Body>
void for_pixels(const Plane& like, const Body& body)
{
  tbb::parallel_for(0, like.height(), [&](int y) {
    for (int x = 0; x < like.width(); ++x) body(x, y);
  });
}

/// Mean over squares of (2·reach + 1)² pixels, cut at the picture's edge. In place.
void box_filter(Plane& plane, int reach);

}  // namespace relief
