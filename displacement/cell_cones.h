// Empty space over a height map: how far a ray over a cell may go before anything can be as high as it is. A cone map whose
// apexes stand for all of a cell, so that interpolation is in it.
//
// Over a cell's 3 × 3 neighbourhood nothing is higher than `top`. At a distance r from the cell (r > 1, beyond them) nothing is
// higher than top + r · rise. So a ray at height z > top that falls by f a lattice unit is free for (z − top)/(rise + f) units.
//
// Dummer 2006, "Cone Step Mapping", has cones over texels and interpolates them, which may overstep; Bán and others 2024, "Robust
// Cone Step Mapping", correct theirs over 3 × 3 texels. Made by a maximum mipmap as in Valasek and Bán 2022, "Quick Cone Map
// Generation on the GPU".
#pragma once

#include <cstddef>
#include <vector>

#include "displacement/height_field.h"
#include "displacement/method_table.h"

namespace relief {

struct CellCone {
  float top = 0;   ///< map's heights, rounded up
  float rise = 0;  ///< a lattice unit, rounded up
};

struct CellConesView {
  const CellCone* cells = nullptr;  ///< of one period, row by row: pyramid columns and rows of the height field
};

class CellCones {
 public:
  /// @cost  8 bytes a cell, and as much again while it is made; parallel over rows
  explicit CellCones(const HeightFieldView& field);
  const CellConesView& view() const { return view_; }
  std::size_t bytes() const { return cells_.size() * sizeof(CellCone); }

 private:
  std::vector<CellCone> cells_;
  CellConesView view_;
};

/// As a method's table. Not of RMIP's options.
MethodTable cell_cones_table_make(const HeightFieldView& field, const RmipOptions& options);

}  // namespace relief
