// Rectangle light: sampled uniformly in the solid angle it covers, so that neither distance nor tilt across a large
// light adds variance. Parallelograms with oblique axes, and lights so small or far that it makes no difference, are
// sampled by area. Source: Ureña, Fajardo and King 2013, "An Area-Preserving Parametrization for Spherical Rectangles".
#pragma once

#include "kernel/light/flat.h"

namespace relief {

struct RectangleLight : PlateLight {
  static constexpr bool kIsQuad = true;
};

/// Below this solid angle (sr) sampling by area is uniform within a few per cent, and cheaper.
inline constexpr float kRectangleMinSolidAngle = 5e-4f;

/// Solid angle that selects and drives the sampling: the one decision `sample` and `pdf` must agree on.
/// @param area  of the rectangle that the half axes span (a disk light's is smaller)
/// @return      steradians; 0: sample by area
RELIEF_KERNEL float rectangle_light_solid_angle(const Light& light, Vec3f P, float area)
{
  const float longest_edge_squared = 4.0f * max(length_squared(light.edge_u), length_squared(light.edge_v));
  if (!light_is_wide(light, P, longest_edge_squared)) return 0.0f;
  const float skew = dot(light.edge_u, light.edge_v);
  if (!(sqr(skew) <= 1e-8f * length_squared(light.edge_u) * length_squared(light.edge_v))) return 0.0f;
  const Vec3f centre = light.P - P;
  const Vec3f c00 = centre - light.edge_u - light.edge_v;
  const Vec3f c10 = centre + light.edge_u - light.edge_v;
  const Vec3f c11 = centre + light.edge_u + light.edge_v;
  const Vec3f c01 = centre - light.edge_u + light.edge_v;
  const float det = dot(centre, light.axis) * area;
  const float omega = triangle_solid_angle(c00, c10, c11, det) + triangle_solid_angle(c00, c11, c01, det);
  return omega >= kRectangleMinSolidAngle ? omega : 0.0f;
}

/// Point of a rectangle, uniform in the solid angle seen from P.
/// @param omega  that solid angle, sr
/// @param u      [0, 1)²
/// @return       world
/// @source Ureña et al. 2013, Fig. 4. The solid angle is handed in: theirs, an excess of angles, loses the digits of small
///         lights. In double, because the angles of a narrow light differ from flat ones by its width: in float, points on
///         lights of 0.01 sr were seen to be misplaced by 1/500 of their length
RELIEF_KERNEL Vec3f rectangle_light_point(const Light& light, Vec3f P, float omega, Vec2f u)
{
  const float half_x = length(light.edge_u), half_y = length(light.edge_v);
  const Vec3f x_axis = light.edge_u / half_x, y_axis = light.edge_v / half_y;
  const Vec3f centre = light.P - P;
  const float cx = dot(centre, x_axis), cy = dot(centre, y_axis);
  const double x0 = static_cast<double>(cx - half_x), x1 = static_cast<double>(cx + half_x);
  const double y0 = static_cast<double>(cy - half_y), y1 = static_cast<double>(cy + half_y);
  // The paper looks down the negative z axis; the side of the plane does not matter to x and y.
  const double z0 = -static_cast<double>(__builtin_fabsf(dot(centre, light.axis)));
  const double z0_squared = z0 * z0;

  // z components of the unit normals of the planes through P and the bottom, top and left edge.
  const double n0 = -y0 / __builtin_sqrt(z0_squared + y0 * y0);
  const double n2 = y1 / __builtin_sqrt(z0_squared + y1 * y1);
  const double n3 = -x0 / __builtin_sqrt(z0_squared + x0 * x0);
  // The paper's angles k = 2π − acos(−n2 n3) − acos(−n3 n0) and au = u Ω + k, as sines and cosines.
  const double cos_2 = -n2 * n3, cos_0 = -n3 * n0;
  const double sin_2 = __builtin_sqrt(1.0 - cos_2 * cos_2), sin_0 = __builtin_sqrt(1.0 - cos_0 * cos_0);
  const double cos_k = cos_2 * cos_0 - sin_2 * sin_0;
  const double sin_k = -sin_2 * cos_0 - cos_2 * sin_0;
  // Half the angle in float: a relative error stays one, on lights however small.
  const SinCos half = sin_cos_turn(u.x * omega * (0.25f * kInvPi));
  const double sin_half = static_cast<double>(half.sin), cos_half = static_cast<double>(half.cos);
  const double sin_turned = 2.0 * sin_half * cos_half, cos_turned = 1.0 - 2.0 * sin_half * sin_half;
  const double cos_au = cos_k * cos_turned - sin_k * sin_turned;
  const double sin_au = sin_k * cos_turned + cos_k * sin_turned;
  const double fu = (cos_au * n0 - n2) / sin_au;
  // cu is ±1 / √(fu² + n0²), and xu = −cu z0 / √(1 − cu²).
  const double tan_squared = fu * fu + n0 * n0 - 1.0;
  const double reach = -z0 / __builtin_sqrt(tan_squared > 1e-12 ? tan_squared : 1e-12);
  const double signed_reach = fu < 0.0 ? -reach : reach;
  const double xu = signed_reach > x0 ? (signed_reach < x1 ? signed_reach : x1) : x0;

  const double d_squared = xu * xu + z0_squared;
  const double h0 = y0 / __builtin_sqrt(d_squared + y0 * y0);
  const double h1 = y1 / __builtin_sqrt(d_squared + y1 * y1);
  const double hv = h0 + static_cast<double>(u.y) * (h1 - h0);
  const double cos_squared = 1.0 - hv * hv;
  const double yv = cos_squared > 1e-12 ? hv * __builtin_sqrt(d_squared / cos_squared) : y1;
  return light.P + x_axis * (static_cast<float>(xu) - cx) +
         y_axis * (clamp(static_cast<float>(yv), cy - half_y, cy + half_y) - cy);
}

/// What of a rectangle with a spread shines to a point, or a little more: a rectangle along the same axes.
/// @param storage  gets it
/// @return         null: nothing shines there
[[gnu::noinline]] RELIEF_KERNEL const Light* rectangle_light_part(const Light& light, Vec3f P, Light& storage)
{
  const Vec3f normal = cross(light.edge_u, light.edge_v);
  const float inv_squared = 1.0f / length_squared(normal), reach = light_spread_reach(light, P);
  float middle[2], half[2];
  const Vec3f duals[2] = {cross(light.edge_v, normal) * inv_squared, cross(normal, light.edge_u) * inv_squared};
  for (int i = 0; i < 2; ++i) {
    const float foot = dot(P - light.P, duals[i]), extent = reach * length(duals[i]);
    const float low = max(foot - extent, -1.0f), high = min(foot + extent, 1.0f);
    if (!(low < high)) return nullptr;
    middle[i] = 0.5f * (low + high);
    half[i] = 0.5f * (high - low);
  }
  storage = light;
  storage.P += light.edge_u * middle[0] + light.edge_v * middle[1];
  storage.edge_u *= half[0];
  storage.edge_v *= half[1];
  storage.area *= half[0] * half[1];
  return &storage;
}

/// @param u  [0, 1)²
/// @return   along the half axes, uniform by area
RELIEF_KERNEL Vec2f light_coordinates(RectangleLight, Vec2f u) { return {2.0f * u.x - 1.0f, 2.0f * u.y - 1.0f}; }

/// @param u  [0, 1)²
RELIEF_KERNEL LightSample light_sample(RectangleLight kind, const Light& light, Vec3f P, Vec2f u)
{
  if (!light_faces(light, P)) return {};
  Light storage;
  const Light* const part = light.spread_tan > 0.0f ? rectangle_light_part(light, P, storage) : &light;
  if (part == nullptr) return {};
  const float omega = rectangle_light_solid_angle(*part, P, part->area);
  if (omega > 0.0f) return light_point_sample(*part, P, rectangle_light_point(*part, P, omega, u), 1.0f / omega);
  const Vec2f q = light_coordinates(kind, u);
  return light_point_sample(*part, P, part->P + part->edge_u * q.x + part->edge_v * q.y);
}

/// Solid-angle density of light_sample.
RELIEF_KERNEL float light_pdf(RectangleLight, const Light& light, Vec3f P, Vec3f wi, float distance)
{
  if (!light_faces(light, P)) return 0.0f;
  Light storage;
  const Light* const part = light.spread_tan > 0.0f ? rectangle_light_part(light, P, storage) : &light;
  if (part == nullptr) return 0.0f;
  const float omega = rectangle_light_solid_angle(*part, P, part->area);
  return omega > 0.0f ? 1.0f / omega : light_area_pdf(*part, wi, distance);
}

RELIEF_KERNEL Vec3f light_half_extent(RectangleLight, const Light& light)
{
  return abs(light.edge_u) + abs(light.edge_v);
}

/// @return negative: a ray misses it
RELIEF_KERNEL float light_distance(RectangleLight, const Light& light, Vec3f O, Vec3f D)
{
  const PlateHit hit = plate_light_meet(light, O, D);
  return __builtin_fabsf(hit.q.x) <= 1.0f && __builtin_fabsf(hit.q.y) <= 1.0f ? hit.t : -1.0f;
}

RELIEF_KERNEL LightRay light_emit(RectangleLight kind, const Light& light, Vec2f u, Vec2f v, bool back)
{
  return plate_light_emit(light, light_coordinates(kind, u), v, back);
}

}  // namespace relief
