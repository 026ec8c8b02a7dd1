// Heights that make a smooth surface of a triangle mesh by its vertices and normals alone: it goes through the vertices,
// has the mesh's normals there, and the surfaces of two triangles have one tangent plane all along their side. A map or
// a graph may be added on top.
//
// With p and n linear in the weights, S = p + h·n. On a side h is the cubic whose slopes turn S to the normals at its ends.
// The tangent plane along a side is spanned by the side's curve and by what is across it and across n; it depends on the
// side alone, and gives the slope of h into the triangle. Three interpolants, each of them a cubic from one vertex to the
// opposite side, have these values and slopes at one side, and are blended so that each rules at its own.
//
// Smits, Shirley and Stark 2000, "Direct Ray Tracing of Displacement Mapped Triangles", section 4, ask for such a function
// and blend surfaces that fit two sides; the blend of side-vertex interpolants is Nielson 1979, "The Side-Vertex Method for
// Interpolation in Triangles".
#pragma once

#include <vector>

#include "displacement/height_source.h"
#include "displacement/vec3d.h"
#include "kernel/shape/mesh_view.h"

namespace relief {

/// How something changes with the weights of a triangle's vertices 1 and 2.
struct WeightSlopes {
  double b1, b2;
};

/// One triangle's smooth surface.
class CurvedTriangle {
 public:
  /// @param N  of any length but zero
  CurvedTriangle(const Vec3f* P, const Vec3f* N);

  /// Displacement along the interpolated normal, metres. On a side the same to the bit from both of its triangles.
  /// @param b  weights
  double displacement(const double* b) const;
  /// How the displacement changes with the weights of vertices 1 and 2, metres; on a side that of the surface within.
  WeightSlopes slopes(double b1, double b2) const;
  /// Bounds over the triangle, metres; infinite where the normals are so far apart that no surface is known.
  void bounds(double* low, double* high) const;

 private:
  double side_height(int j, double t) const;
  double side_slope(int j, double t) const;
  double slope_from(int i, double t) const;
  double toward(int i, int j) const;

  Vec3d P_[3], N_[3];
};

/// Smooth heights of a mesh, with others on top.
struct CurvedHeights {
  MeshView mesh;                   ///< with normals
  HeightSource on_top;             ///< without eval: none, which is a height of `midlevel`
  double scale = 1, midlevel = 0;  ///< of the displacement
  HeightSource source() const;
};

}  // namespace relief
