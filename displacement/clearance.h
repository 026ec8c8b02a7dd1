// Where rays may start that leave a displaced surface.
//
// A point of the surface is known up to a box of rounding errors. Where the surface is smooth over the box, a move along
// its normal takes a ray's origin out of it (offset_ray_origin). Over a crease, a border between two cells of the map, it
// does not: in a valley narrower than a right angle the move ends inside the other slope. But along its displacement line
// a point meets the surface only once, so there the origin is moved along that line instead, past all heights that the
// surface has within the box. The same holds along the sides that base triangles share, where the normals of two surfaces
// meet: there the heights are those of all triangles that the box reaches into (displaced_leave finds them).
//
// Where the surface is nearly parallel to its displacement lines, a move along one is long for what it clears: at a fold, where
// they cross, without end (it was .033 m). There the planes of the cells and triangles in the box say what is the shortest
// way out of it (plane_clearance.h).
#pragma once

#include <vector>

#include "displacement/displaced_triangle.h"
#include "displacement/plane_clearance.h"

namespace relief {

/// Bounds of the interpolated heights over [x0, x1] × [y0, y1], lattice coordinates. Exact up to rounding for rectangles
/// narrower than a cell; for others they hold for all of the cells.
struct HeightsBetween {
  double low, high;
};
HeightsBetween heights_between(const HeightFieldView& field, double x0, double y0, double x1, double y1);

/// What a box around a point of a triangle's surface holds of that surface.
struct SurfaceInBox {
  /// How far along ±N/|N| the point has to be moved to be clear of the surface, wherever in the box it really is and comes
  /// to lie; metres of object space.
  double clearance = 0;
  bool crease = false;     ///< the box may hold a border between cells of the map
  std::uint8_t sides = 0;  ///< bit k: it reaches over the side of the triangle that is opposite to vertex k
};

/// @param reach  half sides of the box, object space, metres
/// @return       without creases and sides there is no clearance; nothing of a triangle without area over the point
SurfaceInBox surface_in_box(const DisplacedMeshView& mesh,
                            const DisplacedTriangle& tri,
                            double b1,
                            double b2,
                            Vec3d reach);

/// Adds the planes of a triangle's surface in the cells that a box around a point of it reaches into. Not of a surface between
/// two levels.
/// @param error  per axis, of a point and of an origin, as in offset_ray_origin
/// @param reach  half sides of the box that they are in
void add_planes_in_box(const DisplacedMeshView& mesh,
                       const DisplacedTriangle& tri,
                       double b1,
                       double b2,
                       Vec3d error,
                       Vec3d reach,
                       std::vector<NearPlane>* planes);

}  // namespace relief
