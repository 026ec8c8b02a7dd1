// Maps from the unit square to shapes: each with its density and, where somebody needs it, its inverse. A map is
// one-to-one up to boundaries, so stratified points stay stratified.
//
// Random numbers lie in [0, 1)². Densities are with respect to the measure that the comment names and are valid for
// points of the shape; outside they are zero only where the docstring says so.
#pragma once

#include "kernel/math/trigonometry.h"

namespace relief {

/// Point of the unit disk.
/// @source Shirley and Chiu 1997, "A Low Distortion Map Between Disk and Square"
RELIEF_KERNEL Vec2f warp_disk(Vec2f u)
{
  const float x = 2.0f * u.x - 1.0f;
  const float y = 2.0f * u.y - 1.0f;
  if (x == 0.0f && y == 0.0f) return {};
  const bool is_x = __builtin_fabsf(x) > __builtin_fabsf(y);
  const float radius = is_x ? x : y, other = is_x ? y : x;
  const SinCos phi = sin_cos_octant(0.25f * kPi * (other / radius));
  const float along = radius * phi.cos, across = radius * phi.sin;
  return {is_x ? along : across, is_x ? across : along};
}

RELIEF_KERNEL Vec2f warp_disk_inverse(Vec2f p)
{
  const float radius = __builtin_sqrtf(dot(p, p));
  constexpr float kFourOverPi = 4.0f * kInvPi;
  float x, y;
  if (__builtin_fabsf(p.x) > __builtin_fabsf(p.y)) {
    x = __builtin_copysignf(radius, p.x);
    y = x * kFourOverPi * std::atan(p.y / p.x);
  } else if (p.y != 0.0f) {
    y = __builtin_copysignf(radius, p.y);
    x = y * kFourOverPi * std::atan(p.x / p.y);
  } else {
    return {0.5f, 0.5f};
  }
  return {0.5f * (x + 1.0f), 0.5f * (y + 1.0f)};
}

/// @return per unit area
RELIEF_KERNEL constexpr float warp_disk_pdf() { return kInvPi; }

/// Point of a regular polygon whose corners lie on the unit circle; +x goes through the middle of an edge. A walk along all
/// edges by u.x and out from the centre by u.y: no step where a corner is passed.
/// @param num_corners  ≥ 3
RELIEF_KERNEL Vec2f warp_polygon(Vec2f u, int num_corners)
{
  const auto n = static_cast<float>(num_corners);
  const float at = u.x * n;
  const float edge = min(__builtin_floorf(at), n - 1.0f);
  const float radius = __builtin_sqrtf(u.y);
  const SinCos half = sin_cos_turn(0.5f / n), turn = sin_cos_turn(edge / n);
  const float x = radius * half.cos, y = radius * half.sin * (2.0f * (at - edge) - 1.0f);
  return {turn.cos * x - turn.sin * y, turn.sin * x + turn.cos * y};
}

/// @param p  of the polygon
RELIEF_KERNEL Vec2f warp_polygon_inverse(Vec2f p, int num_corners)
{
  const auto n = static_cast<float>(num_corners);
  const float edge = __builtin_floorf(std::atan2(p.y, p.x) * (0.5f * kInvPi) * n + 0.5f);
  const SinCos half = sin_cos_turn(0.5f / n), turn = sin_cos_turn(edge / n);
  const float radius = (turn.cos * p.x + turn.sin * p.y) / half.cos;
  const float across = radius > 0.0f ? (turn.cos * p.y - turn.sin * p.x) / (radius * half.sin) : 0.0f;
  const float at = (edge < 0.0f ? edge + n : edge) + 0.5f * (across + 1.0f);
  return {at / n, sqr(radius)};
}

/// @return per unit area
RELIEF_KERNEL float warp_polygon_pdf(int num_corners)
{
  const auto n = static_cast<float>(num_corners);
  const SinCos half = sin_cos_turn(0.5f / n);
  return 1.0f / (n * half.sin * half.cos);
}

/// Direction about +z with density proportional to the cosine (Malley's method).
/// @return unit, z >= 0
RELIEF_KERNEL Vec3f warp_cosine_hemisphere(Vec2f u)
{
  const Vec2f d = warp_disk(u);
  return {d.x, d.y, safe_sqrt(1.0f - dot(d, d))};
}

RELIEF_KERNEL Vec2f warp_cosine_hemisphere_inverse(Vec3f w) { return warp_disk_inverse({w.x, w.y}); }

/// @param cos_theta  z of the direction
/// @return           solid angle; 0 below the horizon
RELIEF_KERNEL constexpr float warp_cosine_hemisphere_pdf(float cos_theta) { return max(0.0f, cos_theta) * kInvPi; }

/// Direction of height z (Archimedes: z is uniform on a sphere) and azimuth 2π·turn.
RELIEF_KERNEL Vec3f direction_from_z(float z, float turn)
{
  const float r = safe_sqrt((1.0f - z) * (1.0f + z));
  const SinCos phi = sin_cos_turn(turn);
  return {r * phi.cos, r * phi.sin, z};
}

/// Azimuth of a direction as a fraction of a turn, [0, 1].
RELIEF_KERNEL float turn_from_direction(Vec3f w)
{
  const float turn = std::atan2(w.y, w.x) * (0.5f * kInvPi);
  return turn < 0.0f ? turn + 1.0f : turn;
}

/// Uniform direction on the sphere.
RELIEF_KERNEL Vec3f warp_sphere(Vec2f u) { return direction_from_z(1.0f - 2.0f * u.x, u.y); }
RELIEF_KERNEL Vec2f warp_sphere_inverse(Vec3f w) { return {0.5f * (1.0f - w.z), turn_from_direction(w)}; }
/// @return solid angle
RELIEF_KERNEL constexpr float warp_sphere_pdf() { return 0.25f * kInvPi; }

/// Uniform direction on the hemisphere z >= 0.
RELIEF_KERNEL Vec3f warp_hemisphere(Vec2f u) { return direction_from_z(u.x, u.y); }
RELIEF_KERNEL Vec2f warp_hemisphere_inverse(Vec3f w) { return {w.z, turn_from_direction(w)}; }
/// @return solid angle
RELIEF_KERNEL constexpr float warp_hemisphere_pdf() { return 0.5f * kInvPi; }

/// Uniform direction within a cone about +z.
/// @param one_minus_cos  1 − cosine of the half angle, in (0, 2]; not the cosine, which cannot tell small cones apart
RELIEF_KERNEL Vec3f warp_cone(float one_minus_cos, Vec2f u)
{
  const float h = u.x * one_minus_cos;
  const float r = safe_sqrt(h * (2.0f - h));
  const SinCos phi = sin_cos_turn(u.y);
  return {r * phi.cos, r * phi.sin, 1.0f - h};
}

/// @param w  unit, inside the cone
RELIEF_KERNEL Vec2f warp_cone_inverse(float one_minus_cos, Vec3f w)
{
  // 1 − z without cancellation near the axis.
  const float h = w.z > 0.0f ? (w.x * w.x + w.y * w.y) / (1.0f + w.z) : 1.0f - w.z;
  return {h / one_minus_cos, turn_from_direction(w)};
}

/// @return solid angle, inside the cone
RELIEF_KERNEL constexpr float warp_cone_pdf(float one_minus_cos) { return 0.5f * kInvPi / one_minus_cos; }

/// Uniform point of a triangle.
/// @return barycentric weights of vertices 1 and 2
RELIEF_KERNEL Vec2f warp_triangle(Vec2f u)
{
  const float s = __builtin_sqrtf(u.x);
  return {s * (1.0f - u.y), s * u.y};
}

RELIEF_KERNEL Vec2f warp_triangle_inverse(Vec2f barycentric)
{
  const float s = barycentric.x + barycentric.y;
  return {s * s, s > 0.0f ? barycentric.y / s : 0.0f};
}

/// @return per unit of the area given
RELIEF_KERNEL constexpr float warp_triangle_pdf(float area) { return 1.0f / area; }

/// Normal of the isotropic GGX distribution as seen from wo (visible normals).
/// @param wo     unit, z > 0
/// @param alpha  > 0
/// @return       unit, z >= 0, dot(wo, wm) >= 0
/// @source Dupuy and Benyoub 2023, "Sampling Visible GGX Normals with Spherical Caps": stretch space until GGX is a
///         hemisphere; reflections of wo at its visible normals are uniform in a spherical cap, and wm is halfway.
RELIEF_KERNEL Vec3f warp_ggx_visible_normal(Vec3f wo, float alpha, Vec2f u)
{
  const Vec3f wo_std = normalize({wo.x * alpha, wo.y * alpha, wo.z});
  const Vec3f wm_std = direction_from_z(1.0f - u.y * (1.0f + wo_std.z), u.x) + wo_std;
  return normalize({wm_std.x * alpha, wm_std.y * alpha, max(0.0f, wm_std.z)});
}

RELIEF_KERNEL Vec2f warp_ggx_visible_normal_inverse(Vec3f wo, float alpha, Vec3f wm)
{
  const Vec3f wo_std = normalize({wo.x * alpha, wo.y * alpha, wo.z});
  const Vec3f wm_std = normalize({wm.x, wm.y, wm.z * alpha});
  const Vec3f cap = 2.0f * dot(wo_std, wm_std) * wm_std - wo_std;
  return {turn_from_direction(cap), (1.0f - cap.z) / (1.0f + wo_std.z)};
}

/// @return solid angle of wm; 0 for normals that face away from wo or from +z
/// @source the warp's Jacobian: cap to halfway vector (1 / 4cos), then the stretch (1 / alpha²·length³). Equal to
///         D(wm) G1(wo) dot(wo, wm) / wo.z (Heitz 2018, Eq. 3), which the test compares it with.
RELIEF_KERNEL float warp_ggx_visible_normal_pdf(Vec3f wo, float alpha, Vec3f wm)
{
  const float cos_om = dot(wo, wm);
  if (!(cos_om > 0.0f && wm.z > 0.0f)) return 0.0f;
  const float inv_alpha = 1.0f / alpha;
  const Vec3f m = {wm.x * inv_alpha, wm.y * inv_alpha, wm.z};
  const float o_length = length(Vec3f{wo.x * alpha, wo.y * alpha, wo.z});
  const float m_squared = length_squared(m);
  // dot(stretched wo, stretched wm) is dot(wo, wm) over both lengths.
  return 2.0f * kInvPi * cos_om * sqr(inv_alpha) / ((o_length + wo.z) * sqr(m_squared));
}

}  // namespace relief
