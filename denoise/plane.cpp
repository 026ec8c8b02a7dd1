#include "denoise/plane.h"

namespace relief {

void box_filter(Plane& plane, int reach)
{
  const int width = plane.width(), height = plane.height();
  Plane across(width, height);
  tbb::parallel_for(0, height, [&](int y) {
    const float* from = plane.row(y);
    for (int x = 0; x < width; ++x) {
      const int x0 = std::max(x - reach, 0), x1 = std::min(x + reach, width - 1);
      float sum = 0;
      for (int i = x0; i <= x1; ++i) sum += from[i];
      across.row(y)[x] = sum / static_cast<float>(x1 - x0 + 1);
    }
  });
  tbb::parallel_for(0, height, [&](int y) {
    const int y0 = std::max(y - reach, 0), y1 = std::min(y + reach, height - 1);
    float* to = plane.row(y);
    std::fill_n(to, width, 0.0f);
    for (int i = y0; i <= y1; ++i) {
      const float* from = across.row(i);
      for (int x = 0; x < width; ++x) to[x] += from[x];
    }
    const float scale = 1.0f / static_cast<float>(y1 - y0 + 1);
    for (int x = 0; x < width; ++x) to[x] *= scale;
  });
}

}  // namespace relief
