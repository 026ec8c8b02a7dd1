#include "displacement/height_field.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <tbb/parallel_for.h>

#include "kernel/assert.h"

namespace relief {

StoredRange texel_range(const HeightFieldView& f, std::int64_t at)
{
  switch (f.map.format) {
    case HeightFormat::kU8: {
      const auto q = static_cast<std::uint16_t>(static_cast<const std::uint8_t*>(f.map.texels)[at] * 257);
      return {q, q};
    }
    case HeightFormat::kU16: {
      const std::uint16_t q = static_cast<const std::uint16_t*>(f.map.texels)[at];
      return {q, q};
    }
    case HeightFormat::kFloat:
      break;
  }
  const double q = (static_cast<const float*>(f.map.texels)[at] - f.h_offset) / f.h_step;
  // The quotient is off by less than 2^-30 of a unit.
  return {static_cast<std::uint16_t>(std::clamp(std::floor(q - 0x1p-30), 0.0, 65535.0)),
          static_cast<std::uint16_t>(std::clamp(std::ceil(q + 0x1p-30), 0.0, 65535.0))};
}

namespace {

constexpr StoredRange kEmpty{65535, 0};

StoredRange merge(StoredRange a, StoredRange b) { return {std::min(a.low, b.low), std::max(a.high, b.high)}; }

LatticeAxis lattice_axis(int num_texels, Wrap wrap)
{
  switch (wrap) {
    case Wrap::kRepeat:
      return {num_texels, wrap, num_texels, 0};
    case Wrap::kMirror:
      return {num_texels, wrap, 2 * num_texels, 0};
    case Wrap::kClamp:
      break;
  }
  return {num_texels, wrap, num_texels + 1, -1};
}

StoredRange texel_range_at(const HeightFieldView& f, std::int64_t i, std::int64_t j)
{
  return texel_range(f, static_cast<std::int64_t>(lattice_texel(f.y, j)) * f.map.width + lattice_texel(f.x, i));
}

/// Least and greatest float of a map.
std::pair<float, float> float_extremes(const float* texels, std::size_t count)
{
  float low = texels[0], high = texels[0];
  for (std::size_t k = 1; k < count; ++k) {
    low = std::min(low, texels[k]);
    high = std::max(high, texels[k]);
  }
  return {low, high};
}

/// Bounds of 4 × 4 cells: of 5 × 5 texels, as bilinear interpolation stays between its corners.
StoredRange block_range(const HeightFieldView& f, int column, int row)
{
  StoredRange range = kEmpty;
  const int last_row = std::min(row + 4, f.y.num_cells), last_column = std::min(column + 4, f.x.num_cells);
  for (int j = row; j <= last_row; ++j) {
    const std::int64_t row_start = static_cast<std::int64_t>(lattice_texel(f.y, f.y.first_cell + j)) * f.map.width;
    for (int i = column; i <= last_column; ++i) {
      range = merge(range, texel_range(f, row_start + lattice_texel(f.x, f.x.first_cell + i)));
    }
  }
  return range;
}

StoredRange line_range(const PyramidLine& line)
{
  return {*std::min_element(line.low, line.low + 16), *std::max_element(line.high, line.high + 16)};
}

int divide_up(int a, int b) { return (a + b - 1) / b; }

/// Bounds of a line's 16 nodes, from the level below or from the texels.
/// @param columns, rows  nodes of the level
PyramidLine line_make(const HeightFieldView& f, int level, int columns, int rows, int line_column, int line_row)
{
  PyramidLine line;
  for (int child = 0; child < 16; ++child) {
    const int column = 4 * line_column + (child & 3), row = 4 * line_row + (child >> 2);
    StoredRange range = kEmpty;
    if (column < columns && row < rows) {
      range =
          level == 0
              ? block_range(f, 4 * column, 4 * row)
              : line_range(f.lines[level - 1][static_cast<std::ptrdiff_t>(row) * f.line_columns[level - 1] + column]);
    }
    line.low[child] = range.low;
    line.high[child] = range.high;
  }
  return line;
}

/// A rectangle of cells within one period, all inclusive, in pyramid columns and rows.
struct CellRect {
  int i0, j0, i1, j1;
};

/// Widens bounds by those of a rectangle.
/// @param column, row  first cell of a node of 4 × 4 children, each 4^level cells a side
/// @param finest       level at which a child that reaches over the rectangle is taken whole
void widen_by_node(const HeightFieldView& f,
                   int level,
                   int finest,
                   int column,
                   int row,
                   const CellRect& rect,
                   StoredRange* range)
{
  const int shift = 2 * level, size = 1 << shift;
  const int first_column = std::max(rect.i0 - column, 0) >> shift,
            last_column = std::min((rect.i1 - column) >> shift, 3);
  const int first_row = std::max(rect.j0 - row, 0) >> shift, last_row = std::min((rect.j1 - row) >> shift, 3);
  if (level == 0) {
    for (int j = row + first_row; j <= row + last_row + 1; ++j) {
      for (int i = column + first_column; i <= column + last_column + 1; ++i)
        *range = merge(*range, texel_range_at(f, f.x.first_cell + i, f.y.first_cell + j));
    }
    return;
  }
  const PyramidLine& line =
      f.lines[level - 1]
             [static_cast<std::ptrdiff_t>(row >> (shift + 2)) * f.line_columns[level - 1] + (column >> (shift + 2))];
  // Children that are taken whole come first: most of the others then have nothing to add, which spares a walk along
  // the rectangle's border.
  for (const bool whole : {true, false}) {
    for (int y = first_row; y <= last_row; ++y) {
      for (int x = first_column; x <= last_column; ++x) {
        const int i = column + x * size, j = row + y * size;
        const int i_end = std::min(i + size, f.x.num_cells) - 1, j_end = std::min(j + size, f.y.num_cells) - 1;
        const bool is_whole = level <= finest || (i >= rect.i0 && j >= rect.j0 && i_end <= rect.i1 && j_end <= rect.j1);
        if (is_whole != whole) continue;
        const StoredRange child{line.low[4 * y + x], line.high[4 * y + x]};
        if (child.low >= range->low && child.high <= range->high) continue;
        if (whole) {
          *range = merge(*range, child);
        } else {
          widen_by_node(f, level - 1, finest, i, j, rect, range);
        }
      }
    }
  }
}

/// Parts of [first, last] within single periods, in pyramid columns: at most two, or all of it once.
int split_by_period(const LatticeAxis& axis, std::int64_t first, std::int64_t last, int (*parts)[2])
{
  const int n = axis.num_cells;
  if (axis.wrap == Wrap::kClamp) {
    parts[0][0] = static_cast<int>(std::clamp<std::int64_t>(first - axis.first_cell, 0, n - 1));
    parts[0][1] = static_cast<int>(std::clamp<std::int64_t>(last - axis.first_cell, 0, n - 1));
    return 1;
  }
  if (last - first + 1 >= n) {
    parts[0][0] = 0;
    parts[0][1] = n - 1;
    return 1;
  }
  const int a = lattice_modulo(first, n), b = lattice_modulo(last, n);
  if (a <= b) {
    parts[0][0] = a;
    parts[0][1] = b;
    return 1;
  }
  parts[0][0] = a;
  parts[0][1] = n - 1;
  parts[1][0] = 0;
  parts[1][1] = b;
  return 2;
}

}  // namespace

HeightField::HeightField(const HeightMapView& map) : view_(height_lattice_make(map))
{
  HeightFieldView& f = view_;
  int columns = divide_up(f.x.num_cells, 4), rows = divide_up(f.y.num_cells, 4);  // nodes of the level below the lines
  for (int level = 0;; ++level) {
    const int line_columns = divide_up(columns, 4), line_rows = divide_up(rows, 4);
    std::vector<PyramidLine> lines(static_cast<std::size_t>(line_columns) * static_cast<std::size_t>(line_rows));
    tbb::parallel_for(0, line_rows, [&](int line_row) {
      for (int line_column = 0; line_column < line_columns; ++line_column) {
        lines[static_cast<std::size_t>(line_row) * static_cast<std::size_t>(line_columns) +
              static_cast<std::size_t>(line_column)] = line_make(f, level, columns, rows, line_column, line_row);
      }
    });
    levels_.push_back(std::move(lines));
    f.lines[level] = levels_.back().data();
    f.line_columns[level] = line_columns;
    f.num_levels = level + 1;
    if (line_columns == 1 && line_rows == 1) break;
    columns = line_columns;
    rows = line_rows;
  }
  f.range = line_range(levels_.back()[0]);
  make_bands();
}

HeightFieldView height_lattice_make(const HeightMapView& map)
{
  HeightFieldView f;
  f.map = map;
  f.x = lattice_axis(map.width, map.wrap_u);
  f.y = lattice_axis(map.height, map.wrap_v);
  f.h_step = 1.0 / 65535.0;
  if (map.format == HeightFormat::kFloat) {
    const auto count = static_cast<std::size_t>(map.width) * static_cast<std::size_t>(map.height);
    const auto [low, high] = float_extremes(static_cast<const float*>(map.texels), count);
    f.h_offset = low;
    f.h_step = high > low ? (static_cast<double>(high) - low) / 65535.0 : 1.0;
  }
  return f;
}

HeightFieldView small_height_field_make(const HeightMapView& map, PyramidLine* lines, int num_lines)
{
  HeightFieldView f = height_lattice_make(map);
  int columns = divide_up(f.x.num_cells, 4), rows = divide_up(f.y.num_cells, 4);
  for (int level = 0;; ++level) {
    const int line_columns = divide_up(columns, 4), line_rows = divide_up(rows, 4);
    RELIEF_ASSERT(line_columns * line_rows <= num_lines);
    num_lines -= line_columns * line_rows;
    f.lines[level] = lines;
    f.line_columns[level] = line_columns;
    f.num_levels = level + 1;
    for (int row = 0; row < line_rows; ++row) {
      for (int column = 0; column < line_columns; ++column) *lines++ = line_make(f, level, columns, rows, column, row);
    }
    if (line_columns == 1 && line_rows == 1) break;
    columns = line_columns;
    rows = line_rows;
  }
  f.range = line_range(lines[-1]);
  return f;
}

void HeightField::make_bands()
{
  // Of nodes of 4 cells, or of 16 where that takes less time than is worth talking of beside the pyramid.
  constexpr std::size_t kMostLines = 1 << 14;
  const int level = levels_.size() > 1 && levels_[0].size() > kMostLines ? 1 : 0;
  HeightFieldView& f = view_;
  f.log2_band = 2 * (level + 1);
  const int band = 1 << f.log2_band;
  const auto columns = static_cast<std::size_t>(divide_up(f.x.num_cells, band)),
             rows = static_cast<std::size_t>(divide_up(f.y.num_cells, band));
  column_bands_.assign(columns, kEmpty);
  row_bands_.assign(rows, kEmpty);
  const auto line_columns = static_cast<std::size_t>(f.line_columns[level]);
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t column = 0; column < columns; ++column) {
      const PyramidLine& line = f.lines[level][row / 4 * line_columns + column / 4];
      const std::size_t child = 4 * (row % 4) + column % 4;
      const StoredRange range{line.low[child], line.high[child]};
      column_bands_[column] = merge(column_bands_[column], range);
      row_bands_[row] = merge(row_bands_[row], range);
    }
  }
  f.row_bands = row_bands_.data();
  f.column_bands = column_bands_.data();
}

std::size_t HeightField::bytes() const
{
  std::size_t sum = (row_bands_.size() + column_bands_.size()) * sizeof(StoredRange);
  for (const auto& level : levels_) sum += level.size() * sizeof(PyramidLine);
  return sum;
}

StoredRange height_field_range(const HeightFieldView& f,
                               std::int64_t i0,
                               std::int64_t j0,
                               std::int64_t i1,
                               std::int64_t j1)
{
  int columns[2][2], rows[2][2];
  const int num_columns = split_by_period(f.x, i0, i1, columns), num_rows = split_by_period(f.y, j0, j1, rows);
  // Nodes of a sixteenth of the rectangle are fine enough: 4^finest <= side / 16.
  const std::int64_t side = std::min(i1 - i0, j1 - j0);
  int finest = 0;
  while (finest + 1 < f.num_levels && (std::int64_t{16} << (2 * (finest + 1))) <= side) ++finest;
  StoredRange range = kEmpty;
  for (int a = 0; a < num_columns; ++a) {
    for (int b = 0; b < num_rows; ++b) {
      widen_by_node(f, f.num_levels, finest, 0, 0, {columns[a][0], rows[b][0], columns[a][1], rows[b][1]}, &range);
    }
  }
  return range;
}

}  // namespace relief
