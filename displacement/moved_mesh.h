// Displacement by moving vertices: where triangles are hardly larger than pixels, or heights are the same all over a mesh, its own
// as Cycles does it; elsewhere those of triangles that are divided to the size of pixels. What comes of it is a plain mesh, and
// costs what one costs. Vectors move points anywhere, heights along the normal.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "displacement/deformation.h"
#include "displacement/height_source.h"
#include "displacement/lattice_split.h"
#include "displacement/seen_instances.h"
#include "kernel/shape/mesh_view.h"

namespace relief {

/// Heights at eight corners of triangles at a time, 3 · triangle + vertex each: a source has them eight at a time of one triangle.
/// Called from many threads at once.
/// @return  as HeightSource::eval; owned by the same
using CornerHeights = std::function<void(const std::uint32_t* corners, float* h)>;

/// @cost  eight heights for each
CornerHeights corner_heights(const HeightSource& source);

/// What moves the points of a mesh anywhere, without ownership; metres, object space. Called from many threads at once.
struct PointMoves {
  const void* owner = nullptr;
  /// Of eight points of one triangle; what is no number is 0.
  /// @param b  weights of vertices 0, 1 and 2
  void (*eval)(const void* owner, std::uint32_t triangle, const float (*b)[8], Vec3f* moves) = nullptr;
  /// Likewise of eight corners of triangles, as CornerHeights has them.
  void (*eval_corners)(const void* owner, const std::uint32_t* corners, Vec3f* moves) = nullptr;
};

/// Where eight points of one triangle go. Called from many threads at once.
/// @param b      weights of vertices 0, 1 and 2
/// @param P      their places, like
/// @param N      their normals linear in the weights; not used by vectors
/// @param moved  receives where they go
using MovePoints =
    std::function<void(std::uint32_t triangle, const float (*b)[8], const Vec3f* P, const Normal3f* N, Vec3f* moved)>;

/// By what divided meshes and tiles of them move points.
struct PointMover {
  MovePoints move;
  bool along;  ///< normals: points of one place and normal move together, not all of one place
};

struct DividedMesh;

/// Vertices and normals of a moved mesh at one time.
struct MovedShape {
  std::vector<Vec3f> P;
  std::vector<Normal3f> N;  ///< empty: it is flat
};

/// A mesh with its vertices moved, or one that it is divided to.
struct MovedMesh {
  std::string name;
  int mesh_index = 0;             ///< of the mesh that was
  std::vector<Vec3f> P;           ///< of all vertices
  std::vector<Normal3f> N;        ///< likewise; empty: it is flat
  std::vector<MovedShape> steps;  ///< at evenly spaced times while the shutter is open; empty: it does not deform
  /// Triangles, and all else that vertices have; null: those of the mesh that was.
  std::shared_ptr<const DividedMesh> divided;

  /// @param mesh  that was
  MeshView view(const MeshView& mesh) const;
  std::size_t bytes() const;
};

/// How a mesh is displaced by moving vertices.
struct VertexDisplacement {
  double scale = 1;      ///< metres of object space
  float midlevel = 0.5;  ///< stands for heights that are no numbers as well
  /// It is shaded smooth: a vertex has the mean of the unit normals of the triangles around it, as in Cycles.
  bool smooth = false;
};

/// @return  what reads the source, which must outlive it
PointMover point_mover_make(const HeightSource& source, const VertexDisplacement& by);
PointMover point_mover_make(const PointMoves& moves);

/// Moves the vertices of a mesh along their normals. Vertices of one place and normal move together, by the height at the
/// first corner of a triangle that has them: texture seams stay closed.
/// @param mesh  with normals
/// @return      without name and index
/// @cost        a height for each vertex; parallel over vertices
MovedMesh moved_mesh_make(const MeshView& mesh, const CornerHeights& heights, const VertexDisplacement& by);

/// The same with the lattices' points for vertices. Lattices of two parts agree along the side that they share, so the result is
/// as closed as the mesh.
/// @param mesh   with normals
/// @param parts  of its triangles
/// @cost         as divided_mesh_bytes; parallel over parts
MovedMesh divided_mesh_make(const MeshView& mesh,
                            const HeightSource& source,
                            std::span<const LatticeTriangle> parts,
                            const VertexDisplacement& by);

/// The same by vectors. Vertices of one place move together, by the first corner's vector: cuts of texture coordinates and of
/// normals stay closed. A mesh that deforms moves by the same vectors at all times, as in Cycles.
/// @param smooth  as in VertexDisplacement; a mesh without normals stays flat
/// @param steps   of the mesh while the shutter is open, if it deforms
MovedMesh moved_mesh_make(const MeshView& mesh, const PointMoves& moves, bool smooth, std::span<const MeshShape> steps);
MovedMesh divided_mesh_make(const MeshView& mesh,
                            const PointMoves& moves,
                            std::span<const LatticeTriangle> parts,
                            bool smooth,
                            std::span<const MeshShape> steps);

/// A mesh with the sides of its triangles halved, so many times over; nothing has moved. What has a vertex in common still has.
/// @pre  it has normals
/// @cost 110 bytes a new triangle, and as many again while it is made; parallel over vertices
MovedMesh halved_mesh_make(const MeshView& mesh, int times);

/// A point of a mesh.
struct MeshPlace {
  std::uint32_t triangle = 0;
  Vec2f weights;  ///< of the triangle's vertices 1 and 2
};

/// A flat mesh whose vertices are anywhere, with what a mesh has at places of it.
/// @param places  a vertex each
/// @param steps   vertices by step: one, or as many as the mesh has
MovedMesh placed_mesh_make(const MeshView& mesh,
                           std::span<const MeshPlace> places,
                           std::vector<TriangleIndices> triangles,
                           std::vector<MovedShape> steps);

/// What that takes, with the tree that rays are traced in while it is built, about.
std::uint64_t divided_mesh_bytes(const MeshView& mesh, std::span<const LatticeTriangle> parts);
std::uint64_t halved_mesh_bytes(const MeshView& mesh, int times);

/// Cells that a triangle of a mesh asks for along a side, the mean of some thousands of triangles.
/// @pre the mesh has triangles
double mean_cells_a_side(const MeshView& mesh, const CellsAlong& cells);

/// Pixels that a triangle's side is long in the picture, likewise, but by how much of the picture triangles fill; 0: nothing is seen.
/// @pre the mesh has triangles
double mean_pixels_a_side(const MeshView& mesh, const SeenInstances& seen);

}  // namespace relief
