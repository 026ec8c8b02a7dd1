// Rectangle light: sampled uniformly in the solid angle it covers, so that neither distance nor tilt across a large
// light adds variance. Parallelograms with oblique axes, and lights so small that it makes no difference, are sampled by
// area. Source: Ureña, Fajardo and King 2013, "An Area-Preserving Parametrization for Spherical Rectangles".
#pragma once

#include "kernel/light/light_sample.h"

namespace relief {

/// Below this solid angle (sr) the angles of the spherical rectangle, whose float error is a few 1e-7, no longer place a
/// point to a thousandth of the light's width, while sampling by area is already uniform within a few per cent.
inline constexpr float kRectangleMinSolidAngle = 5e-4f;

/// Solid angle that selects and drives the sampling: the one decision `sample` and `pdf` must agree on.
/// @return steradians; 0: sample by area
RELIEF_KERNEL float rectangle_light_solid_angle(const Light& light, Vec3f P)
{
  const float skew = dot(light.edge_u, light.edge_v);
  if (!(sqr(skew) <= 1e-8f * length_squared(light.edge_u) * length_squared(light.edge_v))) return 0.0f;
  const Vec3f centre = light.P - P;
  const Vec3f c00 = centre - light.edge_u - light.edge_v;
  const Vec3f c10 = centre + light.edge_u - light.edge_v;
  const Vec3f c11 = centre + light.edge_u + light.edge_v;
  const Vec3f c01 = centre - light.edge_u + light.edge_v;
  const float det = dot(centre, light.axis) * light.area;
  const float omega = triangle_solid_angle(c00, c10, c11, det) + triangle_solid_angle(c00, c11, c01, det);
  return omega >= kRectangleMinSolidAngle ? omega : 0.0f;
}

/// Point of a rectangle, uniform in the solid angle seen from P.
/// @param omega  that solid angle, sr
/// @param u      [0, 1)²
/// @return       world
/// @source Ureña et al. 2013, Fig. 4; angles from edge planes, solid angle handed in (theirs, the angles' excess, loses
///         the digits of small lights)
RELIEF_KERNEL Vec3f rectangle_light_point(const Light& light, Vec3f P, float omega, Vec2f u)
{
  const float half_x = length(light.edge_u), half_y = length(light.edge_v);
  const Vec3f x_axis = light.edge_u / half_x, y_axis = light.edge_v / half_y;
  const Vec3f centre = light.P - P;
  const float cx = dot(centre, x_axis), cy = dot(centre, y_axis);
  const float x0 = cx - half_x, x1 = cx + half_x, y0 = cy - half_y, y1 = cy + half_y;
  // The paper looks down the negative z axis; the side of the plane does not matter to x and y.
  const float z0 = -__builtin_fabsf(dot(centre, light.axis));

  // z components of the unit normals of the planes through P and the bottom, top and left edge.
  const float z0_squared = sqr(z0);
  const float n0 = -y0 / __builtin_sqrtf(z0_squared + sqr(y0));
  const float n2 = y1 / __builtin_sqrtf(z0_squared + sqr(y1));
  const float n3 = -x0 / __builtin_sqrtf(z0_squared + sqr(x0));
  const float g2 = std::acos(clamp(-n2 * n3, -1.0f, 1.0f));
  const float g3 = std::acos(clamp(-n3 * n0, -1.0f, 1.0f));

  const float k = 2.0f * kPi - g2 - g3;
  const float au = u.x * omega + k;
  const float sin_au = std::sin(au);
  const float fu = (std::cos(au) * n0 - n2) / sin_au;
  const float cu_length = __builtin_sqrtf(sqr(fu) + sqr(n0));
  const float cu = clamp(__builtin_copysignf(1.0f / cu_length, fu), -1.0f, 1.0f);
  const float xu = clamp(-(cu * z0) / __builtin_sqrtf(max(1.0f - sqr(cu), 1e-12f)), x0, x1);

  const float d_squared = sqr(xu) + z0_squared;
  const float h0 = y0 / __builtin_sqrtf(d_squared + sqr(y0));
  const float h1 = y1 / __builtin_sqrtf(d_squared + sqr(y1));
  const float hv = lerp(u.y, h0, h1);
  const float cos_squared = 1.0f - sqr(hv);
  const float yv = cos_squared > 1e-6f ? hv * __builtin_sqrtf(d_squared / cos_squared) : y1;
  return light.P + x_axis * (xu - cx) + y_axis * (clamp(yv, y0, y1) - cy);
}

/// @param u  [0, 1)²
RELIEF_KERNEL LightSample rectangle_light_sample(const Light& light, Vec3f P, Vec2f u)
{
  if (!light_faces(light, P)) return {};
  const float omega = rectangle_light_solid_angle(light, P);
  if (omega > 0.0f) return light_point_sample(light, P, rectangle_light_point(light, P, omega, u), 1.0f / omega);
  return light_point_sample(light, P,
                            light.P + light.edge_u * (2.0f * u.x - 1.0f) + light.edge_v * (2.0f * u.y - 1.0f));
}

/// Solid-angle density of rectangle_light_sample.
RELIEF_KERNEL float rectangle_light_pdf(const Light& light, Vec3f P, Vec3f wi, float distance)
{
  if (!light_faces(light, P)) return 0.0f;
  const float omega = rectangle_light_solid_angle(light, P);
  return omega > 0.0f ? 1.0f / omega : light_area_pdf(light, wi, distance);
}

}  // namespace relief
