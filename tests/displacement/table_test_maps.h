// Small maps for tests of tables over a height field, and the range of heights by looking at every texel.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "displacement/height_field.h"

namespace relief {

/// Random heights, most of them alike, so that extremes are rare and a window that misses one is noticed.
struct TableTestMap {
  std::vector<std::uint16_t> texels;
  HeightMapView view;

  TableTestMap(int width, int height, Wrap wrap_u, Wrap wrap_v, std::uint64_t seed)
  {
    std::mt19937_64 random(seed);
    for (int k = 0; k < width * height; ++k) {
      const auto value = static_cast<std::uint16_t>(random());
      texels.push_back(random() % 4 == 0 ? value : static_cast<std::uint16_t>(30000 + value % 64));
    }
    view = {texels.data(), width, height, HeightFormat::kU16, wrap_u, wrap_v};
  }

  static int wrapped(std::int64_t i, int n, Wrap wrap)
  {
    if (wrap == Wrap::kClamp) return static_cast<int>(std::clamp<std::int64_t>(i, 0, n - 1));
    const int period = wrap == Wrap::kMirror ? 2 * n : n;
    while (i < 0) i += period;
    while (i >= period) i -= period;
    return static_cast<int>(i < n ? i : 2 * n - 1 - i);
  }

  /// Of the cells [i0, i1) × [j0, j1).
  StoredRange range(std::int64_t i0, std::int64_t j0, std::int64_t i1, std::int64_t j1) const
  {
    StoredRange result{65535, 0};
    for (std::int64_t j = j0; j <= j1; ++j) {
      for (std::int64_t i = i0; i <= i1; ++i) {
        const auto at = wrapped(j, view.height, view.wrap_v) * view.width + wrapped(i, view.width, view.wrap_u);
        const std::uint16_t h = texels[static_cast<std::size_t>(at)];
        result = {std::min(result.low, h), std::max(result.high, h)};
      }
    }
    return result;
  }
};

inline constexpr Wrap kAllWraps[] = {Wrap::kRepeat, Wrap::kMirror, Wrap::kClamp};
inline constexpr int kTableTestSizes[][2] = {{1, 1}, {1, 5}, {7, 1}, {2, 2}, {3, 5}, {8, 8}, {17, 4}, {13, 9}};

}  // namespace relief
