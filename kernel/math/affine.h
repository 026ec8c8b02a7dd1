// Affine transforms. Names say both spaces: `world_from_object` takes object space to world space.
#pragma once

#include "kernel/math/vec.h"

namespace relief {

/// 3×4 affine map; `x`, `y`, `z` are the images of the unit axes, `p` the image of the origin.
struct Affine3 {
  Vec3f x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1}, p{};
};

RELIEF_KERNEL Vec3f transform_vector(const Affine3& m, Vec3f v) { return m.x * v.x + m.y * v.y + m.z * v.z; }
RELIEF_KERNEL Vec3f transform_point(const Affine3& m, Vec3f v) { return transform_vector(m, v) + m.p; }

/// Normal under the map whose *inverse* is given: multiplies by the inverse transpose. Not normalized.
/// @param object_from_world  inverse of the map that takes the normal's object to the world
RELIEF_KERNEL Vec3f transform_normal(const Affine3& object_from_world, Normal3f n)
{
  const Vec3f v = as_vector(n);
  return {dot(object_from_world.x, v), dot(object_from_world.y, v), dot(object_from_world.z, v)};
}

/// Determinant of the linear part: negative when the map mirrors.
RELIEF_KERNEL float determinant(const Affine3& m) { return dot(m.x, cross(m.y, m.z)); }

/// `a` after `b`.
RELIEF_KERNEL Affine3 operator*(const Affine3& a, const Affine3& b)
{
  return {transform_vector(a, b.x), transform_vector(a, b.y), transform_vector(a, b.z), transform_point(a, b.p)};
}

/// Inverse, computed in double; a singular map gives non-finite entries (the loader refuses those).
RELIEF_KERNEL Affine3 inverse(const Affine3& m)
{
  const double ax = m.x.x, ay = m.x.y, az = m.x.z, bx = m.y.x, by = m.y.y, bz = m.y.z, cx = m.z.x, cy = m.z.y,
               cz = m.z.z;
  const double rx = by * cz - bz * cy, ry = az * cy - ay * cz, rz = ay * bz - az * by;
  const double d = 1.0 / (ax * rx + bx * ry + cx * rz);
  const auto f = [d](double v) { return static_cast<float>(v * d); };
  Affine3 r;
  r.x = {f(rx), f(ry), f(rz)};
  r.y = {f(bz * cx - bx * cz), f(ax * cz - az * cx), f(az * bx - ax * bz)};
  r.z = {f(bx * cy - by * cx), f(ay * cx - ax * cy), f(ax * by - ay * bx)};
  r.p = -transform_vector(r, m.p);
  return r;
}

}  // namespace relief
