#include "tests/oracle/displaced_triangle.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "tests/oracle/prepared_surface.h"
#include "tests/oracle/root_search.h"

namespace relief::oracle {

namespace {

Vector3 cross(const Vector3& a, const Vector3& b)
{
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

double dot(const Vector3& a, const Vector3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

Vector3 difference(const Vector3& a, const Vector3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

/// The linear function of b with the given corners.
template <std::size_t size>
std::array<double, size> interpolated(const std::array<std::array<double, size>, 3>& corners, const Vector2& b)
{
  std::array<double, size> result;
  for (std::size_t k = 0; k < size; ++k) {
    result[k] = corners[0][k] + b[0] * (corners[1][k] - corners[0][k]) + b[1] * (corners[2][k] - corners[0][k]);
  }
  return result;
}

std::size_t wrapped(double index, int size, Wrap wrap)
{
  double phase = index;
  if (wrap == Wrap::kRepeat) {
    phase = index - size * std::floor(index / size);
  } else if (wrap == Wrap::kMirror) {
    phase = index - 2. * size * std::floor(index / (2. * size));
    if (phase >= size) phase = 2. * size - 1 - phase;
  }
  return static_cast<std::size_t>(std::clamp(phase, 0., size - 1.));
}

/// Height and its derivatives by the texel coordinates u · width and v · height.
struct HeightGradient {
  double h, h_x, h_y;
};

HeightGradient height_gradient(const HeightMap& map, const Vector2& uv)
{
  const double x = uv[0] * map.width - .5, y = uv[1] * map.height - .5;
  const double column = std::floor(x), row = std::floor(y);
  const auto texel = [&](double i, double j) {
    return map.h[wrapped(row + j, map.height, map.wrap_v) * static_cast<std::size_t>(map.width) +
                 wrapped(column + i, map.width, map.wrap_u)];
  };
  const double fx = x - column, fy = y - row;
  const double top = texel(0, 0) + fx * (texel(1, 0) - texel(0, 0));
  const double bottom = texel(0, 1) + fx * (texel(1, 1) - texel(0, 1));
  const double slope_top = texel(1, 0) - texel(0, 0), slope_bottom = texel(1, 1) - texel(0, 1);
  return {top + fy * (bottom - top), slope_top + fy * (slope_bottom - slope_top), bottom - top};
}

}  // namespace

Vector3 normal_oriented(const DisplacedTriangle& triangle, const Vector2& b, const Vector3& product)
{
  const double size = std::hypot(product[0], product[1], product[2]);
  if (!(size > 0) || !std::isfinite(size)) return {};
  const Vector3 N = interpolated(triangle.N, b);
  const Vector3 base_normal = cross(difference(triangle.P[1], triangle.P[0]), difference(triangle.P[2], triangle.P[0]));
  // dS/db1 × dS/db2 is on the same side of N as dP/db1 × dP/db2 is, unless the displacement folds the surface over.
  double sign = dot(base_normal, N) < 0 ? -1 : 1;
  if (dot(base_normal, N) == 0 && dot(product, N) < 0) sign = -1;
  return {sign * product[0] / size, sign * product[1] / size, sign * product[2] / size};
}

double height_eval(const HeightMap& map, const Vector2& uv) { return height_gradient(map, uv).h; }

SurfacePoint surface_eval(const DisplacedTriangle& triangle, const HeightMap& map, const Vector2& b)
{
  const Vector3 P = interpolated(triangle.P, b), N = interpolated(triangle.N, b);
  const double N_length = std::hypot(N[0], N[1], N[2]);
  SurfacePoint point;
  point.uv = interpolated(triangle.uv, b);
  const HeightGradient gradient = height_gradient(map, point.uv);
  point.h = gradient.h;
  const double d = map.scale * (point.h - map.midlevel);
  const Vector3 n{N[0] / N_length, N[1] / N_length, N[2] / N_length};
  std::array<Vector3, 2> tangents;
  for (std::size_t side = 0; side < 2; ++side) {
    const Vector3 P_slope = difference(triangle.P[side + 1], triangle.P[0]);
    const Vector3 N_slope = difference(triangle.N[side + 1], triangle.N[0]);
    const double d_slope = map.scale * (gradient.h_x * map.width * (triangle.uv[side + 1][0] - triangle.uv[0][0]) +
                                        gradient.h_y * map.height * (triangle.uv[side + 1][1] - triangle.uv[0][1]));
    const double along = dot(n, N_slope);
    for (std::size_t k = 0; k < 3; ++k) {
      tangents[side][k] = P_slope[k] + d_slope * n[k] + d / N_length * (N_slope[k] - along * n[k]);
    }
  }
  for (std::size_t k = 0; k < 3; ++k) point.P[k] = P[k] + d * n[k];
  point.Ng = normal_oriented(triangle, b, cross(tangents[0], tangents[1]));
  return point;
}

Surface::Surface(const DisplacedTriangle& triangle, const HeightMap& map)
    : prepared_(std::make_shared<const PreparedSurface>(triangle, map))
{
}

std::vector<Hit> Surface::intersect_all(const Ray& ray) const { return roots_find(*prepared_, ray); }

std::array<Interval, 3> Surface::bounds() const
{
  std::array<Interval, 3> bounds = prepared_->nodes[0].box;
  for (std::size_t k = 0; k < 3; ++k) bounds[k] = bounds[k] + thin(prepared_->triangle.P[0][k]);
  return bounds;
}

std::vector<Hit> intersect_all(const DisplacedTriangle& triangle, const HeightMap& map, const Ray& ray)
{
  return Surface(triangle, map).intersect_all(ray);
}

}  // namespace relief::oracle
