// Eight small vectors side by side.
#pragma once

#include "kernel/math/affine.h"
#include "kernel/math/lanes.h"

namespace relief {

/// Points or directions, a coordinate each.
struct Vec3x8 {
  F8 x, y, z;
};

RELIEF_KERNEL Vec3x8 splat8(Vec3f v) { return {splat8(v.x), splat8(v.y), splat8(v.z)}; }
RELIEF_KERNEL Vec3x8 operator+(const Vec3x8& a, const Vec3x8& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
RELIEF_KERNEL Vec3x8 operator-(const Vec3x8& a, const Vec3x8& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
RELIEF_KERNEL Vec3x8 operator-(const Vec3x8& a) { return {-a.x, -a.y, -a.z}; }
RELIEF_KERNEL Vec3x8 operator*(const Vec3x8& a, F8 s) { return {a.x * s, a.y * s, a.z * s}; }
RELIEF_KERNEL Vec3x8 operator*(F8 s, const Vec3x8& a) { return a * s; }
RELIEF_KERNEL Vec3x8 operator/(const Vec3x8& a, F8 s) { return a * (1.0f / s); }
RELIEF_KERNEL F8 dot(const Vec3x8& a, const Vec3x8& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
RELIEF_KERNEL F8 length(const Vec3x8& a) { return sqrt(dot(a, a)); }
RELIEF_KERNEL Vec3x8 normalize(const Vec3x8& a) { return a * (1.0f / length(a)); }
RELIEF_KERNEL Vec3x8 abs(const Vec3x8& a) { return {abs(a.x), abs(a.y), abs(a.z)}; }
RELIEF_KERNEL F8 min_component(const Vec3x8& a) { return min(a.x, min(a.y, a.z)); }
RELIEF_KERNEL Vec3x8 select(I8 which, const Vec3x8& a, const Vec3x8& b)
{
  return {which ? a.x : b.x, which ? a.y : b.y, which ? a.z : b.z};
}

/// As difference_of_products of each lane.
RELIEF_KERNEL F8 difference_of_products(F8 a, F8 b, F8 c, F8 d)
{
#ifdef __FMA__
  const F8 cd = c * d;
  const F8 error = __builtin_bit_cast(F8, _mm256_fnmadd_ps(__builtin_bit_cast(__m256, c), __builtin_bit_cast(__m256, d),
                                                           __builtin_bit_cast(__m256, cd)));
  return __builtin_bit_cast(F8, _mm256_fmsub_ps(__builtin_bit_cast(__m256, a), __builtin_bit_cast(__m256, b),
                                                __builtin_bit_cast(__m256, cd))) +
         error;
#else
  F8 result{};
  for (int k = 0; k < 8; ++k) result[k] = difference_of_products(a[k], b[k], c[k], d[k]);
  return result;
#endif
}

RELIEF_KERNEL Vec3x8 cross(const Vec3x8& a, const Vec3x8& b)
{
  return {difference_of_products(a.y, b.z, a.z, b.y), difference_of_products(a.z, b.x, a.x, b.z),
          difference_of_products(a.x, b.y, a.y, b.x)};
}

/// Eight affine maps, as Affine3 is one.
struct Affine3x8 {
  Vec3x8 x, y, z, p;
};

RELIEF_KERNEL Affine3x8 splat8(const Affine3& m) { return {splat8(m.x), splat8(m.y), splat8(m.z), splat8(m.p)}; }
RELIEF_KERNEL void lane_set(Vec3x8& lanes, int lane, Vec3f v)
{
  lanes.x[lane] = v.x;
  lanes.y[lane] = v.y;
  lanes.z[lane] = v.z;
}
RELIEF_KERNEL void lane_set(Affine3x8& lanes, int lane, const Affine3& m)
{
  lane_set(lanes.x, lane, m.x);
  lane_set(lanes.y, lane, m.y);
  lane_set(lanes.z, lane, m.z);
  lane_set(lanes.p, lane, m.p);
}
RELIEF_KERNEL Vec3f lane_of(const Vec3x8& lanes, int lane) { return {lanes.x[lane], lanes.y[lane], lanes.z[lane]}; }
RELIEF_KERNEL Vec3x8 transform_vector(const Affine3x8& m, const Vec3x8& v) { return m.x * v.x + m.y * v.y + m.z * v.z; }
RELIEF_KERNEL Vec3x8 transform_point(const Affine3x8& m, const Vec3x8& v) { return transform_vector(m, v) + m.p; }
/// @param object_from_world  see transform_normal of one
RELIEF_KERNEL Vec3x8 transform_normal(const Affine3x8& object_from_world, const Vec3x8& n)
{
  return {dot(object_from_world.x, n), dot(object_from_world.y, n), dot(object_from_world.z, n)};
}

}  // namespace relief
