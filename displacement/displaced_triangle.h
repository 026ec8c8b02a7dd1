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

struct Deformation;  // deformation.h

/// 128 bytes: everything a ray needs of a base triangle.
struct DisplacedTriangle {
  Vec3f P[3];          ///< object space, metres
  Vec3f N[3];          ///< displacement normals, object space; their lengths matter inside the triangle
  double x[3], y[3];   ///< lattice coordinates; whole periods were subtracted so that the least are in the first one
  float s_min, s_max;  ///< bounds of d/|N| over the triangle, rounded outward
};

/// Length of an edge in the map along the axis where it is longer, texels.
/// @param edge  from its vertex to the next
RELIEF_KERNEL double texels_along(const DisplacedTriangle& tri, int edge)
{
  const int next = edge == 2 ? 0 : edge + 1;
  return max(__builtin_fabs(tri.x[next] - tri.x[edge]), __builtin_fabs(tri.y[next] - tri.y[edge]));
}

/// Where the triangle on the other side of a texture seam reads the height map, see seam_walls.h.
struct SeamWall {
  std::uint32_t edge;  ///< 3 · triangle + k: from the triangle's vertex k to the next
  double x[2], y[2];   ///< lattice coordinates at the edge's start and end
};

/// A surface between two levels of its height map, see level_blend.h.
struct LevelBlend {
  const HeightFieldView* coarse = nullptr;  ///< the level after the mesh's field
  const void* table = nullptr;              ///< what the method needs of it: MethodTable::view
  double weight = 0;                        ///< of the coarser level, 0…1; the rest is the field's
};

/// A displaced mesh without ownership.
struct DisplacedMeshView {
  const DisplacedTriangle* triangles = nullptr;
  const std::uint8_t* unfolded = nullptr;  ///< 1: (b, s) ↦ P + sN is proven to be one to one in the triangle's prism
  std::uint32_t num_triangles = 0;
  const HeightFieldView* field = nullptr;
  double scale = 1, midlevel = 0.5;          ///< metres of object space; 0…1
  const std::uint8_t* seam_edges = nullptr;  ///< by triangle, bit k: its edge k has walls; null: seams stay open
  const SeamWall* walls = nullptr;           ///< in the order of their edges
  std::uint32_t num_walls = 0;
  float pad = 0;  ///< by which the triangles' boxes are enlarged, metres
  /// Of a view of one triangle that deforms: its number, by which walls and computed heights know it.
  std::uint32_t first_triangle = 0;
  const Deformation* deformation =
      nullptr;                        ///< while the shutter is open: triangles are as when it is half done; null: none
  const LevelBlend* blend = nullptr;  ///< null: the surface has the heights of the field alone
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

/// P and N of a triangle as functions of the barycentric weights of vertices 1 and 2, with their derivatives.
struct BasePoint {
  Vec3d P, Pu, Pv;
  Vec3d N, Nu, Nv;
  double xu, xv, yu, yv;  ///< of the lattice coordinates
};

RELIEF_KERNEL BasePoint base_point(const DisplacedTriangle& tri, double b1, double b2)
{
  BasePoint p;
  const Vec3d P0 = to_double(tri.P[0]), N0 = to_double(tri.N[0]);
  p.Pu = to_double(tri.P[1]) - P0;
  p.Pv = to_double(tri.P[2]) - P0;
  p.Nu = to_double(tri.N[1]) - N0;
  p.Nv = to_double(tri.N[2]) - N0;
  p.xu = tri.x[1] - tri.x[0];
  p.xv = tri.x[2] - tri.x[0];
  p.yu = tri.y[1] - tri.y[0];
  p.yv = tri.y[2] - tri.y[0];
  p.P = P0 + b1 * p.Pu + b2 * p.Pv;
  p.N = N0 + b1 * p.Nu + b2 * p.Nv;
  return p;
}

/// A place in the height map, lattice coordinates.
struct LatticePoint {
  double x = 0, y = 0;
};

/// @param b1, b2  barycentric weights of vertices 1 and 2
RELIEF_KERNEL LatticePoint lattice_point(const DisplacedTriangle& tri, double b1, double b2)
{
  return {tri.x[0] + b1 * (tri.x[1] - tri.x[0]) + b2 * (tri.x[2] - tri.x[0]),
          tri.y[0] + b1 * (tri.y[1] - tri.y[0]) + b2 * (tri.y[2] - tri.y[0])};
}

/// Normal of a surface P + d·N/|N| at a point where d has the slopes scale·hx and scale·hy a lattice unit.
/// @param scale   metres
/// @return        unit, on the side of N; where the surface has no tangent plane: N/|N|
RELIEF_KERNEL Vec3d surface_normal(const BasePoint& base, double d, double scale, double hx, double hy)
{
  const double inverse_length = 1.0 / length(base.N);
  const Vec3d n = base.N * inverse_length;
  // ∂S = ∂P + ∂d·n + d·∂n with ∂n = (∂N − n (n·∂N))/|N|.
  const auto derivative = [&](Vec3d dP, Vec3d dN, double dx, double dy) {
    const double dd = scale * (hx * dx + hy * dy);
    return dP + dd * n + (d * inverse_length) * (dN - dot(n, dN) * n);
  };
  const Vec3d normal =
      cross(derivative(base.Pu, base.Nu, base.xu, base.yu), derivative(base.Pv, base.Nv, base.xv, base.yv));
  const double squared = dot(normal, normal);
  if (!(squared > 0.0)) return n;
  return normal * ((dot(normal, n) < 0.0 ? -1.0 : 1.0) / __builtin_sqrt(squared));
}

/// S and its geometric normal where it is displaced by a bilinear patch.
/// @param fx, fy  from the corner that the patch is given from
RELIEF_KERNEL SurfacePoint
patch_point(const DisplacedMeshView& mesh, const BasePoint& base, const CellHeights& c, double fx, double fy)
{
  const double h = c.h00 + c.hx * fx + (c.hy + c.hxy * fx) * fy;
  SurfacePoint point;
  point.N = base.N;
  point.d = mesh.scale * (h - mesh.midlevel);
  const double inverse_length = 1.0 / length(point.N);
  point.P = base.P + point.d * (point.N * inverse_length);
  point.Ng = surface_normal(base, point.d, mesh.scale, c.hx + c.hxy * fy, c.hy + c.hxy * fx);
  return point;
}

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
  const BasePoint base = base_point(tri, b1, b2);
  const LatticePoint at = lattice_point(tri, b1, b2);
  return patch_point(mesh, base, cell_heights(*mesh.field, i, j), at.x - static_cast<double>(i),
                     at.y - static_cast<double>(j));
}

/// The same, in the cell that the weights fall into.
RELIEF_KERNEL SurfacePoint surface_point(const DisplacedMeshView& mesh,
                                         const DisplacedTriangle& tri,
                                         double b1,
                                         double b2)
{
  const LatticePoint at = lattice_point(tri, b1, b2);
  return surface_point(mesh, tri, b1, b2, static_cast<std::int64_t>(__builtin_floor(at.x)),
                       static_cast<std::int64_t>(__builtin_floor(at.y)));
}

/// Slopes of a map, a lattice unit.
struct LatticeSlopes {
  double x = 0, y = 0;
};

/// Taken over one texel to either side, which makes them continuous where the bilinear patches of two cells meet.
RELIEF_KERNEL LatticeSlopes smooth_slopes(const HeightFieldView& f, double x, double y)
{
  return {0.5 * (interpolate_height(f, x + 1.0, y) - interpolate_height(f, x - 1.0, y)),
          0.5 * (interpolate_height(f, x, y + 1.0) - interpolate_height(f, x, y - 1.0))};
}

/// Normal for shading a surface whose facets should not show: that of S with the map's smooth slopes.
/// @return unit, on the side of N
RELIEF_KERNEL Vec3d surface_smooth_normal(const DisplacedMeshView& mesh,
                                          const DisplacedTriangle& tri,
                                          double b1,
                                          double b2)
{
  const BasePoint base = base_point(tri, b1, b2);
  const auto [x, y] = lattice_point(tri, b1, b2);
  const LatticeSlopes slopes = smooth_slopes(*mesh.field, x, y);
  return surface_normal(base, displacement_at(mesh, x, y), mesh.scale, slopes.x, slopes.y);
}

}  // namespace relief
