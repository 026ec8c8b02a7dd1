// How finely the triangles of a procedurally displaced mesh are divided: a lattice each, and where one triangle spans much
// of the picture, parts with lattices of their own, as near ones need more cells than far ones.
#pragma once

#include <functional>
#include <vector>

#include "displacement/procedural_field.h"
#include "kernel/shape/mesh_view.h"

namespace relief {

/// Cells that are wanted along the straight line between two points, object space. The same, to the bit, either way.
using CellsAlong = std::function<double(Vec3f, Vec3f)>;

/// Fails, by throwing, unless there is room for so many bytes.
using RequireBytes = std::function<void(std::uint64_t)>;

/// A part is halved along sides with more cells than this: within it cells near to the camera and far from it are alike.
inline constexpr double kMostLatticeCells = 256;

/// The same lattice for all triangles.
/// @param n  cells along each side, a power of two up to kMostHeightCells
std::vector<LatticeTriangle> lattices_make(const MeshView& mesh, std::int32_t n);

/// A part's side has a power of two of cells, at least as many as are wanted, by its ends alone: so both of its triangles
/// agree. Triangles with a side of more than 256 are halved there, at most 14 times.
/// @param require     called as parts come to be, with what those so far will take; null: nobody asks
/// @param most_cells  along each side of a mesh's triangle, a power of two, of its parts' sides as many less; 0: any number
/// @cost  a part takes about 350 bytes until it can be traced; parallel over triangles
std::vector<LatticeTriangle> lattices_make(const MeshView& mesh,
                                           const CellsAlong& cells,
                                           const RequireBytes& require = {},
                                           std::int32_t most_cells = 0);

/// A corner's position or normal: linear in the weights, rounded the same way for all triangles that have it.
Vec3f lattice_corner(Vec2f weights, Vec3f v0, Vec3f v1, Vec3f v2);

}  // namespace relief
