// Three doubles: what hits are refined in, because a displaced point is the difference of large, nearly equal terms.
#pragma once

#include "kernel/math/vec.h"

namespace relief {

struct Vec3d {
  double x = 0, y = 0, z = 0;
};

// Plain comparisons: the library's fmin and fmax are calls.
RELIEF_KERNEL constexpr double min(double a, double b) { return a < b ? a : b; }
RELIEF_KERNEL constexpr double max(double a, double b) { return a > b ? a : b; }

RELIEF_KERNEL constexpr Vec3d operator+(Vec3d a, Vec3d b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
RELIEF_KERNEL constexpr Vec3d operator-(Vec3d a, Vec3d b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
RELIEF_KERNEL constexpr Vec3d operator*(Vec3d a, double s) { return {a.x * s, a.y * s, a.z * s}; }
RELIEF_KERNEL constexpr Vec3d operator*(double s, Vec3d a) { return a * s; }
RELIEF_KERNEL constexpr double dot(Vec3d a, Vec3d b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
RELIEF_KERNEL constexpr Vec3d cross(Vec3d a, Vec3d b)
{
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
RELIEF_KERNEL Vec3d abs(Vec3d a) { return {__builtin_fabs(a.x), __builtin_fabs(a.y), __builtin_fabs(a.z)}; }
RELIEF_KERNEL double length(Vec3d a) { return __builtin_sqrt(dot(a, a)); }
RELIEF_KERNEL constexpr Vec3d to_double(Vec3f v) { return {v.x, v.y, v.z}; }
RELIEF_KERNEL constexpr Vec3f to_float(Vec3d v)
{
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

}  // namespace relief
