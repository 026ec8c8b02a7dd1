// Points on curves: splines of Catmull and Rom with a radius at each point, as tubes or as ribbons that face the ray. How their
// vertices stand in a mesh is said at Mesh in scene/scene.h; Embree meets them (integrator/accel.cpp). And single points, which are
// balls.
#pragma once

#include "kernel/shape/surface_hit.h"

namespace relief {

/// Weights of a segment's four vertices.
struct CurveBasis {
  float w[4];

  template <typename T>
  T of(const T (&value)[4]) const
  {
    return value[0] * w[0] + value[1] * w[1] + value[2] * w[2] + value[3] * w[3];
  }
};

/// @param u  along the segment, 0 to 1
RELIEF_KERNEL CurveBasis curve_basis(float u)
{
  const float s = 1.0f - u;
  return {{-0.5f * u * s * s, 0.5f * (2.0f + u * u * (3.0f * u - 5.0f)), 0.5f * (2.0f + s * s * (3.0f * s - 5.0f)),
           -0.5f * s * u * u}};
}

/// Derivatives of the weights by u.
RELIEF_KERNEL CurveBasis curve_basis_derivative(float u)
{
  const float s = 1.0f - u;
  return {{-0.5f * s * (s - 2.0f * u), 0.5f * u * (9.0f * u - 10.0f), -0.5f * s * (9.0f * s - 10.0f),
           -0.5f * u * (2.0f * s - u)}};
}

/// Direction of a curve: world, unit.
/// @param u   along the segment
/// @param wo  unit: where a curve turns back on itself it has no direction, and any across the ray will do
[[gnu::noinline]] RELIEF_KERNEL Vec3f
curve_tangent(const MeshView& mesh, const InstanceView& instance, std::uint32_t segment, float u, Vec3f wo)
{
  const std::uint32_t first = mesh.triangles[segment].v0 - 1;
  const Vec3f P[4] = {mesh_P(mesh, first), mesh_P(mesh, first + 1), mesh_P(mesh, first + 2), mesh_P(mesh, first + 3)};
  const Vec3f along = transform_vector(instance.world_from_object, curve_basis_derivative(u).of(P));
  const float width = length_squared(along);
  return width > 0.0f ? along * (1.0f / __builtin_sqrtf(width)) : frame_from_normal(wo).s;
}

/// Radius of a curve between the ends of a segment: world, metres, the mean over the directions of an uneven scale.
/// @param u  along the segment
RELIEF_KERNEL float curve_radius(const MeshView& mesh, const InstanceView& instance, std::uint32_t segment, float u)
{
  const std::uint32_t first = mesh.triangles[segment].v0;
  const Affine3& m = instance.world_from_object;
  const float volume = __builtin_fabsf(dot(m.x, cross(m.y, m.z)));
  return lerp(u, mesh.radius[first], mesh.radius[first + 1]) * std::cbrt(volume);
}

/// The point where a ray meets a curve, or a ball.
///
/// Rays meet tubes from outside only (a filter lets those through that leave), so what goes on inside starts just below. A ribbon
/// is a tube to shading: its normal turns from edge to edge as a tube's does, and what is behind it is asked of the ray.
/// @param u, v     along the segment; across a ribbon, from -1 to 1
/// @param P_ray    where the ray met it, world
/// @param wo       unit, back along the ray
/// @source  the normals are Cycles'
[[gnu::noinline]] RELIEF_KERNEL SurfaceHit surface_hit_curve(const MeshView& mesh,
                                                             const InstanceView& instance,
                                                             std::uint32_t segment,
                                                             float u,
                                                             float v,
                                                             Vec3f P_ray,
                                                             Vec3f wo)
{
  const TriangleIndices ends = mesh.triangles[segment];
  const bool is_point = (instance.flags & kPoints) != 0;
  const Affine3& m = instance.world_from_object;
  const Affine3& inverse = instance.object_from_world;
  Vec3f P[4];
  for (std::uint32_t i = 0; i < 4; ++i) {
    P[i] = mesh_P(mesh, is_point ? ends.v0 : ends.v0 - 1 + i);
  }
  const CurveBasis at = curve_basis(is_point ? 0.0f : u);
  const Vec3f centre = at.of(P);

  SurfaceHit hit;
  hit.P = P_ray;
  const Vec3f size = abs(P_ray);
  const auto abs_transform = [](const Affine3& by, Vec3f d) {
    return abs(by.x) * d.x + abs(by.y) * d.y + abs(by.z) * d.z;
  };
  hit.P_error = gamma_bound(8) * (size + abs(m.p) + abs_transform(m, abs_transform(inverse, size) + abs(inverse.p)));
  Vec3f away;  // unit, from the curve
  if ((instance.flags & kRibbons) != 0) {
    // Embree's ribbon faces the ray in object space, and is v wide there. Its sides go through an uneven scale as normals.
    const Vec3f along = curve_basis_derivative(u).of(P);
    const Vec3f across = cross(along, transform_vector(inverse, wo));
    const float sine = length(across);
    const Vec3f side = sine > 0.0f ? across / sine : frame_from_normal(wo).s;
    const Vec3f facing = cross(side, along);
    const float width = length(facing);
    const Vec3f above = width > 0.0f ? facing / width : cross(side, wo);
    const auto to_world = [&](Vec3f n) { return normalize(transform_normal(inverse, as_normal(n))); };
    away = to_world(above);
    hit.Ng = wo;
    hit.Ns = to_world(v * side + safe_sqrt(1.0f - v * v) * above);
  } else {
    const Vec3f out = transform_point(inverse, P_ray) - centre;
    away = hit.Ng = hit.Ns = is_zero(out) ? wo : normalize(transform_normal(inverse, as_normal(out)));
  }
  // Of its own curve a ray meets nothing (curve_name in integrator/ray_surface.h), wherever it starts.
  hit.leave = away * (4.0f * length(hit.P_error));
  surface_hit_interpolate(mesh, ends, is_point ? 0.0f : u, 0.0f, &hit);
  return hit;
}

}  // namespace relief
