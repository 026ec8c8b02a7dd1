// Builds the rectangular min-max pyramid (RMIP) of a height field; rmip_query.h says what it answers.
#pragma once

#include <cstddef>
#include <vector>

#include "displacement/method_table.h"
#include "displacement/rmip_query.h"

namespace relief {

/// Blocks along an axis for which the table has about as many entries as the map has cells.
/// @return  the power of two R for which R·(1 + log2 R) is nearest to num_cells, at most num_cells
/// @source  Thonat et al. 2023, supplement, §1.2; rounded to a power of two as in their results (2048: 256, 4096: 512)
int rmip_linear_resolution(int num_cells);

/// Owns the table; the height field is needed while it is built only.
class Rmip {
 public:
  Rmip() = default;
  /// @param resolution  blocks along each axis, at most one a cell; 0: rmip_linear_resolution of each axis
  /// @cost    4 bytes an entry, columns · (1 + ⌊log2 columns⌋) · rows · (1 + ⌊log2 rows⌋) of them; parallel
  explicit Rmip(const HeightFieldView& field, int resolution = 0);

  const RmipView& view() const { return view_; }
  std::size_t bytes() const { return windows_.size() * sizeof(StoredRange); }

 private:
  std::vector<StoredRange> windows_;
  RmipView view_;
};

/// An RMIP as a method's table.
MethodTable rmip_table_make(const HeightFieldView& field, const RmipOptions& options);

}  // namespace relief
