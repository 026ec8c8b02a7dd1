// The door to primitives: what is read at a place on one, whatever it is. That places on triangles are weights of vertices, and those on
// curves something else, is known in this folder alone; all others hand places on.
//
// Points of lamps and of media are on no primitive. Their place has no mesh, and what would be read there is nothing.
#pragma once

#include "kernel/shape/curve_hit.h"
#include "kernel/shape/surface_hit.h"

namespace relief {

/// The mean of what a primitive's vertices have, by their weights at a place.
/// @param of  gives what a vertex has by its number
/// @pre       the place has a mesh
template <typename OfVertex>
RELIEF_KERNEL auto primitive_mean(const PrimitivePlace& at, const OfVertex& of)
{
  const TriangleIndices v = at.mesh->triangles[at.primitive];
  const float w0 = 1.0f - at.u - at.v;
  return w0 * of(v.v0) + at.u * of(v.v1) + at.v * of(v.v2);
}

/// One of a column's numbers.
RELIEF_KERNEL float primitive_column(const PrimitivePlace& at, const MeshColumn& column, std::uint32_t component)
{
  const float* values = column.values + component;
  return primitive_mean(at, [&](std::uint32_t v) { return values[std::size_t{v} * column.num_components]; });
}

/// The mesh's normal, interpolated and not made unit, object space; (0, 0, 0) without.
RELIEF_KERNEL Vec3f primitive_vertex_normal(const PrimitivePlace& at)
{
  if (at.mesh == nullptr || at.mesh->N == nullptr) return {};
  return primitive_mean(at, [&](std::uint32_t v) { return as_vector(mesh_N(*at.mesh, v)); });
}

/// The mesh's _GENERATED; (0, 0, 0) without.
RELIEF_KERNEL Vec3f primitive_generated(const PrimitivePlace& at)
{
  if (at.mesh->generated == nullptr) return {};
  return primitive_mean(at, [&](std::uint32_t v) { return at.mesh->generated[v]; });
}

/// Distance of a point to the nearest of the lines along a triangle's edges, metres; infinite where there are none.
/// @param P  world
RELIEF_KERNEL float primitive_edge_distance(const PrimitivePlace& at, const InstanceView& instance, Vec3f P)
{
  if (at.mesh == nullptr || at.mesh->radius != nullptr) return kInfinity;
  const TriangleIndices tri = at.mesh->triangles[at.primitive];
  const std::uint32_t corner[3] = {tri.v0, tri.v1, tri.v2};
  Vec3f p[3];
  for (int i = 0; i < 3; ++i) p[i] = transform_point(instance.world_from_object, mesh_P(*at.mesh, corner[i]));
  float nearest = kInfinity;
  for (int i = 0; i < 3; ++i) {
    const Vec3f edge = p[(i + 1) % 3] - p[i];
    nearest = min(nearest, length_squared(cross(edge, P - p[i])) / length_squared(edge));
  }
  return __builtin_sqrtf(nearest);
}

/// The place some way along the surface, on the plane of the same triangle.
/// @param by       world; off the plane (a displaced surface is) the nearest place counts
/// @param carried  factor on that
RELIEF_KERNEL PrimitivePlace primitive_moved(const PrimitivePlace& at,
                                             const InstanceView& instance,
                                             Vec3f by,
                                             float carried)
{
  const TriangleIndices tri = at.mesh->triangles[at.primitive];
  const Affine3& m = instance.world_from_object;
  const Vec3f edge1 = transform_vector(m, mesh_P(*at.mesh, tri.v1) - mesh_P(*at.mesh, tri.v0));
  const Vec3f edge2 = transform_vector(m, mesh_P(*at.mesh, tri.v2) - mesh_P(*at.mesh, tri.v0));
  // Least squares.
  const float a = dot(edge1, edge1), b = dot(edge1, edge2), c = dot(edge2, edge2);
  const float determinant = difference_of_products(a, c, b, b);
  PrimitivePlace out = at;
  if (determinant > 0.0f) {
    const float p = carried * dot(edge1, by), q = carried * dot(edge2, by);
    out.u += difference_of_products(c, p, b, q) / determinant;
    out.v += difference_of_products(a, q, b, p) / determinant;
  }
  return out;
}

/// Writes the mesh's texture coordinates and colour to a hit.
RELIEF_KERNEL void primitive_interpolate(const PrimitivePlace& at, SurfaceHit* hit)
{
  surface_hit_interpolate(*at.mesh, at.mesh->triangles[at.primitive], at.u, at.v, hit);
}

/// All that shading needs of where a ray met a primitive. What is displaced is not asked here: see surface_hit_displaced.
/// @param P_ray  where the ray met it, world; triangles know better
/// @param wo     unit, back along the ray
RELIEF_KERNEL SurfaceHit primitive_hit(const PrimitivePlace& at, const InstanceView& instance, Vec3f P_ray, Vec3f wo)
{
  if (__builtin_expect((instance.flags & kCurves) == 0, 1)) {
    return surface_hit_make(*at.mesh, instance, at.primitive, at.u, at.v);
  }
  return surface_hit_curve(*at.mesh, instance, at.primitive, at.u, at.v, P_ray, wo);
}

/// The plane of a triangle, world: enough of a hit where nothing is asked but on which side of it something is.
struct PrimitivePlane {
  Vec3f P;   ///< the place, as primitive_hit has it
  Vec3f Ng;  ///< on the front side; not unit
};

RELIEF_KERNEL PrimitivePlane primitive_plane(const PrimitivePlace& at, const InstanceView& instance)
{
  const TriangleIndices tri = at.mesh->triangles[at.primitive];
  const Affine3& m = instance.world_from_object;
  const Vec3f p0 = mesh_P(*at.mesh, tri.v0), p1 = mesh_P(*at.mesh, tri.v1), p2 = mesh_P(*at.mesh, tri.v2);
  const Vec3f Ng = cross(transform_vector(m, p1 - p0), transform_vector(m, p2 - p0));
  return {transform_point(m, (1.0f - at.u - at.v) * p0 + at.u * p1 + at.v * p2),
          (instance.flags & kMirrored) != 0 ? -Ng : Ng};
}

/// Whether primitives have a direction that fibres lie along: these are curves, and no balls.
RELIEF_KERNEL bool has_strands(const InstanceView& instance)
{
  return (instance.flags & (kCurves | kPoints)) == kCurves;
}

/// The direction of a strand: world, unit.
/// @param wo  see curve_tangent
/// @pre       has_strands
RELIEF_KERNEL Vec3f primitive_strand(const PrimitivePlace& at, const InstanceView& instance, Vec3f wo)
{
  return curve_tangent(*at.mesh, instance, at.primitive, at.u, wo);
}

/// Its radius: world, metres.
/// @pre  has_strands
RELIEF_KERNEL float primitive_strand_radius(const PrimitivePlace& at, const InstanceView& instance)
{
  return curve_radius(*at.mesh, instance, at.primitive, at.u);
}

}  // namespace relief
