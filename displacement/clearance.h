// Where rays may start that leave a displaced surface.
//
// A point of the surface is known up to a box of rounding errors. Where the surface is smooth over the box, a move along
// its normal takes a ray's origin out of it (offset_ray_origin). Over a crease, a border between two cells of the map, it
// does not: in a valley narrower than a right angle the move ends inside the other slope. But along its displacement line
// a point meets the surface only once, so there the origin is moved along that line instead, past all heights that the
// surface has within the box.
#pragma once

#include "displacement/displaced_triangle.h"

namespace relief {

/// Bounds of the interpolated heights over [x0, x1] × [y0, y1], lattice coordinates. Exact up to rounding for rectangles
/// narrower than a cell; for others they hold for all of the cells.
struct HeightsBetween {
  double low, high;
};
HeightsBetween heights_between(const HeightFieldView& field, double x0, double y0, double x1, double y1);

/// How far along ±N/|N| a point of the surface has to be moved to be clear of the surface beside it, wherever in a box
/// around it it really is and comes to lie.
/// @param reach  half sides of the box, object space, metres
/// @return       metres of object space; 0 where the box holds no crease, and where the triangle has no area over it
double surface_clearance(const DisplacedMeshView& mesh,
                         const DisplacedTriangle& tri,
                         double b1,
                         double b2,
                         Vec3d reach);

}  // namespace relief
