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
/// Coordinate by coordinate.
RELIEF_KERNEL Vec3x8 multiplied(const Vec3x8& a, const Vec3x8& b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
RELIEF_KERNEL F8 dot(const Vec3x8& a, const Vec3x8& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
RELIEF_KERNEL F8 length(const Vec3x8& a) { return sqrt(dot(a, a)); }
RELIEF_KERNEL Vec3x8 normalize(const Vec3x8& a) { return a * (1.0f / length(a)); }
RELIEF_KERNEL Vec3x8 abs(const Vec3x8& a) { return {abs(a.x), abs(a.y), abs(a.z)}; }
RELIEF_KERNEL F8 min_component(const Vec3x8& a) { return min(a.x, min(a.y, a.z)); }
RELIEF_KERNEL Vec3x8 select(I8 which, const Vec3x8& a, const Vec3x8& b)
{
  return {which ? a.x : b.x, which ? a.y : b.y, which ? a.z : b.z};
}

RELIEF_KERNEL I8 load8(const std::int32_t* from)
{
  I8 lanes;
  __builtin_memcpy(&lanes, from, sizeof lanes);
  return lanes;
}
RELIEF_KERNEL void store8(std::int32_t* to, I8 lanes) { __builtin_memcpy(to, &lanes, sizeof lanes); }

/// Vectors that lie in memory a coordinate after the other.
RELIEF_KERNEL Vec3x8 load8(const float (*from)[8]) { return {load8(from[0]), load8(from[1]), load8(from[2])}; }
RELIEF_KERNEL void store8(float (*to)[8], const Vec3x8& v)
{
  store8(to[0], v.x);
  store8(to[1], v.y);
  store8(to[2], v.z);
}
/// One of them.
RELIEF_KERNEL Vec3f load_lane(const float (*from)[8], int lane)
{
  return {from[0][lane], from[1][lane], from[2][lane]};
}
RELIEF_KERNEL void store_lane(float (*to)[8], int lane, Vec3f v)
{
  to[0][lane] = v.x;
  to[1][lane] = v.y;
  to[2][lane] = v.z;
}

/// Eight frames, as Frame is one.
struct Frame8 {
  Vec3x8 s, t, n;
};

RELIEF_KERNEL Frame8 frame_from_normal(const Vec3x8& n)
{
  const F8 sign = __builtin_bit_cast(F8, (bits_of(n.z) & 0x80000000u) | bits_of(splat8(1.0f)));
  const F8 a = -1.0f / (sign + n.z);
  const F8 b = n.x * n.y * a;
  return {{1.0f + sign * n.x * n.x * a, sign * b, -sign * n.x}, {b, sign + n.y * n.y * a, -n.y}, n};
}
RELIEF_KERNEL Vec3x8 to_local(const Frame8& f, const Vec3x8& v) { return {dot(v, f.s), dot(v, f.t), dot(v, f.n)}; }
RELIEF_KERNEL Vec3x8 from_local(const Frame8& f, const Vec3x8& v) { return f.s * v.x + f.t * v.y + f.n * v.z; }
RELIEF_KERNEL Frame8 load_frame8(const float (*from)[8]) { return {load8(from), load8(from + 3), load8(from + 6)}; }
RELIEF_KERNEL void store8(float (*to)[8], const Frame8& f)
{
  store8(to, f.s);
  store8(to + 3, f.t);
  store8(to + 6, f.n);
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
