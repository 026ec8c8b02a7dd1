// Small vectors and the handful of functions on them. Points, directions and linear RGB colours are `Vec3f`;
// normals before transformation are `Normal3f`, because they transform by the inverse transpose.
//
// All members are trivial aggregates and every function is internal (see kernel.h), so the header is safe in
// translation units of any instruction set.
#pragma once

#include <cmath>
#include <cstdint>

#include "kernel/kernel.h"

namespace relief {

struct Vec2f {
  float x = 0, y = 0;
};

/// Point, direction, or linear Rec.709 colour (x, y, z = R, G, B).
struct Vec3f {
  float x = 0, y = 0, z = 0;
};

/// Tangent with handedness (glTF TANGENT: w is ±1), or RGBA.
struct Vec4f {
  float x = 0, y = 0, z = 0, w = 0;
};

/// Surface normal in the space its owner names; not necessarily unit. Converts to a direction explicitly.
struct Normal3f {
  float x = 0, y = 0, z = 0;
};

struct Vec2i {
  int x = 0, y = 0;
};

inline constexpr float kPi = 3.14159265358979323846f;
inline constexpr float kInvPi = 0.31830988618379067154f;
inline constexpr float kInfinity = __builtin_huge_valf();

RELIEF_KERNEL constexpr Vec2f operator+(Vec2f a, Vec2f b) { return {a.x + b.x, a.y + b.y}; }
RELIEF_KERNEL constexpr Vec2f operator-(Vec2f a, Vec2f b) { return {a.x - b.x, a.y - b.y}; }
RELIEF_KERNEL constexpr Vec2f operator*(Vec2f a, float s) { return {a.x * s, a.y * s}; }
RELIEF_KERNEL constexpr Vec2f operator*(float s, Vec2f a) { return a * s; }
RELIEF_KERNEL constexpr bool operator==(Vec2f a, Vec2f b) { return a.x == b.x && a.y == b.y; }

RELIEF_KERNEL constexpr Vec3f operator+(Vec3f a, Vec3f b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
RELIEF_KERNEL constexpr Vec3f operator-(Vec3f a, Vec3f b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
RELIEF_KERNEL constexpr Vec3f operator-(Vec3f a) { return {-a.x, -a.y, -a.z}; }
RELIEF_KERNEL constexpr Vec3f operator*(Vec3f a, Vec3f b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
RELIEF_KERNEL constexpr Vec3f operator*(Vec3f a, float s) { return {a.x * s, a.y * s, a.z * s}; }
RELIEF_KERNEL constexpr Vec3f operator*(float s, Vec3f a) { return a * s; }
RELIEF_KERNEL constexpr Vec3f operator/(Vec3f a, float s) { return a * (1.0f / s); }
RELIEF_KERNEL constexpr Vec3f operator/(Vec3f a, Vec3f b) { return {a.x / b.x, a.y / b.y, a.z / b.z}; }
RELIEF_KERNEL constexpr Vec3f& operator+=(Vec3f& a, Vec3f b) { return a = a + b; }
RELIEF_KERNEL constexpr Vec3f& operator*=(Vec3f& a, Vec3f b) { return a = a * b; }
RELIEF_KERNEL constexpr Vec3f& operator*=(Vec3f& a, float s) { return a = a * s; }
RELIEF_KERNEL constexpr bool operator==(Vec3f a, Vec3f b) { return a.x == b.x && a.y == b.y && a.z == b.z; }

RELIEF_KERNEL constexpr Vec3f splat3(float s) { return {s, s, s}; }
RELIEF_KERNEL constexpr float dot(Vec2f a, Vec2f b) { return a.x * b.x + a.y * b.y; }
RELIEF_KERNEL constexpr float dot(Vec3f a, Vec3f b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

/// a·b − c·d with a relative error of about one ulp even under cancellation (Kahan; pbrt-v4 §6.8).
RELIEF_KERNEL float difference_of_products(float a, float b, float c, float d)
{
#ifdef __FMA__
  const float cd = c * d;
  const float error = __builtin_fmaf(-c, d, cd);
  return __builtin_fmaf(a, b, -cd) + error;
#else
  // Products of floats are exact in double, so one rounding of the difference remains.
  return static_cast<float>(static_cast<double>(a) * b - static_cast<double>(c) * d);
#endif
}

RELIEF_KERNEL Vec3f cross(Vec3f a, Vec3f b)
{
  return {difference_of_products(a.y, b.z, a.z, b.y), difference_of_products(a.z, b.x, a.x, b.z),
          difference_of_products(a.x, b.y, a.y, b.x)};
}

RELIEF_KERNEL constexpr float length_squared(Vec3f a) { return dot(a, a); }
RELIEF_KERNEL float length(Vec3f a) { return __builtin_sqrtf(dot(a, a)); }
/// Unit vector; a zero vector gives non-finite components.
RELIEF_KERNEL Vec3f normalize(Vec3f a) { return a * (1.0f / length(a)); }

RELIEF_KERNEL constexpr float min(float a, float b) { return a < b ? a : b; }
RELIEF_KERNEL constexpr float max(float a, float b) { return a > b ? a : b; }
/// NaN maps to `low`, so that a clamped value is always usable.
RELIEF_KERNEL constexpr float clamp(float x, float low, float high) { return x > low ? (x < high ? x : high) : low; }
RELIEF_KERNEL constexpr float sqr(float x) { return x * x; }
/// Square root of x, 0 for negative x and NaN.
RELIEF_KERNEL float safe_sqrt(float x) { return __builtin_sqrtf(max(x, 0.0f) > 0.0f ? x : 0.0f); }
RELIEF_KERNEL constexpr float lerp(float t, float a, float b) { return (1.0f - t) * a + t * b; }
RELIEF_KERNEL constexpr Vec3f lerp(float t, Vec3f a, Vec3f b) { return (1.0f - t) * a + t * b; }
RELIEF_KERNEL constexpr Vec3f min(Vec3f a, Vec3f b) { return {min(a.x, b.x), min(a.y, b.y), min(a.z, b.z)}; }
RELIEF_KERNEL constexpr Vec3f max(Vec3f a, Vec3f b) { return {max(a.x, b.x), max(a.y, b.y), max(a.z, b.z)}; }
RELIEF_KERNEL constexpr float max_component(Vec3f a) { return max(a.x, max(a.y, a.z)); }
RELIEF_KERNEL constexpr float min_component(Vec3f a) { return min(a.x, min(a.y, a.z)); }
RELIEF_KERNEL Vec3f abs(Vec3f a) { return {__builtin_fabsf(a.x), __builtin_fabsf(a.y), __builtin_fabsf(a.z)}; }
RELIEF_KERNEL Vec3f exp(Vec3f a) { return {std::exp(a.x), std::exp(a.y), std::exp(a.z)}; }
RELIEF_KERNEL bool is_finite(float x) { return __builtin_isfinite(x); }
RELIEF_KERNEL bool is_finite(Vec3f a) { return is_finite(a.x) && is_finite(a.y) && is_finite(a.z); }
RELIEF_KERNEL constexpr bool is_zero(Vec3f a) { return a.x == 0.0f && a.y == 0.0f && a.z == 0.0f; }

/// Relative luminance of linear Rec.709.
RELIEF_KERNEL constexpr float luminance(Vec3f rgb) { return 0.2126f * rgb.x + 0.7152f * rgb.y + 0.0722f * rgb.z; }

RELIEF_KERNEL constexpr Vec3f as_vector(Normal3f n) { return {n.x, n.y, n.z}; }
RELIEF_KERNEL constexpr Normal3f as_normal(Vec3f v) { return {v.x, v.y, v.z}; }
RELIEF_KERNEL constexpr Vec3f xyz(Vec4f v) { return {v.x, v.y, v.z}; }

/// Right-handed orthonormal basis; columns of the rotation from local (z = N) to the space of N.
struct Frame {
  Vec3f s, t, n;
};

/// Basis around a unit vector, continuous except at n.z = −0.
/// @source Duff et al. 2017, "Building an Orthonormal Basis, Revisited"
RELIEF_KERNEL Frame frame_from_normal(Vec3f n)
{
  const float sign = __builtin_copysignf(1.0f, n.z);
  const float a = -1.0f / (sign + n.z);
  const float b = n.x * n.y * a;
  return {{1.0f + sign * n.x * n.x * a, sign * b, -sign * n.x}, {b, sign + n.y * n.y * a, -n.y}, n};
}

RELIEF_KERNEL Vec3f to_local(const Frame& f, Vec3f v) { return {dot(v, f.s), dot(v, f.t), dot(v, f.n)}; }
RELIEF_KERNEL Vec3f from_local(const Frame& f, Vec3f v) { return f.s * v.x + f.t * v.y + f.n * v.z; }

}  // namespace relief
