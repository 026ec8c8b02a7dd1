// A rectangle of the height map, as range queries take it.
#pragma once

#include "displacement/height_field.h"

namespace relief {

/// Closed rectangle in lattice coordinates, any period. x0 <= x1, y0 <= y1
struct LatticeRect {
  double x0 = 0, x1 = 0, y0 = 0, y1 = 0;
};

/// Columns (or rows) of a table that a stretch of an axis covers.
struct TableSpan {
  int first = 0;  ///< within one period
  int count = 1;  ///< at most one period; the last one may lie in the next period
};

/// @param low, high     lattice coordinates; what rounding may have done to them must have been added
/// @param num_columns   columns of the table in one period, each `num_cells / num_columns` lattice units wide
RELIEF_KERNEL TableSpan table_span(const LatticeAxis& axis, int num_columns, double low, double high)
{
  const double columns_per_cell = static_cast<double>(num_columns) / axis.num_cells;
  auto first = static_cast<std::int64_t>(__builtin_floor((low - axis.first_cell) * columns_per_cell));
  auto last = static_cast<std::int64_t>(__builtin_ceil((high - axis.first_cell) * columns_per_cell)) - 1;
  if (last < first) last = first;
  if (axis.wrap == Wrap::kClamp) {
    // Heights beyond the map are those of its border.
    const std::int64_t end = num_columns - 1;
    first = first < 0 ? 0 : (first > end ? end : first);
    last = last < 0 ? 0 : (last > end ? end : last);
    return {static_cast<int>(first), static_cast<int>(last - first) + 1};
  }
  if (last - first >= num_columns - 1) return {0, num_columns};
  // Most triangles lie in the first period: a division saved.
  const bool inside = first >= 0 && first < num_columns;
  return {inside ? static_cast<int>(first) : lattice_modulo(first, num_columns), static_cast<int>(last - first) + 1};
}

RELIEF_KERNEL StoredRange merge_ranges(StoredRange a, StoredRange b)
{
  return {a.low < b.low ? a.low : b.low, a.high > b.high ? a.high : b.high};
}

}  // namespace relief
