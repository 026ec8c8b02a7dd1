// Random displaced triangles with rays, for comparisons with the oracle. All numbers are floats kept in doubles, so
// that renderer and oracle are given the same problem.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "tests/oracle/displaced_triangle.h"

namespace relief {

struct RandomCase {
  oracle::DisplacedTriangle triangle;
  oracle::HeightMap map;
  std::vector<oracle::Ray> rays;
};

/// Not a plain pair of casts: GCC 12's vectorizer takes two of those side by side for nothing.
inline double float_rounded(double value)
{
  const volatile float rounded = static_cast<float>(value);
  return rounded;
}

/// In [0, 1), the same on every machine.
inline double random_unit(std::mt19937_64& random) { return static_cast<double>(random() >> 40) * 0x1p-24; }
inline double random_between(std::mt19937_64& random, double low, double high)
{
  return low + (high - low) * random_unit(random);
}
inline int random_index(std::mt19937_64& random, int count)
{
  return static_cast<int>(random() % static_cast<std::uint64_t>(count));
}

inline oracle::Vector3 random_direction(std::mt19937_64& random)
{
  const double z = random_between(random, -1, 1), phi = random_between(random, 0, 2 * 3.14159265358979);
  const double r = std::sqrt(1 - z * z);
  return {r * std::cos(phi), r * std::sin(phi), z};
}

inline oracle::Vector3 combination(double a, const oracle::Vector3& x, double b, const oracle::Vector3& y)
{
  return {a * x[0] + b * y[0], a * x[1] + b * y[1], a * x[2] + b * y[2]};
}

inline oracle::Vector3 cross_product(const oracle::Vector3& a, const oracle::Vector3& b)
{
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

inline double vector_length(const oracle::Vector3& a) { return std::hypot(a[0], a[1], a[2]); }
inline oracle::Vector3 unit_vector(const oracle::Vector3& a) { return combination(1 / vector_length(a), a, 0, a); }

inline oracle::Vector3 float_rounded(const oracle::Vector3& a)
{
  return {float_rounded(a[0]), float_rounded(a[1]), float_rounded(a[2])};
}

/// A vector of random direction and of a length between two.
/// Random numbers are drawn in separate statements, because compilers evaluate arguments in orders of their own.
inline oracle::Vector3 random_vector(std::mt19937_64& random, double shortest, double longest)
{
  const double length = random_between(random, shortest, longest);
  return combination(length, random_direction(random), 0, {});
}

/// A ray through two points, up to the rounding of its numbers.
inline oracle::Ray ray_through(const oracle::Vector3& from,
                               const oracle::Vector3& to,
                               double t_min = 0,
                               double t_max = HUGE_VAL)
{
  const oracle::Vector3 O = float_rounded(from);
  return {O, float_rounded(combination(1, to, -1, O)), float_rounded(t_min), float_rounded(t_max)};
}

/// Barycentric coordinates of the corners 1 and 2, uniform over the triangle.
inline oracle::Vector2 random_barycentric(std::mt19937_64& random)
{
  double b1 = random_unit(random), b2 = random_unit(random);
  if (b1 + b2 > 1) {
    b1 = 1 - b1;
    b2 = 1 - b2;
  }
  return {b1, b2};
}

/// Base point at b moved along N by an offset.
inline oracle::Vector3 prism_point(const oracle::DisplacedTriangle& triangle, const oracle::Vector2& b, double offset)
{
  oracle::HeightMap constant{1, 1, {offset}};
  return oracle::surface_eval(triangle, constant, b).P;
}

/// A point of the prism between two displacements.
inline oracle::Vector3 random_prism_point(std::mt19937_64& random,
                                          const oracle::DisplacedTriangle& triangle,
                                          double lowest,
                                          double highest)
{
  const oracle::Vector2 b = random_barycentric(random);
  return prism_point(triangle, b, random_between(random, lowest, highest));
}

/// Smooth, noisy, spiky, stepped or constant.
inline std::vector<double> random_heights(std::mt19937_64& random, int width, int height)
{
  std::vector<double> h;
  const int kind = random_index(random, 5);
  const double frequency_x = random_between(random, .2, 1.5), frequency_y = random_between(random, .2, 1.5);
  const double constant = random_unit(random);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      double value = constant;
      if (kind == 0) value = .5 + .5 * std::sin(frequency_x * x) * std::cos(frequency_y * y);
      if (kind == 1) value = random_unit(random);
      if (kind == 2) value = random_index(random, 12) == 0 ? 1 : 0;
      if (kind == 3) value = (static_cast<int>(frequency_x * x) + static_cast<int>(frequency_y * y)) % 2;
      if (kind == 4) value = constant + .05 * random_unit(random);
      h.push_back(float_rounded(value));
    }
  }
  return h;
}

/// Heights for a large map, in which nodes of many texels differ: hills, hills with noise, or plateaus whose edges are
/// those of nodes.
inline std::vector<double> random_landscape(std::mt19937_64& random, int width, int height)
{
  std::vector<double> h;
  const int kind = random_index(random, 3), side = 4 << random_index(random, 5);
  const double frequency_x = random_between(random, 5, 60) / width,
               frequency_y = random_between(random, 5, 60) / height;
  const int columns = (width + side - 1) / side, rows = (height + side - 1) / side;
  std::vector<double> plateaus;
  for (int k = 0; k < columns * rows; ++k) plateaus.push_back(random_unit(random));
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      double value = .5 + .4 * std::sin(frequency_x * x) * std::cos(frequency_y * y);
      if (kind == 1) value += .05 * random_between(random, -1, 1);
      if (kind == 2) value = plateaus[static_cast<std::size_t>(y / side * columns + x / side)];
      h.push_back(float_rounded(value));
    }
  }
  return h;
}

/// Lowest and highest displacement of a map.
inline std::array<double, 2> displacement_range(const oracle::HeightMap& map)
{
  std::array<double, 2> range{HUGE_VAL, -HUGE_VAL};
  for (const double h : map.h) {
    const double d = map.scale * (h - map.midlevel);
    range = {std::min(range[0], d), std::max(range[1], d)};
  }
  return range;
}

/// Rays that aim at the prism and at the surface, graze, start inside or on the surface, are parallel to an axis, or
/// end inside.
inline std::vector<oracle::Ray> random_rays(std::mt19937_64& random,
                                            const oracle::DisplacedTriangle& triangle,
                                            const oracle::HeightMap& map,
                                            int num_rays)
{
  const oracle::Vector3 edge1 = combination(1, triangle.P[1], -1, triangle.P[0]);
  const oracle::Vector3 edge2 = combination(1, triangle.P[2], -1, triangle.P[0]);
  const double lowest = displacement_range(map)[0], highest = displacement_range(map)[1];
  const double size = vector_length(edge1) + vector_length(edge2) + std::abs(lowest) + std::abs(highest);
  const auto point_in_prism = [&] {
    const double margin = .1 * (highest - lowest);
    return random_prism_point(random, triangle, lowest - margin, highest + margin);
  };
  std::vector<oracle::Ray> rays;
  for (int i = 0; i < num_rays; ++i) {
    const oracle::Vector3 inside = point_in_prism();
    const oracle::Vector3 on_surface = oracle::surface_eval(triangle, map, random_barycentric(random)).P;
    const oracle::Vector3 outside = combination(1, inside, size, random_vector(random, .5, 4));
    const double along1 = random_between(random, -1, 1), along2 = random_between(random, -1, 1);
    const oracle::Vector3 beside = combination(along1, edge1, along2, edge2);
    const oracle::Vector3 lift = random_vector(random, 0, .05 * size);
    const int axis = random_index(random, 3);
    oracle::Vector3 along_axis{};
    along_axis[static_cast<std::size_t>(axis)] = random_index(random, 2) == 0 ? size : -size;
    const double t_min = random_between(random, 0, .95), t_max = random_between(random, .95, 1.1);
    switch (i % 8) {
      case 0:
        rays.push_back(ray_through(outside, inside));
        break;
      case 1:
        rays.push_back(ray_through(outside, on_surface));
        break;
      case 2:
        rays.push_back(ray_through(combination(1, combination(1, inside, 1, lift), -2, beside), inside));
        break;
      case 3:
        rays.push_back(ray_through(inside, combination(1, inside, size, random_direction(random))));
        break;
      case 4:
        rays.push_back(ray_through(on_surface, combination(1, on_surface, size, random_direction(random))));
        break;
      case 5:
        rays.push_back(ray_through(combination(1, inside, -1, along_axis), inside));
        break;
      case 6:
        rays.push_back(ray_through(outside, inside, t_min, t_max));
        break;
      case 7:
        rays.push_back(ray_through(inside, point_in_prism()));
        break;
      default:
        break;
    }
  }
  return rays;
}

/// Corners around a centre, and normals up to 60° apart.
inline oracle::DisplacedTriangle random_base_triangle(std::mt19937_64& random, double size)
{
  oracle::DisplacedTriangle triangle;
  const oracle::Vector3 center = random_vector(random, 0, 10 * size);
  for (oracle::Vector3& corner : triangle.P) {
    corner = float_rounded(combination(1, center, size, random_direction(random)));
  }
  oracle::Vector3 base_normal =
      cross_product(combination(1, triangle.P[1], -1, triangle.P[0]), combination(1, triangle.P[2], -1, triangle.P[0]));
  if (vector_length(base_normal) > 0) base_normal = unit_vector(base_normal);
  // 60° between two normals that both lean by 30°.
  const double lean = random_index(random, 4) == 0 ? 0 : random_between(random, 0, .57);
  for (oracle::Vector3& N : triangle.N) {
    const double N_length = random_index(random, 2) == 0 ? 1 : random_between(random, .5, 2);
    N = float_rounded(
        combination(N_length, unit_vector(combination(1, base_normal, lean, random_direction(random))), 0, {}));
  }
  return triangle;
}

/// Scale of either sign, and midlevel.
inline void set_random_scale(std::mt19937_64& random, double amplitude, oracle::HeightMap* map)
{
  map->scale = float_rounded(random_index(random, 4) == 0 ? -amplitude : amplitude);
  map->midlevel = random_index(random, 2) == 0 ? .5 : float_rounded(random_unit(random));
}

/// Places a triangle in a map, anywhere up to three periods from its corner.
inline void set_random_uv(std::mt19937_64& random,
                          const oracle::HeightMap& map,
                          double texels_across,
                          oracle::DisplacedTriangle* triangle)
{
  const double shift_u = random_between(random, -3, 3), shift_v = random_between(random, -3, 3);
  for (oracle::Vector2& uv : triangle->uv) {
    uv = {float_rounded(shift_u + texels_across / map.width * random_between(random, -1, 1)),
          float_rounded(shift_v + texels_across / map.height * random_between(random, -1, 1))};
  }
}

/// @param random    its state decides everything
/// @return          a triangle of 1 to about 200 texels, normals up to 60° apart, and a map of up to 32 × 32 texels
inline RandomCase random_case(std::mt19937_64& random, int num_rays)
{
  RandomCase result;
  oracle::HeightMap& map = result.map;
  map.width = 1 + random_index(random, 32);
  map.height = 1 + random_index(random, 32);
  map.h = random_heights(random, map.width, map.height);
  map.wrap_u = static_cast<oracle::Wrap>(random_index(random, 3));
  map.wrap_v = static_cast<oracle::Wrap>(random_index(random, 3));
  const double size = std::pow(10, random_between(random, -2, 2));
  result.triangle = random_base_triangle(random, size);
  set_random_scale(random, size * std::pow(10, random_between(random, -2, -.3)), &map);
  set_random_uv(random, map, std::pow(10, random_between(random, 0, 1.2)), &result.triangle);
  result.rays = random_rays(random, result.triangle, map, num_rays);
  return result;
}

/// A map with several triangles, and rays for each of them.
struct RandomLargeCase {
  oracle::HeightMap map;
  std::vector<oracle::DisplacedTriangle> triangles;
  std::vector<std::vector<oracle::Ray>> rays;  ///< by triangle
};

/// @return  triangles of 10 to about 1000 texels a side on a map of 256 to 1024 texels a side
inline RandomLargeCase random_large_case(std::mt19937_64& random, int num_triangles, int num_rays)
{
  RandomLargeCase result;
  oracle::HeightMap& map = result.map;
  map.width = 256 + random_index(random, 769);
  map.height = 256 + random_index(random, 769);
  map.h = random_landscape(random, map.width, map.height);
  map.wrap_u = static_cast<oracle::Wrap>(random_index(random, 3));
  map.wrap_v = static_cast<oracle::Wrap>(random_index(random, 3));
  const double size = std::pow(10, random_between(random, -2, 2));
  set_random_scale(random, size * std::pow(10, random_between(random, -3, -.6)), &map);
  for (int k = 0; k < num_triangles; ++k) {
    oracle::DisplacedTriangle triangle = random_base_triangle(random, size);
    set_random_uv(random, map, std::pow(10, random_between(random, 1, 2.7)), &triangle);
    result.rays.push_back(random_rays(random, triangle, map, num_rays));
    result.triangles.push_back(triangle);
  }
  return result;
}

}  // namespace relief
