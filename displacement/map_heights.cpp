#include "displacement/map_heights.h"

#include <algorithm>
#include <cmath>

namespace relief {

namespace {

/// Lattice coordinates of a triangle's vertices in the map.
struct OnMap {
  double x[3], y[3];

  OnMap(const MapHeights& heights, std::uint32_t triangle)
  {
    const MeshView& mesh = *heights.mesh;
    const TextureRef& m = heights.mapping;
    const TriangleIndices& v = mesh.triangles[triangle];
    const std::uint32_t vertices[3] = {v.v0, v.v1, v.v2};
    for (int k = 0; k < 3; ++k) {
      const Vec2f t = mesh.uv[m.uv_set] != nullptr ? mesh.uv[m.uv_set][vertices[k]] : Vec2f{};
      const double u = static_cast<double>(m.m00) * t.x + static_cast<double>(m.m01) * t.y + m.m02;
      const double w = static_cast<double>(m.m10) * t.x + static_cast<double>(m.m11) * t.y + m.m12;
      x[k] = u * heights.field->map.width - 0.5;
      y[k] = w * heights.field->map.height - 0.5;
      // As DisplacedMesh has it: these are of no use, and 64-bit integers must not overflow.
      constexpr double kMost = 0x1p44;
      if (std::abs(x[k]) <= kMost && std::abs(y[k]) <= kMost) continue;
      std::fill(x, x + 3, -0.5);
      std::fill(y, y + 3, -0.5);
      return;
    }
  }
};

void eval(const void* owner, std::uint32_t triangle, const float (*b)[8], float* h)
{
  const auto& heights = *static_cast<const MapHeights*>(owner);
  const OnMap on(heights, triangle);
  for (int lane = 0; lane < 8; ++lane) {
    const auto at = [&](const double* x) { return b[0][lane] * x[0] + b[1][lane] * x[1] + b[2][lane] * x[2]; };
    h[lane] = static_cast<float>(interpolate_height(*heights.field, at(on.x), at(on.y)));
  }
}

void bounds(const void* owner, std::uint32_t triangle, const WeightPatches& p, float* low, float* high)
{
  const auto& heights = *static_cast<const MapHeights*>(owner);
  const OnMap on(heights, triangle);
  for (int lane = 0; lane < 8; ++lane) {
    std::int64_t cells[2][2];
    for (int axis = 0; axis < 2; ++axis) {
      const double* x = axis == 0 ? on.x : on.y;
      const double e1 = x[1] - x[0], e2 = x[2] - x[0];
      const double middle = x[0] + p.center[0][lane] * e1 + p.center[1][lane] * e2;
      const double reach = std::abs(p.du[0][lane] * e1 + p.du[1][lane] * e2) +
                           std::abs(p.dv[0][lane] * e1 + p.dv[1][lane] * e2) + 1e-6 * (std::abs(e1) + std::abs(e2)) +
                           1e-6;
      cells[axis][0] = static_cast<std::int64_t>(std::floor(middle - reach));
      cells[axis][1] = static_cast<std::int64_t>(std::floor(middle + reach));
    }
    const StoredRange stored = height_field_range(*heights.field, cells[0][0], cells[1][0], cells[0][1], cells[1][1]);
    double from, to;
    stored_to_heights(*heights.field, stored, &from, &to);
    low[lane] = std::nextafter(static_cast<float>(from), -HUGE_VALF);
    high[lane] = std::nextafter(static_cast<float>(to), HUGE_VALF);
  }
}

}  // namespace

HeightSource MapHeights::source() const { return {this, eval, bounds}; }

}  // namespace relief
