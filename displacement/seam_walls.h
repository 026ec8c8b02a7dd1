// Walls along texture seams. Where the two triangles of an edge read the height map at different places, their displaced
// edges are two curves over one base edge, and the surface is open between them. Both lie in the wall that the triangles'
// prisms share, {P(f) + s·N(f)}, f along the edge; the part of it between the two curves closes the gap, exactly, and
// changes nothing else: no height, no table. A ray meets it where it passes from one prism to the other with the one
// surface below it and the other above, which is known once the ray's curve is (ray_curve.h).
//
// Blending heights towards a mean on both sides would bend the surface within a texel or two, which no longer is bilinear
// over the lattice: every bound and the leaf test would have to know. A wall is what such a blend tends to as it narrows.
#pragma once

#include "displacement/leaf.h"
#include "displacement/level_blend.h"

namespace relief {

/// A level of detail of a height map.
struct SeamLevel {
  const HeightFieldView* finest = nullptr;  ///< which lattice coordinates of triangles and walls are for
  const HeightFieldView* field = nullptr;   ///< where heights are read
};

/// Displacement at the lattice coordinates of the finest level, as a level has it, or the mesh's blend of two.
RELIEF_KERNEL double displacement_on_level(const DisplacedMeshView& mesh, const SeamLevel& level, double x, double y)
{
  if (mesh.blend != nullptr) [[unlikely]]
    return blended_displacement(mesh, x, y);
  x = lattice_on_level(x, level.finest->map.width, level.field->map.width);
  y = lattice_on_level(y, level.finest->map.height, level.field->map.height);
  return mesh.scale * (interpolate_height(*level.field, x, y) - mesh.midlevel);
}

/// Displacements of a seam's two sides, and of more where more than two triangles meet.
struct SeamHeights {
  double own = 0;            ///< of the triangle's own surface, metres
  double low = 0, high = 0;  ///< of all of them
};

/// @param edge      0…2: from vertex `edge` to the next
/// @param fraction  along it, 0…1
RELIEF_KERNEL SeamHeights
seam_heights(const DisplacedMeshView& mesh, std::uint32_t triangle, int edge, double fraction, const SeamLevel& level)
{
  const DisplacedTriangle& tri = mesh.triangles[triangle];
  const int next = edge == 2 ? 0 : edge + 1;
  SeamHeights heights;
  heights.own = displacement_on_level(mesh, level, tri.x[edge] + fraction * (tri.x[next] - tri.x[edge]),
                                      tri.y[edge] + fraction * (tri.y[next] - tri.y[edge]));
  heights.low = heights.high = heights.own;
  const std::uint32_t index = 3 * (mesh.first_triangle + triangle) + static_cast<std::uint32_t>(edge);
  std::uint32_t first = 0, end = mesh.num_walls;
  while (first < end) {
    const std::uint32_t middle = first + (end - first) / 2;
    if (mesh.walls[middle].edge < index) {
      first = middle + 1;
    } else {
      end = middle;
    }
  }
  for (std::uint32_t k = first; k < mesh.num_walls && mesh.walls[k].edge == index; ++k) {
    const SeamWall& wall = mesh.walls[k];
    const double d = displacement_on_level(mesh, level, wall.x[0] + fraction * (wall.x[1] - wall.x[0]),
                                           wall.y[0] + fraction * (wall.y[1] - wall.y[0]));
    heights.low = min(heights.low, d);
    heights.high = max(heights.high, d);
  }
  return heights;
}

/// A point of a wall: on the displacement line of a point of the edge.
/// @param d  metres along the unit normal
/// @return   Ng points to the lower side, where the wall is seen from
RELIEF_KERNEL SurfacePoint seam_wall_point(const DisplacedMeshView& mesh,
                                           std::uint32_t triangle,
                                           int edge,
                                           double fraction,
                                           double d,
                                           const SeamLevel& level)
{
  const DisplacedTriangle& tri = mesh.triangles[triangle];
  const int next = edge == 2 ? 0 : edge + 1, opposite = next == 2 ? 0 : next + 1;
  const Vec3d P0 = to_double(tri.P[edge]), N0 = to_double(tri.N[edge]);
  const Vec3d dP = to_double(tri.P[next]) - P0, dN = to_double(tri.N[next]) - N0;
  SurfacePoint point;
  point.N = N0 + fraction * dN;
  point.d = d;
  const double s = d / length(point.N);
  point.P = P0 + fraction * dP + s * point.N;
  const Vec3d normal = cross(dP + s * dN, point.N);
  const Vec3d inwards = to_double(tri.P[opposite]) + s * to_double(tri.N[opposite]) - point.P;
  const bool inside_is_lower = seam_heights(mesh, triangle, edge, fraction, level).own <= d;
  const double squared = dot(normal, normal);
  const double sign = (dot(normal, inwards) > 0.0) == inside_is_lower ? 1.0 : -1.0;
  point.Ng = squared > 0.0 ? normal * (sign / __builtin_sqrt(squared)) : point.N * (1.0 / length(point.N));
  return point;
}

/// Whether a ray passes through a wall where a segment of its curve ends.
/// @param tau       0 or 1: the end
/// @param edge      one with walls
/// @param hit       t, weights, edge and displacement, if it does
RELIEF_KERNEL bool seam_wall_intersect(const DisplacedMeshView& mesh,
                                       std::uint32_t triangle,
                                       const RayCurve& curve,
                                       const CurveSegment& g,
                                       double tau,
                                       int edge,
                                       const SeamLevel& level,
                                       DisplacedHit* hit)
{
  const DisplacedTriangle& tri = mesh.triangles[triangle];
  const int next = edge == 2 ? 0 : edge + 1, opposite = next == 2 ? 0 : next + 1;
  const double e[3] = {quadratic_at(g.e[0], tau), quadratic_at(g.e[1], tau), quadratic_at(g.e[2], tau)};
  const double W = e[0] + e[1] + e[2];
  // Segments end a rounding error beyond the walls.
  if (!(e[opposite] <= 2.0 * g.relative_error * W)) return false;
  double fraction = e[next] / (e[edge] + e[next]);
  double s = g.s0 + tau * g.ds, t = tau > 0.0 ? g.t1 : g.t0;
  const Vec3d P0 = to_double(tri.P[edge]), N0 = to_double(tri.N[edge]);
  const Vec3d dP = to_double(tri.P[next]) - P0, dN = to_double(tri.N[next]) - N0;
  if (g.relative_error > kExactWeights) {
    // One step of Newton on the wall itself, which is not seen edge-on as the facet is.
    const Vec3d O{curve.frame.O[0], curve.frame.O[1], curve.frame.O[2]};
    const Vec3d N = N0 + fraction * dN;
    const RaySeen at = ray_seen(curve.frame, (P0 - O) + fraction * dP + s * N);
    const RaySeen u = ray_seen(curve.frame, dP + s * dN), v = ray_seen(curve.frame, N);
    const double inverse = 1.0 / (u.x * v.y - u.y * v.x);
    const double df = (at.y * v.x - at.x * v.y) * inverse, ds = (at.x * u.y - at.y * u.x) * inverse;
    if (__builtin_fabs(df) <= 1.0 && __builtin_fabs(ds * length(N)) <= length(dP)) {
      fraction += df;
      s += ds;
      t = at.z + df * u.z + ds * v.z;
    }
  }
  fraction = min(max(fraction, 0.0), 1.0);
  const double d = s * length(N0 + fraction * dN);
  const SeamHeights heights = seam_heights(mesh, triangle, edge, fraction, level);
  // What the leaf's test of the same ray in either triangle may have rounded away: heights, and weights through slopes.
  double h_low, h_high;
  stored_to_heights(*mesh.field, mesh.field->range, &h_low, &h_high);
  const double range = __builtin_fabs(mesh.scale) * (h_high - h_low);
  const double texels = __builtin_fabs(tri.x[1] - tri.x[0]) + __builtin_fabs(tri.x[2] - tri.x[0]) +
                        __builtin_fabs(tri.y[1] - tri.y[0]) + __builtin_fabs(tri.y[2] - tri.y[0]);
  const double rounding = (0x1p-49 + 4.0 * g.relative_error) * range * (1.0 + texels) + 0x1p-49 * __builtin_fabs(d);
  if (!(d >= heights.low - rounding && d <= heights.high + rounding)) return false;
  *hit = {};
  hit->t = t;
  double b[3] = {0, 0, 0};
  b[edge] = 1.0 - fraction;
  b[next] = fraction;
  hit->b1 = b[1];
  hit->b2 = b[2];
  hit->tau = tau;
  hit->edge = edge;
  hit->d = d;
  return true;
}

}  // namespace relief
