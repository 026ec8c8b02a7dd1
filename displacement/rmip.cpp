#include "displacement/rmip.h"

#include <algorithm>
#include <cmath>

#include <tbb/parallel_for.h>

namespace relief {

namespace {

constexpr StoredRange kEmpty{65535, 0};

/// Cells that block k of an axis touches.
struct BlockCells {
  int begin, end;  ///< pyramid columns, half-open
};

BlockCells block_cells(const LatticeAxis& axis, int num_blocks, int k)
{
  const std::int64_t n = axis.num_cells;
  return {static_cast<int>(k * n / num_blocks), static_cast<int>(((k + 1) * n + num_blocks - 1) / num_blocks)};
}

/// Bounds of single blocks: of all texels at the corners of their cells, as bilinear interpolation stays between them.
void blockwise_range(const HeightFieldView& f, const RmipView& table, StoredRange* blocks)
{
  tbb::parallel_for(0, table.rows, [&](int row) {
    const BlockCells rows = block_cells(f.y, table.rows, row);
    std::vector<StoredRange> columns(static_cast<std::size_t>(f.x.num_cells) + 1, kEmpty);
    for (int j = rows.begin; j <= rows.end; ++j) {
      const std::int64_t start = static_cast<std::int64_t>(lattice_texel(f.y, f.y.first_cell + j)) * f.map.width;
      int i = f.x.first_cell;
      for (StoredRange& column : columns) {
        column = merge_ranges(column, texel_range(f, start + lattice_texel(f.x, i++)));
      }
    }
    for (int column = 0; column < table.columns; ++column) {
      const BlockCells cells = block_cells(f.x, table.columns, column);
      StoredRange range = kEmpty;
      for (int i = cells.begin; i <= cells.end; ++i) range = merge_ranges(range, columns[static_cast<std::size_t>(i)]);
      blocks[static_cast<std::ptrdiff_t>(row) * table.columns + column] = range;
    }
  });
}

/// The other half of a window twice as long; none beyond the end of an axis without a period.
int second_half(const LatticeAxis& axis, int num_blocks, int first, int length)
{
  const int at = first + length;
  if (at < num_blocks) return at;
  return axis.wrap == Wrap::kClamp ? first : at - num_blocks;
}

}  // namespace

int rmip_linear_resolution(int num_cells)
{
  const auto excess = [&](int log2_size) {
    return std::abs(std::log(std::ldexp(1.0 + log2_size, log2_size) / num_cells));
  };
  int best = 0;
  for (int k = 1; (1 << k) <= num_cells; ++k) {
    if (excess(k) < excess(best)) best = k;
  }
  return 1 << best;
}

Rmip::Rmip(const HeightFieldView& f, int resolution)
{
  RmipView& table = view_;
  table.x = f.x;
  table.y = f.y;
  table.columns = resolution > 0 ? std::min(resolution, f.x.num_cells) : rmip_linear_resolution(f.x.num_cells);
  table.rows = resolution > 0 ? std::min(resolution, f.y.num_cells) : rmip_linear_resolution(f.y.num_cells);
  table.num_widths = 1 + floor_log2(table.columns);
  const int num_heights = 1 + floor_log2(table.rows);
  const auto layer_size = static_cast<std::ptrdiff_t>(table.columns) * table.rows;
  windows_.resize(static_cast<std::size_t>(layer_size * table.num_widths * num_heights));
  table.windows = windows_.data();
  const auto layer = [&](int p, int q) {
    return windows_.data() + (static_cast<std::ptrdiff_t>(q) * table.num_widths + p) * layer_size;
  };

  blockwise_range(f, table, layer(0, 0));
  // The supplement's Alg. 1 joins windows within the map and decomposes those that wrap in a third pass. A window twice
  // as long is two windows also across the period's end, as long as it is no longer than the period: one rule for both.
  for (int p = 0; p + 1 < table.num_widths; ++p) {
    tbb::parallel_for(0, table.rows, [&](int row) {
      const StoredRange* from = layer(p, 0) + static_cast<std::ptrdiff_t>(row) * table.columns;
      StoredRange* to = layer(p + 1, 0) + static_cast<std::ptrdiff_t>(row) * table.columns;
      for (int column = 0; column < table.columns; ++column) {
        to[column] = merge_ranges(from[column], from[second_half(f.x, table.columns, column, 1 << p)]);
      }
    });
  }
  for (int q = 0; q + 1 < num_heights; ++q) {
    tbb::parallel_for(0, table.rows, [&](int row) {
      const std::ptrdiff_t near_row = static_cast<std::ptrdiff_t>(row) * table.columns;
      const std::ptrdiff_t far_row =
          static_cast<std::ptrdiff_t>(second_half(f.y, table.rows, row, 1 << q)) * table.columns;
      for (int p = 0; p < table.num_widths; ++p) {
        const StoredRange *a = layer(p, q) + near_row, *b = layer(p, q) + far_row;
        StoredRange* to = layer(p, q + 1) + near_row;
        for (int column = 0; column < table.columns; ++column) to[column] = merge_ranges(a[column], b[column]);
      }
    });
  }
}

MethodTable rmip_table_make(const HeightFieldView& field, const RmipOptions& options)
{
  return method_table_of(std::make_shared<const Rmip>(field, options.resolution));
}

}  // namespace relief
