// What flat lights share: rectangles, disks, and triangles of meshes shine from one side or both, with the same radiance from
// all their points. Rectangles and disks stand by themselves (PlateLight), as a centre and two half axes.
#pragma once

#include <initializer_list>

#include "kernel/light/light_sample.h"

namespace relief {

struct FlatLight {
  static constexpr LightBody kBody = LightBody::kMesh;
  static constexpr bool kIsQuad = false;  ///< a parallelogram, and nothing else
};

struct PlateLight : FlatLight {
  static constexpr LightBody kBody = LightBody::kOwn;
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

/// Radiance a flat light sends against a ray that arrives at it.
/// @param wi  unit, direction of travel of the ray, towards the light
/// @return    0 on the back of a one-sided light
RELIEF_KERNEL Vec3f light_emitted(FlatLight, const Light& light, Vec3f wi)
{
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

/// @param emission     see light_bounds.h
/// @param low, high    world
RELIEF_KERNEL LightBounds flat_light_bounds(const Light& light, float emission, Vec3f low, Vec3f high)
{
  LightBounds bounds;
  bounds.low = low;
  bounds.high = high;
  // A side that is within its own mesh is hardly worth choosing.
  const bool two_sided = light.two_sided && light.dark_side == 0;
  bounds.spread = {light.dark_side > 0 ? -light.axis : light.axis, 0.0f};
  bounds.falloff = 0.5f * kPi;
  bounds.intensity = emission * light.area;
  bounds.two_sided = two_sided;
  bounds.has_dim_side = light.dark_side == 1 || light.dark_side == -1;
  LightProfile profile = two_sided ? kTwoSidedProfile : kFlatProfile;
  bounds.is_flat = true;
  if (light.spread_tan > 0.0f) {
    // Brighter along the axis, and nothing beyond the spread. A narrow beam is as bright near by as far away, and estimates do not
    // know how narrow: by all of its intensity it would be chosen where it does not shine, and no other lamp.
    constexpr float kMostPeak = 8.0f;
    bounds.falloff = std::atan(light.spread_tan);
    bounds.intensity *= min(light.spread_tan * light.spread_scale, kMostPeak);
    profile = light_cone_profile(std::cos(0.5f * bounds.falloff));
    if (two_sided) profile = {2.0f * profile.mean, 0.0f};
    bounds.is_flat = false;
  }
  light_bounds_add_profile(bounds, profile);
  return bounds;
}

RELIEF_KERNEL LightBounds light_bounds(PlateLight, const Light& light, float emission)
{
  Vec3f low = splat3(kInfinity), high = splat3(-kInfinity);
  for (const float u : {-1.0f, 1.0f}) {
    for (const float v : {-1.0f, 1.0f}) {
      const Vec3f P = light.P + light.edge_u * u + light.edge_v * v;
      low = min(low, P);
      high = max(high, P);
    }
  }
  return flat_light_bounds(light, emission, low, high);
}

RELIEF_KERNEL bool light_is_met(PlateLight, const Light&) { return true; }

/// Where a ray meets a plate's plane.
struct PlateHit {
  float t = 0;  ///< may be negative or no number
  Vec2f q;      ///< coordinates along the half axes, by their dual basis
};

/// @param D  of any length
RELIEF_KERNEL PlateHit plate_light_meet(const Light& light, Vec3f O, Vec3f D)
{
  const Vec3f normal = cross(light.edge_u, light.edge_v);
  const float normal_squared = length_squared(normal);
  const Vec3f dual_u = cross(light.edge_v, normal) / normal_squared;
  const Vec3f dual_v = cross(normal, light.edge_u) / normal_squared;
  const float t = dot(light.P - O, normal) / dot(D, normal);
  const Vec3f from_center = O + D * t - light.P;
  return {t, {dot(from_center, dual_u), dot(from_center, dual_v)}};
}

RELIEF_KERNEL LightPlace light_place(PlateLight, const Light& light, Vec3f P, Vec3f) { return {P, light.axis}; }

/// Across the plate, 0 to 1, the second one up.
RELIEF_KERNEL Vec2f light_uv(PlateLight, const Light& light, const Affine3&, LightPlace at, Vec3f)
{
  const Vec3f q = at.P - light.P, normal = cross(light.edge_u, light.edge_v);
  const float scale = 0.5f / length_squared(normal);
  return {0.5f + scale * dot(cross(q, light.edge_v), normal), 0.5f + scale * dot(cross(light.edge_u, q), normal)};
}

/// How far from the foot of a point on a plate's plane that still shines to it, of a light with a spread; metres.
RELIEF_KERNEL float light_spread_reach(const Light& light, Vec3f P)
{
  return light.spread_tan * __builtin_fabsf(dot(P - light.P, light.axis));
}

/// @param q     place, in coordinates along the half axes
/// @param v     [0, 1)²: direction
/// @param back  of two sides, the other one
RELIEF_KERNEL LightRay plate_light_emit(const Light& light, Vec2f q, Vec2f v, bool back)
{
  Vec3f local = warp_cosine_hemisphere(v);
  float weight = 1.0f;
  if (light.spread_tan > 0.0f) {
    // Within the spread alone.
    const float sine_squared = sqr(light.spread_tan) / (1.0f + sqr(light.spread_tan)),
                sine = __builtin_sqrtf(sine_squared);
    local = {local.x * sine, local.y * sine, __builtin_sqrtf(1.0f - sine_squared * (sqr(local.x) + sqr(local.y)))};
    weight = sine_squared * light_spread(light, local.z);
  }
  const Vec3f axis = light.two_sided && back ? -light.axis : light.axis;
  const Vec3f P = light.P + light.edge_u * q.x + light.edge_v * q.y;
  return {P, from_local(frame_from_normal(axis), local), weight};
}

}  // namespace relief
