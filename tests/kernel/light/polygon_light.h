// Reference in double precision for flat lights of constant radiance: irradiance by Lambert's formula for polygons,
// clipped at the receiver's horizon, and solid angle. Shares no code with the kernel.
#pragma once

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace relief::reference {

using Vec = std::array<double, 3>;

inline Vec sub(Vec a, Vec b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
inline Vec add(Vec a, Vec b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
inline Vec mul(Vec a, double s) { return {a[0] * s, a[1] * s, a[2] * s}; }
inline double dot(Vec a, Vec b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
inline Vec cross(Vec a, Vec b)
{
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline double length(Vec a) { return std::sqrt(dot(a, a)); }
inline double angle_between(Vec a, Vec b) { return std::atan2(length(cross(a, b)), dot(a, b)); }

/// The part of a polygon above the plane through the origin with normal N (Sutherland and Hodgman).
inline std::vector<Vec> clip_to_horizon(const std::vector<Vec>& polygon, Vec N)
{
  std::vector<Vec> above;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec a = polygon[i], b = polygon[(i + 1) % polygon.size()];
    const double ha = dot(a, N), hb = dot(b, N);
    if (ha >= 0) above.push_back(a);
    if ((ha >= 0) != (hb >= 0)) above.push_back(add(a, mul(sub(b, a), ha / (ha - hb))));
  }
  return above;
}

/// Irradiance at P with normal N from a polygon of radiance 1 that emits on both sides.
/// @param polygon  world, planar, any orientation
/// @source Lambert 1760; Arvo 1995, Eq. 2
inline double polygon_irradiance(std::vector<Vec> polygon, Vec P, Vec N)
{
  for (Vec& v : polygon) v = sub(v, P);
  polygon = clip_to_horizon(polygon, N);
  double sum = 0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec a = polygon[i], b = polygon[(i + 1) % polygon.size()];
    const Vec across = cross(a, b);
    if (length(across) > 0) sum += angle_between(a, b) * dot(across, N) / length(across);
  }
  return std::abs(sum) / 2;
}

/// Solid angle of a convex polygon: fan of triangles (Van Oosterom and Strackee 1983).
inline double polygon_solid_angle(std::vector<Vec> polygon, Vec P)
{
  for (Vec& v : polygon) v = sub(v, P);
  double sum = 0;
  for (std::size_t i = 1; i + 1 < polygon.size(); ++i) {
    const Vec a = polygon[0], b = polygon[i], c = polygon[i + 1];
    const double la = length(a), lb = length(b), lc = length(c);
    // Determinant from edges: exact enough for polygons that are tiny seen from P.
    const double det = dot(a, cross(sub(b, a), sub(c, a)));
    sum += 2 * std::atan2(std::abs(det), la * lb * lc + dot(a, b) * lc + dot(a, c) * lb + dot(b, c) * la);
  }
  return sum;
}

}  // namespace relief::reference
