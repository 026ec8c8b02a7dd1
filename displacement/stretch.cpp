#include "displacement/stretch.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "displacement/vec3d.h"

namespace relief {

namespace {

/// Largest singular value of a matrix of three columns: the root of MᵀM's largest eigenvalue.
/// @source Smith 1961, "Eigenvalues of a symmetric 3 × 3 matrix"
double largest_singular_value(Vec3d x, Vec3d y, Vec3d z)
{
  const double mean = (dot(x, x) + dot(y, y) + dot(z, z)) / 3;
  double a = dot(x, x) - mean, b = dot(y, y) - mean, c = dot(z, z) - mean;
  double xy = dot(x, y), yz = dot(y, z), zx = dot(z, x);
  const double radius = std::sqrt((a * a + b * b + c * c) / 6 + (xy * xy + yz * yz + zx * zx) / 3);
  if (!(radius > 0)) return std::sqrt(mean);
  for (double* entry : {&a, &b, &c, &xy, &yz, &zx}) *entry /= radius;
  const double determinant = a * (b * c - yz * yz) - xy * (xy * c - yz * zx) + zx * (xy * yz - b * zx);
  return std::sqrt(mean + 2 * radius * std::cos(std::acos(std::clamp(determinant / 2, -1.0, 1.0)) / 3));
}

}  // namespace

/// The least by way of the adjugate, whose largest singular value is the product of M's two largest: beside MᵀM's largest
/// eigenvalue the others may be less than its rounding.
Stretch stretch_of(const Affine3& m)
{
  const Vec3d x = to_double(m.x), y = to_double(m.y), z = to_double(m.z);
  const double product = largest_singular_value(cross(y, z), cross(z, x), cross(x, y));
  return {largest_singular_value(x, y, z), product > 0 ? std::abs(dot(x, cross(y, z))) / product : 0};
}

}  // namespace relief
