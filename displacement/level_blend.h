// Surfaces between two levels of a height map: h = (1 − w)·h_fine + w·h_coarse, each bilinear on its own lattice.
//
// A texel of the coarser level is at least as wide as one of the finer, so at most one of its lines along an axis cuts a
// cell of the finer lattice. Between the lines of both the blend is bilinear again: one patch, which the leaf test of all
// methods takes (blended_march.h). Levels are halved and rounded up, so where the lines of the coarser one are depends on the sizes.
//
// T. Thonat, I. Georgiev, F. Beaune, T. Boubekeur, "RMIP: Displacement ray-tracing via inversion and oblong bounding",
// SIGGRAPH Asia 2023, §5, interpolates bounds and heights of two levels likewise.
#pragma once

#include "displacement/level_of_detail.h"

namespace relief {

/// The cells of the coarser level that one of the finer covers, along one axis.
struct BlendedCellAxis {
  std::int64_t coarse;  ///< the first
  double ratio;         ///< texels of the coarser level in one of the finer, at most 1
  double offset;        ///< of the finer cell's lower end in the coarser one, [0, 1)
  double cut;           ///< where the second begins, from the finer cell's lower end; 1 or more: there is none
};

/// @param fine, coarse  neighbouring levels of one map
/// @param i             lattice coordinate of a cell of the finer level, any period
RELIEF_KERNEL BlendedCellAxis blended_cell_axis(const LatticeAxis& fine, const LatticeAxis& coarse, std::int64_t i)
{
  // Within one period, where coordinates have all their digits.
  if (fine.wrap != Wrap::kClamp) i = lattice_modulo(i, fine.num_cells);
  const double ratio = static_cast<double>(coarse.num_texels) / fine.num_texels;
  const double x = (static_cast<double>(i) + 0.5) * ratio - 0.5, first = __builtin_floor(x);
  const double offset = x - first;
  // Where the two lattices share a line, rounding may leave a sliver on its other side: the blend is continuous there.
  return {static_cast<std::int64_t>(first), ratio, offset, (1.0 - offset) / ratio};
}

/// One of the at most four parts of a cell of the finer level between the lines of the coarser.
struct BlendedCell {
  std::int64_t i, j;  ///< the finer level's cell
  BlendedCellAxis x, y;
  bool upper_x, upper_y;  ///< which part: beyond the cut
};

/// Makes one of the parts of a cell.
RELIEF_KERNEL BlendedCell blended_cell(const DisplacedMeshView& mesh, std::int64_t i, std::int64_t j)
{
  const HeightFieldView &fine = *mesh.field, &coarse = *mesh.blend->coarse;
  return {i, j, blended_cell_axis(fine.x, coarse.x, i), blended_cell_axis(fine.y, coarse.y, j), false, false};
}

/// The two patches that are blended over a part of a cell, each from the corner of its own level's cell.
struct BlendedPatches {
  CellHeights fine, coarse;
};

RELIEF_KERNEL BlendedPatches blended_patches(const DisplacedMeshView& mesh, const BlendedCell& cell)
{
  return {cell_heights(*mesh.field, cell.i, cell.j),
          cell_heights(*mesh.blend->coarse, cell.x.coarse + (cell.upper_x ? 1 : 0),
                       cell.y.coarse + (cell.upper_y ? 1 : 0))};
}

/// Their blend, from the corner of the finer level's cell.
RELIEF_KERNEL CellHeights blended_heights(const BlendedCell& cell, const BlendedPatches& patches, double weight)
{
  const auto& [f, c] = patches;
  const double w = weight, v = 1.0 - w;
  // The coarser patch at (ratio_x·fx + a, ratio_y·fy + b).
  const double a = cell.upper_x ? cell.x.offset - 1.0 : cell.x.offset;
  const double b = cell.upper_y ? cell.y.offset - 1.0 : cell.y.offset;
  const double h00 = c.h00 + c.hx * a + (c.hy + c.hxy * a) * b;
  const double hx = cell.x.ratio * (c.hx + c.hxy * b), hy = cell.y.ratio * (c.hy + c.hxy * a);
  const double hxy = cell.x.ratio * cell.y.ratio * c.hxy;
  return {v * f.h00 + w * h00, v * f.hx + w * hx, v * f.hy + w * hy, v * f.hxy + w * hxy};
}

/// The part of a cell in which a place is.
/// @param x, y  lattice coordinates of the finer level
RELIEF_KERNEL BlendedCell
blended_cell_at(const DisplacedMeshView& mesh, std::int64_t i, std::int64_t j, double x, double y)
{
  BlendedCell cell = blended_cell(mesh, i, j);
  // An unbounded cell is not cut.
  cell.upper_x = cell.x.cut < 1.0 && x - static_cast<double>(i) >= cell.x.cut;
  cell.upper_y = cell.y.cut < 1.0 && y - static_cast<double>(j) >= cell.y.cut;
  return cell;
}

/// Height at any lattice position of the finer level.
RELIEF_KERNEL double blended_height(const DisplacedMeshView& mesh, double x, double y)
{
  const HeightFieldView &fine = *mesh.field, &coarse = *mesh.blend->coarse;
  const double w = mesh.blend->weight;
  return (1.0 - w) * interpolate_height(fine, x, y) +
         w * interpolate_height(coarse, lattice_on_level(x, fine.map.width, coarse.map.width),
                                lattice_on_level(y, fine.map.height, coarse.map.height));
}

/// Displacement along the unit normal at a lattice position of the finer level, metres. In a file of its own: where seams are
/// met, the code for whole levels stays as it is.
double blended_displacement(const DisplacedMeshView& mesh, double x, double y);

/// The point of a blended surface and its geometric normal, see surface_point.
/// @param i, j  the finer level's cell whose patches are meant
RELIEF_KERNEL SurfacePoint blended_surface_point(const DisplacedMeshView& mesh,
                                                 const DisplacedTriangle& tri,
                                                 double b1,
                                                 double b2,
                                                 std::int64_t i,
                                                 std::int64_t j)
{
  const BasePoint base = base_point(tri, b1, b2);
  const auto [x, y] = lattice_point(tri, b1, b2);
  const BlendedCell cell = blended_cell_at(mesh, i, j, x, y);
  const CellHeights heights = blended_heights(cell, blended_patches(mesh, cell), mesh.blend->weight);
  return patch_point(mesh, base, heights, x - static_cast<double>(i), y - static_cast<double>(j));
}

/// surface_point of whatever surface the mesh has.
RELIEF_KERNEL SurfacePoint traced_surface_point(const DisplacedMeshView& mesh,
                                                const DisplacedTriangle& tri,
                                                double b1,
                                                double b2)
{
  if (mesh.blend == nullptr) return surface_point(mesh, tri, b1, b2);
  const auto [x, y] = lattice_point(tri, b1, b2);
  return blended_surface_point(mesh, tri, b1, b2, static_cast<std::int64_t>(__builtin_floor(x)),
                               static_cast<std::int64_t>(__builtin_floor(y)));
}

/// surface_smooth_normal of whatever surface the mesh has: of a blend, by slopes taken over a texel of each level.
RELIEF_KERNEL Vec3d traced_smooth_normal(const DisplacedMeshView& mesh,
                                         const DisplacedTriangle& tri,
                                         double b1,
                                         double b2)
{
  if (mesh.blend == nullptr) return surface_smooth_normal(mesh, tri, b1, b2);
  const HeightFieldView &fine = *mesh.field, &coarse = *mesh.blend->coarse;
  const BasePoint base = base_point(tri, b1, b2);
  const auto [x, y] = lattice_point(tri, b1, b2);
  const double x_coarse = lattice_on_level(x, fine.map.width, coarse.map.width),
               y_coarse = lattice_on_level(y, fine.map.height, coarse.map.height);
  const LatticeSlopes f = smooth_slopes(fine, x, y), c = smooth_slopes(coarse, x_coarse, y_coarse);
  const double w = mesh.blend->weight;
  const double hx = (1.0 - w) * f.x + w * c.x * coarse.map.width / fine.map.width;
  const double hy = (1.0 - w) * f.y + w * c.y * coarse.map.height / fine.map.height;
  return surface_normal(base, blended_displacement(mesh, x, y), mesh.scale, hx, hy);
}

}  // namespace relief
