// Range of the heights over any rectangle, in constant time: four windows whose sides are powers of two.
//
// T. Thonat, I. Georgiev, F. Beaune, T. Boubekeur, "RMIP: Displacement ray-tracing via inversion and oblong bounding",
// SIGGRAPH Asia 2023.
#pragma once

#include "displacement/lattice_rect.h"

namespace relief {

/// The table without ownership.
struct RmipView {
  /// Bounds of windows of 2^p × 2^q blocks, by (q, p, row, column) of their first block. Windows wrap around the period.
  const StoredRange* windows = nullptr;
  int columns = 1, rows = 1;  ///< blocks in one period
  int num_widths = 1;         ///< p = 0 … num_widths − 1
  LatticeAxis x, y;

  const StoredRange* layer(int p, int q) const
  {
    return windows + (static_cast<std::ptrdiff_t>(q) * num_widths + p) * columns * rows;
  }
};

RELIEF_KERNEL int floor_log2(int n) { return 31 - __builtin_clz(static_cast<unsigned>(n)); }

/// Bounds of the heights over a rectangle; never narrower than the truth, tight to the blocks that it touches.
/// @param rect  rounding errors of its sides must have been added
/// @cost        four look-ups
/// @source      Thonat et al. 2023, Eq. 5 and Alg. 2. Blocks need not be powers of two in number; a rectangle as wide as
///              a period is answered by the whole period
RELIEF_KERNEL StoredRange range_query(const RmipView& table, const LatticeRect& rect)
{
  const TableSpan x = table_span(table.x, table.columns, rect.x0, rect.x1);
  const TableSpan y = table_span(table.y, table.rows, rect.y0, rect.y1);
  const int p = floor_log2(x.count), q = floor_log2(y.count);
  // The windows overlap instead of tiling: an extremum does not mind a block counted twice.
  int last_column = x.first + x.count - (1 << p), last_row = y.first + y.count - (1 << q);
  if (last_column >= table.columns) last_column -= table.columns;
  if (last_row >= table.rows) last_row -= table.rows;
  const StoredRange* upper = table.layer(p, q) + static_cast<std::ptrdiff_t>(y.first) * table.columns;
  const StoredRange* lower = table.layer(p, q) + static_cast<std::ptrdiff_t>(last_row) * table.columns;
  return merge_ranges(merge_ranges(upper[x.first], upper[last_column]),
                      merge_ranges(lower[x.first], lower[last_column]));
}

}  // namespace relief
