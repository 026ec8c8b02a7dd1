#include "displacement/height_source.h"

#include <algorithm>
#include <cmath>

namespace relief {

void height_slopes(const HeightSource& source,
                   std::uint32_t triangle,
                   const Vec2f* at,
                   int count,
                   Vec2f du,
                   Vec2f dv,
                   HeightSlopes* out)
{
  if (source.slopes != nullptr) {
    source.slopes(source.owner, triangle, at, count, du, dv, out);
    return;
  }
  // Two points at a time, with four around each.
  for (int first = 0; first < count; first += 2) {
    float b[3][8], h[8];
    for (int lane = 0; lane < 8; ++lane) {
      const Vec2f step = lane % 4 < 2 ? du : dv;
      const Vec2f w = at[std::min(first + lane / 4, count - 1)] + (lane % 2 == 0 ? -1.0f : 1.0f) * step;
      b[0][lane] = 1.0f - w.x - w.y;
      b[1][lane] = w.x;
      b[2][lane] = w.y;
    }
    source.eval(source.owner, triangle, b, h);
    const auto slope = [&](int lane) {
      const float change = 0.5f * (h[lane + 1] - h[lane]);
      return std::isfinite(change) ? change : 0.0f;
    };
    for (int k = 0; k < std::min(2, count - first); ++k) out[first + k] = {slope(4 * k), slope(4 * k + 2)};
  }
}

}  // namespace relief
