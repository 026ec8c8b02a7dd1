// Displacement by moving vertices: where triangles are hardly larger than pixels, or heights are the same all over a mesh, its own
// as Cycles does it; elsewhere those of triangles that are divided to the size of pixels. What comes of it is a plain mesh, and
// costs what one costs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "displacement/height_source.h"
#include "displacement/lattice_split.h"
#include "kernel/shape/mesh_view.h"

namespace relief {

/// Heights at eight corners of triangles at a time, 3 · triangle + vertex each: a source has them eight at a time of one triangle.
/// Called from many threads at once.
/// @return  as HeightSource::eval; owned by the same
using CornerHeights = std::function<void(const std::uint32_t* corners, float* h)>;

/// @cost  eight heights for each
CornerHeights corner_heights(const HeightSource& source);

struct DividedMesh;

/// A mesh with its vertices moved, or one that it is divided to.
struct MovedMesh {
  std::string name;
  int mesh_index = 0;       ///< of the mesh that was
  std::vector<Vec3f> P;     ///< of all vertices
  std::vector<Normal3f> N;  ///< likewise; empty: it is flat
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

/// What that takes, with the tree that rays are traced in while it is built, about.
std::uint64_t divided_mesh_bytes(const MeshView& mesh, std::span<const LatticeTriangle> parts);

/// Cells that a triangle of a mesh asks for along a side, the mean of some thousands of triangles.
/// @pre the mesh has triangles
double mean_cells_a_side(const MeshView& mesh, const CellsAlong& cells);

}  // namespace relief
