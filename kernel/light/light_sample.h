// What every kind of light answers when asked for light at a point, and the helpers the area kinds share.
#pragma once

#include "kernel/light/light.h"
#include "kernel/math/trigonometry.h"

namespace relief {

/// Light arriving at a point from one sampled direction. `pdf` 0: no sample (nothing arrives, or degenerate geometry).
struct LightSample {
  Vec3f wi{};          ///< unit, from the point to the light
  float distance = 0;  ///< metres; kInfinity for sun and environment
  Vec3f radiance{};    ///< incident, before visibility; delta kinds: times the solid angle, which is all there
                       ///< is to sample: intensity / distance², or irradiance
  float pdf = 0;       ///< solid angle × probability of the choice; delta kinds: probability of the choice alone
  bool delta = false;
  LightRef ref{};       ///< whose
  Vec2f barycentric{};  ///< triangle: weights of vertices 1 and 2
};

/// Radiance of a rectangle or disk with a spread, as a factor on that of the same power without: falls linearly with the tangent
/// of the angle to the axis, as light does between the slats of a grid.
/// @param cosine  of that angle
RELIEF_KERNEL float light_spread(const Light& light, float cosine)
{
  if (!(light.spread_tan > 0.0f)) return 1.0f;
  const float tangent = safe_sqrt(1.0f - sqr(cosine)) / __builtin_fabsf(cosine);
  return max(0.0f, (light.spread_tan - tangent) * light.spread_scale);
}

/// Radiance an area light sends against a ray that arrives at it.
/// @param wi  unit, direction of travel of the ray, towards the light
/// @return    0 on the back of a one-sided light and for the other kinds: see ball_light_emitted for points and spots
RELIEF_KERNEL Vec3f light_emitted(const Light& light, Vec3f wi)
{
  const bool area_kind =
      light.kind == LightKind::kRectangle || light.kind == LightKind::kDisk || light.kind == LightKind::kTriangle;
  if (!area_kind) return {};
  const float cosine = -dot(wi, light.axis);
  return light.two_sided || cosine > 0.0f ? light.emission * light_spread(light, cosine) : Vec3f{};
}

/// Whether a flat light's emitting side can be seen from a point; decided once for all its points.
RELIEF_KERNEL bool light_faces(const Light& light, Vec3f P)
{
  const float side = dot(P - light.P, light.axis);
  return side > 0.0f || (light.two_sided && side < 0.0f);
}

/// Whether a flat light is seen so wide, or so much from the side, that uniform sampling of its area is noisy and uniform
/// sampling of its solid angle worth its price (five times as many instructions): when P is nearer to its plane than its
/// longest edge is long. Farther away the density of area samples varies by less than a factor of eight across the light.
/// @param longest_edge_squared  m²
RELIEF_KERNEL bool light_is_wide(const Light& light, Vec3f P, float longest_edge_squared)
{
  return sqr(dot(light.P - P, light.axis)) < longest_edge_squared;
}

/// Solid-angle density, at P, of points chosen uniformly by area on a flat light.
/// @return 0 when the light is seen edge-on or has no area
RELIEF_KERNEL float light_area_pdf(const Light& light, Vec3f wi, float distance)
{
  const float projected = __builtin_fabsf(dot(wi, light.axis)) * light.area;
  const float pdf = sqr(distance) / projected;
  return is_finite(pdf) ? pdf : 0.0f;
}

/// The sample at P from one point of a flat light.
/// @param P_light            world, on the light
/// @param pdf_solid_angle    density of the point as seen from P; negative: chosen uniformly by area
RELIEF_KERNEL LightSample light_point_sample(const Light& light, Vec3f P, Vec3f P_light, float pdf_solid_angle = -1.0f)
{
  LightSample sample;
  const Vec3f to_light = P_light - P;
  const float squared = length_squared(to_light);
  // Closer, squares lose digits to underflow.
  if (!(squared > 1e-30f)) return sample;
  sample.distance = __builtin_sqrtf(squared);
  sample.wi = to_light / sample.distance;
  sample.radiance = light.emission * light_spread(light, dot(sample.wi, light.axis));
  sample.pdf = pdf_solid_angle >= 0.0f ? pdf_solid_angle : light_area_pdf(light, sample.wi, sample.distance);
  return sample;
}

/// Solid angle of a triangle seen from the origin.
/// @param a, b, c  its vertices
/// @param det      a · ((b − a) × (c − a)): handed in because callers know a form without cancellation
/// @return         [0, 2π], with a relative error of a few ulps even when tiny
/// @source Van Oosterom and Strackee 1983, Eq. 8
RELIEF_KERNEL float triangle_solid_angle(Vec3f a, Vec3f b, Vec3f c, float det)
{
  const float la = length(a), lb = length(b), lc = length(c);
  const float denominator = la * lb * lc + dot(a, b) * lc + dot(a, c) * lb + dot(b, c) * la;
  return 2.0f * angle_of(__builtin_fabsf(det), denominator);
}

}  // namespace relief
