#include "scene/transform.h"

#include <cmath>

namespace relief {
namespace {

Vec3d apply_linear(const Transform& t, const Vec3d& v)
{
  Vec3d out;
  for (std::size_t i = 0; i < 3; ++i) {
    out[i] = t.x[i] * v[0] + t.y[i] * v[1] + t.z[i] * v[2];
  }
  return out;
}

double norm(const Vec3d& v) { return std::hypot(v[0], v[1], v[2]); }

double determinant(const Transform& t)
{
  return t.x[0] * (t.y[1] * t.z[2] - t.y[2] * t.z[1]) + t.x[1] * (t.y[2] * t.z[0] - t.y[0] * t.z[2]) +
         t.x[2] * (t.y[0] * t.z[1] - t.y[1] * t.z[0]);
}

Vec3f to_float(const Vec3d& v)
{
  return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}

}  // namespace

Transform transform_from_trs(const Trs& trs)
{
  auto [x, y, z, w] = trs.rotation;
  const double length = std::sqrt(x * x + y * y + z * z + w * w);
  if (length > 0) {
    x /= length, y /= length, z /= length, w /= length;
  } else {
    x = y = z = 0;
    w = 1;
  }
  const Vec3d& s = trs.scale;
  Transform t;
  t.x = {(1 - 2 * (y * y + z * z)) * s[0], 2 * (x * y + z * w) * s[0], 2 * (x * z - y * w) * s[0]};
  t.y = {2 * (x * y - z * w) * s[1], (1 - 2 * (x * x + z * z)) * s[1], 2 * (y * z + x * w) * s[1]};
  t.z = {2 * (x * z + y * w) * s[2], 2 * (y * z - x * w) * s[2], (1 - 2 * (x * x + y * y)) * s[2]};
  t.p = trs.translation;
  return t;
}

std::optional<Transform> transform_from_matrix(const std::array<double, 16>& column_major)
{
  const std::array<double, 16>& m = column_major;
  // Writers that invert matrices leave rounding in the last row.
  constexpr double kRounding = 1e-6;
  if (std::fabs(m[3]) > kRounding || std::fabs(m[7]) > kRounding || std::fabs(m[11]) > kRounding ||
      std::fabs(m[15] - 1) > kRounding) {
    return {};
  }
  return Transform{{m[0], m[1], m[2]}, {m[4], m[5], m[6]}, {m[8], m[9], m[10]}, {m[12], m[13], m[14]}};
}

Transform operator*(const Transform& a, const Transform& b)
{
  Transform t{apply_linear(a, b.x), apply_linear(a, b.y), apply_linear(a, b.z), apply_linear(a, b.p)};
  for (std::size_t i = 0; i < 3; ++i) {
    t.p[i] += a.p[i];
  }
  return t;
}

Affine3 transform_to_affine(const Transform& t) { return {to_float(t.x), to_float(t.y), to_float(t.z), to_float(t.p)}; }

TransformDefect transform_defect(const Transform& t)
{
  const Affine3 m = transform_to_affine(t);
  if (!(is_finite(m.x) && is_finite(m.y) && is_finite(m.z) && is_finite(m.p))) {
    return TransformDefect::kNotFinite;
  }
  // Rounding the nine entries to float moves the determinant by up to 3 · 2⁻²⁴ · |x||y||z| (one ulp/2 in each of three
  // columns); doubled for the rounding of the product itself. Below that the sign is noise.
  constexpr double kNoise = 6.0 / (1 << 24);
  const double volume = norm(t.x) * norm(t.y) * norm(t.z);
  if (!(std::fabs(determinant(t)) > kNoise * volume)) {
    return TransformDefect::kSingular;
  }
  const Affine3 back = inverse(m);
  const bool invertible = is_finite(back.x) && is_finite(back.y) && is_finite(back.z) && is_finite(back.p);
  return invertible ? TransformDefect::kNone : TransformDefect::kSingular;
}

Vec3f unit_direction(const Vec3d& v)
{
  const double size = norm(v);
  return size > 0 ? to_float({v[0] / size, v[1] / size, v[2] / size}) : Vec3f{};
}

bool transform_mirrors(const Transform& t) { return determinant(t) < 0; }

}  // namespace relief
