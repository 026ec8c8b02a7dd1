// Walls between meshes that meet along edges and are displaced differently, or one of them not at all: strips of plain triangles from
// the one's border to the other's, as rays meet these.
//
// Either border is a polyline where its mesh is made of plain triangles, moved ones or micro-triangles, and else a curve over the edge.
// A strip has the points of both, and reaches beyond either by what a curve is off its chords and what two tracers round differently.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <unordered_map>
#include <vector>

#include "displacement/embree_geometry.h"
#include "displacement/moved_mesh.h"
#include "displacement/point_tiles.h"
#include "displacement/tessellation.h"
#include "displacement/vec3d.h"
#include "kernel/shape/border_edge.h"

namespace relief {

/// A mesh's border over one of its edges.
struct BorderCurve {
  std::vector<double> fractions;      ///< along the edge, 0 … 1, rising
  std::vector<std::vector<Vec3d>> P;  ///< of those, by step; one if it does not deform; object space
  bool is_polyline = false;           ///< of a mesh of plain triangles, whose vertices these are
  double margin = 0;  ///< else: that rays may meet it off the straight lines between these points, metres
};

/// One side of edges: the border over an edge 3 · triangle + k of a mesh, from the triangle's vertex k to the next.
using BorderSide = std::function<BorderCurve(std::uint32_t)>;

/// Of a mesh as it is, or with its own vertices moved.
/// @param steps  vertices by step, at least one; what they point to must outlive the side, as `triangles`
BorderSide border_of_vertices(const TriangleIndices* triangles, std::vector<const Vec3f*> steps);

/// Of a mesh that was divided.
/// @param parts  that it was divided by; must outlive the side, as `mesh`
BorderSide border_of_divided(const MovedMesh& mesh, std::span<const LatticeTriangle> parts);

/// Likewise, of one whose triangles are made in tiles.
/// @param tiles  must outlive the side
BorderSide border_of_tiles(const PointTiles& tiles);

/// Of a mesh that is tessellated.
/// @param parts  of the base mesh's triangles, which are tessellated in their place; empty: the triangles are
BorderSide border_of_tessellation(const Tessellation& tessellation, std::span<const LatticeTriangle> parts);

/// Of a mesh that is traced as it is displaced.
/// @param geometry  must outlive the side
BorderSide border_of_displaced(const DisplacedGeometry& geometry);

/// Where walls stand at a mesh's edges.
struct WallsBeside {
  struct Piece {
    float fraction;  ///< along the edge, from here on
    bool rises;      ///< to the side of the mesh's normals
  };
  std::unordered_map<std::uint32_t, std::vector<Piece>> edges;  ///< by 3 · triangle + k; each by fraction

  /// How rays' origins have to be moved besides at a point near such an edge, so that no wall is nearer than they are moved anyway.
  /// @param weights   of the triangle's vertices at the point
  /// @param Ng        of the surface there, unit, object space
  /// @param distance  metres: points nearer to the edge are moved, by as much
  /// @return          along the surface, for origins to the side of Ng; zero: nothing stands near
  Vec3d leave(const MeshView& mesh,
              std::uint32_t triangle,
              const double (&weights)[3],
              Vec3d Ng,
              double distance) const;
};

/// Strips between two sides of a border.
struct BorderStrips {
  MovedMesh mesh;
  std::vector<WallsBeside::Piece> pieces[2];  ///< all edges' of either side, one edge's after the other's
  std::vector<std::uint32_t> num_pieces;      ///< by edge
};

/// @param edges      of the first and the second side's mesh
/// @param mesh       an edge each: triangle `k` has its ends as the second side has them
/// @param meshes     of both sides
/// @param num_steps  while the shutter is open; 0: neither side deforms
/// @param rounding   of the tracers, metres of object space
/// @return           with the attributes of `mesh`, wound as the second side's triangles
BorderStrips border_strips_make(std::span<const BorderEdge> edges,
                                const MeshView& mesh,
                                const MeshView (&meshes)[2],
                                const BorderSide (&sides)[2],
                                std::size_t num_steps,
                                double rounding);

/// Adds the pieces of one side to those that stand beside its mesh.
void walls_beside_add(std::span<const BorderEdge> edges, const BorderStrips& strips, int side, WallsBeside* out);

}  // namespace relief
