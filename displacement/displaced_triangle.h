// One displaced base triangle, and the definition of its surface that all methods share:
//
//     S(b) = P(b) + d(b) · N(b)/|N(b)|,    d = scale · (h − midlevel)
//
// with P, N and the lattice coordinates (x, y) interpolated linearly in the barycentric weights b = (b0, b1, b2), and h
// bilinear between texel centres (height_field.h). With s = d/|N| a point is P(b) + s·N(b): affine in b for a fixed s.
#pragma once

#include "displacement/height_field.h"
#include "displacement/vec3d.h"

namespace relief {

/// 128 bytes: everything a ray needs of a base triangle.
struct DisplacedTriangle {
  Vec3f P[3];          ///< object space, metres
  Vec3f N[3];          ///< displacement normals, object space; their lengths matter inside the triangle
  double x[3], y[3];   ///< lattice coordinates; whole periods were subtracted so that the least are in the first one
  float s_min, s_max;  ///< bounds of d/|N| over the triangle, rounded outward
};

/// A displaced mesh without ownership.
struct DisplacedMeshView {
  const DisplacedTriangle* triangles = nullptr;
  const std::uint8_t* unfolded = nullptr;  ///< 1: (b, s) ↦ P + sN is proven to be one to one in the triangle's prism
  std::uint32_t num_triangles = 0;
  const HeightFieldView* field = nullptr;
  double scale = 1, midlevel = 0.5;  ///< metres of object space; 0…1
};

/// Displacement along the unit normal at a lattice position, metres.
RELIEF_KERNEL double displacement_at(const DisplacedMeshView& mesh, double x, double y)
{
  return mesh.scale * (interpolate_height(*mesh.field, x, y) - mesh.midlevel);
}

/// A point of the displaced surface, object space.
struct SurfacePoint {
  Vec3d P;
  Vec3d Ng;      ///< unit, on the side of N; where the surface has no tangent plane: N/|N|
  Vec3d N;       ///< interpolated, not unit
  double d = 0;  ///< metres
};

/// Evaluates S and its geometric normal.
/// @param b1, b2  barycentric weights of vertices 1 and 2
/// @param i, j    the cell whose bilinear patch is meant: at a texel line the two sides have different normals
RELIEF_KERNEL SurfacePoint surface_point(const DisplacedMeshView& mesh,
                                         const DisplacedTriangle& tri,
                                         double b1,
                                         double b2,
                                         std::int64_t i,
                                         std::int64_t j)
{
  const Vec3d P0 = to_double(tri.P[0]), N0 = to_double(tri.N[0]);
  const Vec3d Pu = to_double(tri.P[1]) - P0, Pv = to_double(tri.P[2]) - P0;
  const Vec3d Nu = to_double(tri.N[1]) - N0, Nv = to_double(tri.N[2]) - N0;
  const double xu = tri.x[1] - tri.x[0], xv = tri.x[2] - tri.x[0];
  const double yu = tri.y[1] - tri.y[0], yv = tri.y[2] - tri.y[0];
  const double fx = tri.x[0] + b1 * xu + b2 * xv - static_cast<double>(i);
  const double fy = tri.y[0] + b1 * yu + b2 * yv - static_cast<double>(j);
  const CellHeights c = cell_heights(*mesh.field, i, j);
  const double h = c.h00 + c.hx * fx + (c.hy + c.hxy * fx) * fy;
  const double hx = c.hx + c.hxy * fy, hy = c.hy + c.hxy * fx;

  SurfacePoint point;
  point.N = N0 + b1 * Nu + b2 * Nv;
  point.d = mesh.scale * (h - mesh.midlevel);
  const double inverse_length = 1.0 / length(point.N);
  const Vec3d n = point.N * inverse_length;
  point.P = P0 + b1 * Pu + b2 * Pv + point.d * n;
  // ∂S = ∂P + ∂d·n + d·∂n with ∂n = (∂N − n (n·∂N))/|N|.
  const auto derivative = [&](Vec3d dP, Vec3d dN, double dx, double dy) {
    const double dd = mesh.scale * (hx * dx + hy * dy);
    return dP + dd * n + (point.d * inverse_length) * (dN - dot(n, dN) * n);
  };
  const Vec3d normal = cross(derivative(Pu, Nu, xu, yu), derivative(Pv, Nv, xv, yv));
  const double squared = dot(normal, normal);
  if (!(squared > 0.0)) {
    point.Ng = n;
    return point;
  }
  point.Ng = normal * ((dot(normal, n) < 0.0 ? -1.0 : 1.0) / __builtin_sqrt(squared));
  return point;
}

/// The same, in the cell that the weights fall into.
RELIEF_KERNEL SurfacePoint surface_point(const DisplacedMeshView& mesh,
                                         const DisplacedTriangle& tri,
                                         double b1,
                                         double b2)
{
  const double x = tri.x[0] + b1 * (tri.x[1] - tri.x[0]) + b2 * (tri.x[2] - tri.x[0]);
  const double y = tri.y[0] + b1 * (tri.y[1] - tri.y[0]) + b2 * (tri.y[2] - tri.y[0]);
  return surface_point(mesh, tri, b1, b2, static_cast<std::int64_t>(__builtin_floor(x)),
                       static_cast<std::int64_t>(__builtin_floor(y)));
}

}  // namespace relief
