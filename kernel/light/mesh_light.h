// One triangle of an emissive mesh: sampled by area from afar, uniformly in the solid angle it covers from near.
// Source: Arvo 1995, "Stratified Sampling of Spherical Triangles".
#pragma once

#include "kernel/light/flat.h"

namespace relief {

struct TriangleLight : FlatLight {};

/// Below this solid angle (sr), unit vectors to the vertices differ by less than 1e-2 and their differences keep too few
/// digits; sampling by area is then as good.
inline constexpr float kTriangleMinSolidAngle = 1e-4f;

/// @return steradians; 0: sample by area
RELIEF_KERNEL float triangle_light_solid_angle(const Light& light, Vec3f P)
{
  const float longest_edge_squared =
      max(max(length_squared(light.edge_u), length_squared(light.edge_v)), length_squared(light.edge_u - light.edge_v));
  if (!light_is_wide(light, P, longest_edge_squared)) return 0.0f;
  const Vec3f a = light.P - P;
  const float det = 2.0f * light.area * dot(a, light.axis);
  const float omega = triangle_solid_angle(a, a + light.edge_u, a + light.edge_v, det);
  return omega >= kTriangleMinSolidAngle ? omega : 0.0f;
}

/// Direction uniform in the solid angle of a triangle.
/// @param A, B, C  unit directions to the vertices
/// @param omega    solid angle, sr
/// @param u        [0, 1)²
/// @return         unit
/// @source Arvo 1995: a sub-triangle ABC' of area u.x·omega with C' on the arc AC, then a point on the arc BC'. Where he
///         finds C' by the angles at the corners, we solve tan(area / 2) = det / (1 + A·B + B·C' + A·C') for
///         C' = A cos t + T sin t, which is linear in tan(t / 2): no inverse cosine, no sum of angles to cancel.
RELIEF_KERNEL Vec3f triangle_light_direction(Vec3f A, Vec3f B, Vec3f C, float omega, Vec2f u)
{
  const Vec3f T = normalize(C - A * dot(A, C));
  const float half_area = 0.5f * omega * u.x;
  const SinCos half = sin_cos_turn(half_area * (0.5f * kInvPi));
  const float q = (1.0f + dot(A, B)) * half.sin;
  const float p = __builtin_fabsf(dot(cross(A, B), T)) * half.cos - dot(B, T) * half.sin;
  const float scale = 1.0f / (sqr(p) + sqr(q));
  const Vec3f C_sub = A * ((sqr(p) - sqr(q)) * scale) + T * (2.0f * p * q * scale);

  // Cosine along the arc BC' uniform in [B·C', 1], kept as 1 − cosine.
  const float z = u.y * 0.5f * length_squared(B - C_sub);
  const Vec3f across = C_sub - B * dot(B, C_sub);
  const float across_squared = length_squared(across);
  if (!(across_squared > 0.0f)) return B;
  return B * (1.0f - z) + across * safe_sqrt(z * (2.0f - z) / across_squared);
}

/// @param u  [0, 1)²
/// @return   along the edges, uniform by area
RELIEF_KERNEL Vec2f light_coordinates(TriangleLight, Vec2f u) { return warp_triangle(u); }

/// @param u  [0, 1)²
RELIEF_KERNEL LightSample light_sample(TriangleLight, const Light& light, Vec3f P, Vec2f u)
{
  if (!light_faces(light, P)) return {};
  Vec2f barycentric;
  float pdf = -1.0f;
  const float omega = triangle_light_solid_angle(light, P);
  if (omega > 0.0f) {
    const Vec3f a = light.P - P;
    const Vec3f wi =
        triangle_light_direction(normalize(a), normalize(a + light.edge_u), normalize(a + light.edge_v), omega, u);
    const float t = dot(a, light.axis) / dot(wi, light.axis);
    const Vec3f in_plane = wi * t - a;
    const Vec3f normal = cross(light.edge_u, light.edge_v);
    const float scale = 1.0f / length_squared(normal);
    barycentric.x = clamp(dot(cross(in_plane, light.edge_v), normal) * scale, 0.0f, 1.0f);
    barycentric.y = clamp(dot(cross(light.edge_u, in_plane), normal) * scale, 0.0f, 1.0f - barycentric.x);
    pdf = 1.0f / omega;
  } else {
    // Fold of the square onto the triangle that keeps strata compact.
    // Heitz 2019, "A Low-Distortion Map Between Triangle and Square".
    const float shift = 0.5f * min(u.x, u.y);
    barycentric = {u.x < u.y ? shift : u.x - shift, u.x < u.y ? u.y - shift : shift};
  }
  LightSample sample =
      light_point_sample(light, P, light.P + light.edge_u * barycentric.x + light.edge_v * barycentric.y, pdf);
  sample.barycentric = barycentric;
  return sample;
}

/// Solid-angle density of light_sample.
RELIEF_KERNEL float light_pdf(TriangleLight, const Light& light, Vec3f P, Vec3f wi, float distance)
{
  if (!light_faces(light, P)) return 0.0f;
  const float omega = triangle_light_solid_angle(light, P);
  return omega > 0.0f ? 1.0f / omega : light_area_pdf(light, wi, distance);
}

RELIEF_KERNEL LightBounds light_bounds(TriangleLight, const Light& light, float emission)
{
  const Vec3f P1 = light.P + light.edge_u, P2 = light.P + light.edge_v;
  return flat_light_bounds(light, emission, min(min(light.P, P1), P2), max(max(light.P, P1), P2));
}

}  // namespace relief
