// From (instance, triangle, barycentric) to everything shading needs to know of the point, with a bound on the error
// of its position. The position is recomputed from the triangle, never from O + t·D, so that its error does not grow
// with the distance to the ray's origin (pbrt-v4 §6.8).
#pragma once

#include "kernel/math/rounding.h"
#include "kernel/shape/mesh_view.h"
#include "kernel/shape/triangle_lift.h"

namespace relief {

/// A point on a triangle mesh in world space.
struct SurfaceHit {
  Vec3f P;        ///< world, metres
  Vec3f P_error;  ///< bound on |error of P|, per axis, metres
  Vec3f Ng;       ///< unit geometric normal, on the front side (counter-clockwise winding)
  Vec3f Ns;       ///< unit interpolated shading normal, same side as Ng on the whole; = Ng for flat meshes
  Vec2f uv[2];    ///< texture coordinates; (0, 0) where absent
  Vec4f color{1, 1, 1, 1};
  float area_ratio[2] = {0, 0};  ///< √(uv area / world area) of the triangle: uv units a metre, for texture footprints
  TriangleLift lift{};           ///< see triangle_lift; 0 for flat meshes
  Vec3f leave{};  ///< how rays' origins are moved to the front side, metres; 0: along Ng, by P_error
  Vec3f clear{};  ///< how they are moved first, along the triangle: see triangle_clearance
};

/// Of what triangle_clearance moves.
///
/// The sharper the edge, the farther from it a height above one triangle is clear of the other; what the point errs along the
/// triangle counts once. Of 50 million hits on what ClosedMesh.NoPathGetsOutPastAnEdge has, 18 let rays out with 0 in place of
/// 16, one with 8. With the error itself in place of the height, 8 of it cut shadows of a scene 100 km from the origin along
/// the diagonals of squares.
inline constexpr float kClearedHeights = 16.0f;
/// Of triangles as small as the error nothing is told apart: their rays still leave from near where they were met.
inline constexpr float kMostClearanceWeight = 1.0f / 16.0f;

/// Vector along a triangle from a point next to its edge to one that is clear of it: the triangle beyond an edge may be nearer
/// than rays' origins are moved, which would put them behind it.
/// @param w             barycentric weights of the point
/// @param edge1, edge2  from vertex 0 to vertices 1 and 2
/// @param Ng            unit
/// @param error         bound on the point's error, per axis
/// @return              0 where all edges are far enough
RELIEF_KERNEL Vec3f
triangle_clearance(Vec3f w, Vec3f edge1, Vec3f edge2, float double_area, Vec3f Ng, Vec3f error)
{
  const Vec3f across = abs(edge1) + abs(edge2);
  const float clearance = kClearedHeights * 2.0f * dot(abs(Ng), error) + length(error);
  const float margin = clearance * (across.x + across.y + across.z);  // a weight, by the double area
  if (!(min_component(w) * double_area < margin)) [[likely]] return {};
  const float least = min(margin / double_area, kMostClearanceWeight);
  return (least - 3.0f * least * w.y) * edge1 + (least - 3.0f * least * w.z) * edge2;
}

/// Writes the mesh's texture coordinates and colour at a point to a hit.
/// @param bary_u, bary_v  barycentric weights of vertices 1 and 2
RELIEF_KERNEL void surface_hit_interpolate(const MeshView& mesh,
                                           TriangleIndices tri,
                                           float bary_u,
                                           float bary_v,
                                           SurfaceHit* hit)
{
  const float w0 = 1.0f - bary_u - bary_v;
  for (int set = 0; set < 2; ++set) {
    if (mesh.uv[set] == nullptr) continue;
    hit->uv[set] = w0 * mesh.uv[set][tri.v0] + bary_u * mesh.uv[set][tri.v1] + bary_v * mesh.uv[set][tri.v2];
  }
  if (mesh.color != nullptr) {
    const Vec4f a = mesh.color[tri.v0], b = mesh.color[tri.v1], c = mesh.color[tri.v2];
    hit->color = {w0 * a.x + bary_u * b.x + bary_v * c.x, w0 * a.y + bary_u * b.y + bary_v * c.y,
                  w0 * a.z + bary_u * b.z + bary_v * c.z, w0 * a.w + bary_u * b.w + bary_v * c.w};
  }
}

/// Writes how dense texture coordinates are over a triangle, see SurfaceHit::area_ratio.
/// @param double_area  of the triangle in the world
RELIEF_KERNEL void surface_hit_density(const MeshView& mesh, TriangleIndices tri, float double_area, SurfaceHit* hit)
{
  for (int set = 0; set < 2; ++set) {
    if (mesh.uv[set] == nullptr) continue;
    const Vec2f t0 = mesh.uv[set][tri.v0], du = mesh.uv[set][tri.v1] - t0, dv = mesh.uv[set][tri.v2] - t0;
    hit->area_ratio[set] =
        __builtin_sqrtf(__builtin_fabsf(difference_of_products(du.x, dv.y, du.y, dv.x)) / double_area);
  }
}

/// Evaluates the triangle's attributes at a hit.
/// @param bary_u, bary_v  barycentric weights of vertices 1 and 2
/// @source position error: pbrt-v4 §6.8.5 and Eq. 6.24
RELIEF_KERNEL SurfaceHit surface_hit_make(const MeshView& mesh,
                                          const InstanceView& instance,
                                          std::uint32_t triangle_index,
                                          float bary_u,
                                          float bary_v)
{
  const TriangleIndices tri = mesh.triangles[triangle_index];
  const float w0 = 1.0f - bary_u - bary_v;
  const Affine3& m = instance.world_from_object;
  const Vec3f p0 = mesh_P(mesh, tri.v0);
  const Vec3f p1 = mesh_P(mesh, tri.v1);
  const Vec3f p2 = mesh_P(mesh, tri.v2);

  SurfaceHit hit;
  const Vec3f P_object = w0 * p0 + bary_u * p1 + bary_v * p2;
  const Vec3f P_object_sum = abs(w0 * p0) + abs(bary_u * p1) + abs(bary_v * p2);
  hit.P = transform_point(m, P_object);
  const auto abs_transform = [](const Affine3& by, Vec3f v) {
    return abs(by.x) * v.x + abs(by.y) * v.y + abs(by.z) * v.z;
  };
  hit.P_error = (1.0f + gamma_bound(3)) * gamma_bound(7) * abs_transform(m, P_object_sum) +
                gamma_bound(3) * (abs_transform(m, P_object_sum) + abs(m.p));
  if ((instance.flags & kTracedInObjectSpace) != 0) {
    // The tracer brings the ray to object space; its rounding there, seen from the world. Far from the origin this is
    // more than the error of P itself, and it is not aligned with the world's axes (test SelfIntersection).
    const Affine3& inverse = instance.object_from_world;
    hit.P_error += gamma_bound(6) * abs_transform(m, abs_transform(inverse, abs(hit.P)) + abs(inverse.p));
  }

  const Vec3f edge1 = transform_vector(m, p1 - p0);
  const Vec3f edge2 = transform_vector(m, p2 - p0);
  Vec3f normal_area = cross(edge1, edge2);
  if ((instance.flags & kMirrored) != 0) normal_area = -normal_area;
  const float double_area = length(normal_area);
  hit.Ng = normal_area / double_area;
  hit.clear = triangle_clearance({w0, bary_u, bary_v}, edge1, edge2, double_area, hit.Ng, hit.P_error);

  hit.Ns = hit.Ng;
  if (mesh.N != nullptr) {
    const Vec3f n0 = normalize(transform_normal(instance.object_from_world, mesh_N(mesh, tri.v0)));
    const Vec3f n1 = normalize(transform_normal(instance.object_from_world, mesh_N(mesh, tri.v1)));
    const Vec3f n2 = normalize(transform_normal(instance.object_from_world, mesh_N(mesh, tri.v2)));
    const Vec3f n = w0 * n0 + bary_u * n1 + bary_v * n2;
    const float n_length = length(n);
    // Opposite vertex normals can cancel; then the flat normal is the only defensible one.
    if (n_length > 1e-6f) hit.Ns = n / n_length;
    const LiftHeights<float> lift = triangle_lift(w0, bary_u, bary_v, edge1, edge2, n0, n1, n2);
    hit.lift = {n, lift.front, lift.back};
  }

  surface_hit_interpolate(mesh, tri, bary_u, bary_v, &hit);
  surface_hit_density(mesh, tri, double_area, &hit);
  return hit;
}

/// Bounds on the error of a point of a displaced surface, per axis, metres.
struct DisplacedPointError {
  Vec3f world;
  Vec3f object;  ///< of the place that the tracer takes it for
};

/// The rounding of the point, that of its transform, and of the tracer's when it brings a ray from there to object space.
/// @param P_object  rounded once
/// @param P_world   the same, transformed
RELIEF_KERNEL DisplacedPointError displaced_point_error(const InstanceView& instance, Vec3f P_object, Vec3f P_world)
{
  const Affine3& m = instance.world_from_object;
  const Affine3& inverse = instance.object_from_world;
  const auto abs_transform = [](const Affine3& by, Vec3f v) {
    return abs(by.x) * v.x + abs(by.y) * v.y + abs(by.z) * v.z;
  };
  const Vec3f forth = gamma_bound(5) * (abs_transform(m, abs(P_object)) + abs(m.p));
  const Vec3f back = gamma_bound(6) * (abs_transform(inverse, abs(P_world)) + abs(inverse.p));
  return {forth + abs_transform(m, back), abs_transform(inverse, forth) + back};
}

/// Bound on how far from the surface the tracer of displaced triangles meets it, per axis, metres.
///
/// Its doubles have errors in proportion to the size of the triangle, whatever single coordinates are: a floor at height 0
/// is met 10⁻¹⁶ of its size above or below (test DisplacedSelfIntersection.LevelGroundAtZeroIsLeft). Elsewhere this is
/// nothing beside a float's rounding.
RELIEF_KERNEL Vec3f displaced_tracer_error(const MeshView& mesh, const InstanceView& instance, TriangleIndices tri)
{
  constexpr float kRoundings = 0x1p-47f;  // 64 of a double; 8 were not enough for all of 10⁵ rays, 16 were
  const Vec3f farthest = max(max(abs(mesh.P[tri.v0]), abs(mesh.P[tri.v1])), abs(mesh.P[tri.v2]));
  const float error = kRoundings * max_component(farthest);
  const Affine3& m = instance.world_from_object;
  return (abs(m.x) + abs(m.y) + abs(m.z)) * error;
}

/// A point of the displaced surface, as its tracer has it, object space where nothing else is said.
struct DisplacedSurface {
  Vec3f P;      ///< rounded once
  Vec3f Ng;     ///< unit geometric normal, on the side of the displacement normal
  Vec3f Ns;     ///< unit shading normal, likewise
  Vec3f leave;  ///< see SurfaceHit::leave
  TriangleLift lift{};  ///< world space
};

/// As surface_hit_make, on the displaced surface over the triangle. Texture coordinates and colours are the triangle's.
RELIEF_KERNEL SurfaceHit surface_hit_displaced(const MeshView& mesh,
                                               const InstanceView& instance,
                                               std::uint32_t triangle_index,
                                               float bary_u,
                                               float bary_v,
                                               const DisplacedSurface& at)
{
  const TriangleIndices tri = mesh.triangles[triangle_index];
  const Affine3& m = instance.world_from_object;
  const Affine3& inverse = instance.object_from_world;
  SurfaceHit hit;
  hit.P = transform_point(m, at.P);
  hit.P_error = displaced_point_error(instance, at.P, hit.P).world + displaced_tracer_error(mesh, instance, tri);
  hit.Ng = normalize(transform_normal(inverse, as_normal(at.Ng)));
  hit.Ns = normalize(transform_normal(inverse, as_normal(at.Ns)));
  hit.lift = at.lift;
  hit.leave = transform_vector(m, at.leave);
  surface_hit_interpolate(mesh, tri, bary_u, bary_v, &hit);
  const Vec3f p0 = mesh.P[tri.v0];
  const Vec3f edge1 = transform_vector(m, mesh.P[tri.v1] - p0), edge2 = transform_vector(m, mesh.P[tri.v2] - p0);
  surface_hit_density(mesh, tri, length(cross(edge1, edge2)), &hit);
  return hit;
}

/// Interpolated tangent frame of a normal map, world space, orthogonal to Ns.
/// @return false where the mesh has no tangents or the tangent vanishes
RELIEF_KERNEL bool surface_hit_tangent_frame(const MeshView& mesh,
                                             const InstanceView& instance,
                                             std::uint32_t triangle_index,
                                             float bary_u,
                                             float bary_v,
                                             Vec3f Ns,
                                             Frame* frame)
{
  if (mesh.tangent == nullptr) return false;
  const TriangleIndices tri = mesh.triangles[triangle_index];
  const float w0 = 1.0f - bary_u - bary_v;
  const Vec3f tangent_object =
      w0 * xyz(mesh.tangent[tri.v0]) + bary_u * xyz(mesh.tangent[tri.v1]) + bary_v * xyz(mesh.tangent[tri.v2]);
  Vec3f tangent = transform_vector(instance.world_from_object, tangent_object);
  tangent = tangent - Ns * dot(tangent, Ns);
  const float squared = length_squared(tangent);
  if (!(squared > 0.0f)) return false;
  tangent = tangent * (1.0f / __builtin_sqrtf(squared));
  float handedness = mesh.tangent[tri.v0].w < 0.0f ? -1.0f : 1.0f;
  if ((instance.flags & kMirrored) != 0) handedness = -handedness;
  *frame = {tangent, cross(Ns, tangent) * handedness, Ns};
  return true;
}

/// Moves the origin of a ray, each coordinate a few ulps further: that covers the rounding of the sum.
RELIEF_KERNEL Vec3f move_ray_origin(Vec3f P, Vec3f offset)
{
  const auto nudge = [](float p, float o) {
    const float moved = p + o;
    return moved + __builtin_copysignf(__builtin_fabsf(moved) * 2.0f * kUnitRoundoff, o);
  };
  return {nudge(P.x, offset.x), nudge(P.y, offset.y), nudge(P.z, offset.z)};
}

/// Origin for a ray that leaves the surface on the side of `Ng_side`.
/// The plane through P may lie anywhere within the error box; the origin is moved out of it along the normal, then each
/// coordinate is rounded away. Twice the bound, because the tracer meets the triangle with errors of the same size in
/// its own arithmetic (vertices minus origin; instance transforms).
/// @param Ng_side  unit geometric normal, turned to the side the ray leaves on
/// @source pbrt-v4 §6.8.6
RELIEF_KERNEL Vec3f offset_ray_origin(Vec3f P, Vec3f P_error, Vec3f Ng_side)
{
  return move_ray_origin(P, 2.0f * dot(abs(Ng_side), P_error) * Ng_side);
}

/// Origin for a ray that leaves a hit.
/// @param P      of the hit, lifted or not
/// @param front  whether it leaves on the front side
RELIEF_KERNEL Vec3f surface_hit_origin(const SurfaceHit& hit, Vec3f P, bool front)
{
  if (!is_zero(hit.leave)) return move_ray_origin(P, front ? hit.leave : -hit.leave);
  return offset_ray_origin(P + hit.clear, hit.P_error, front ? hit.Ng : -hit.Ng);
}

}  // namespace relief
