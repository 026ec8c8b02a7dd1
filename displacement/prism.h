// The prism of a displaced triangle: all P + s·N between two bounds of s, which hold its surface.
#pragma once

#include "displacement/displaced_triangle.h"

namespace relief {

struct LatticeTriangle;

/// What is known of a prism.
struct PrismReport {
  bool unfolded = false;       ///< see DisplacedMeshView::unfolded
  bool short_normals = false;  ///< |N| falls below a thousandth of its largest value
  bool degenerate = false;     ///< there are no normals: nothing of it is ever hit
};

/// Bounds d/|N| over a triangle, see DisplacedTriangle::s_min.
/// @param d_low, d_high  of its displacement, metres
/// @param tri            with P and N
PrismReport prism_bound(double d_low, double d_high, DisplacedTriangle* tri);

/// Sets P and N of a triangle, or of a part of it.
/// @param P, N  of the base triangle's vertices, object space; N null: it moves along its own normal
/// @param part  null: the whole triangle
void corners_place(const Vec3f* P, const Vec3f* N, const LatticeTriangle* part, DisplacedTriangle* tri);

/// The nearest floats below and above, or the ones beyond.
float round_down(double x);
float round_up(double x);

}  // namespace relief
