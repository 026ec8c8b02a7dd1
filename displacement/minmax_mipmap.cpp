#include "displacement/minmax_mipmap.h"

#include <algorithm>

#include <tbb/parallel_for.h>

namespace relief {

namespace {

constexpr StoredRange kEmpty{65535, 0};

int divide_up(int a, int b) { return (a + b - 1) / b; }

StoredRange quad_range(const MinmaxQuad& quad)
{
  return {*std::min_element(quad.low, quad.low + 4), *std::max_element(quad.high, quad.high + 4)};
}

/// Bounds of all cells of one row.
void cell_row(const HeightFieldView& f, int row, std::vector<StoredRange>& cells)
{
  const auto texel_row = [&](int j) {
    return static_cast<std::int64_t>(lattice_texel(f.y, f.y.first_cell + j)) * f.map.width;
  };
  const std::int64_t upper = texel_row(row), lower = texel_row(row + 1);
  const auto column_range = [&](int i) {
    const int column = lattice_texel(f.x, f.x.first_cell + i);
    return merge_ranges(texel_range(f, upper + column), texel_range(f, lower + column));
  };
  StoredRange left = column_range(0);
  for (int i = 0; i < f.x.num_cells; ++i) {
    const StoredRange right = column_range(i + 1);
    cells[static_cast<std::size_t>(i)] = merge_ranges(left, right);
    left = right;
  }
}

}  // namespace

MinmaxMipmap::MinmaxMipmap(const HeightFieldView& f)
{
  MinmaxMipmapView& mipmap = view_;
  mipmap.x = f.x;
  mipmap.y = f.y;
  int columns = f.x.num_cells, rows = f.y.num_cells;  // nodes of the level
  for (int level = 0;; ++level) {
    const int quad_columns = divide_up(columns, 2), quad_rows = divide_up(rows, 2);
    std::vector<MinmaxQuad> quads(static_cast<std::size_t>(quad_columns) * static_cast<std::size_t>(quad_rows));
    const MinmaxQuad* below = level == 0 ? nullptr : levels_.back().data();
    tbb::parallel_for(0, quad_rows, [&](int quad_row) {
      std::vector<StoredRange> nodes(static_cast<std::size_t>(columns));
      for (int half = 0; half < 2; ++half) {
        const int row = 2 * quad_row + half;
        if (row >= rows) {
          std::fill(nodes.begin(), nodes.end(), kEmpty);
        } else if (level == 0) {
          cell_row(f, row, nodes);
        } else {
          const MinmaxQuad* from = below + static_cast<std::ptrdiff_t>(row) * columns;
          for (StoredRange& node : nodes) node = quad_range(*from++);
        }
        for (int k = 0; k < 2 * quad_columns; ++k) {
          const StoredRange range = k < columns ? nodes[static_cast<std::size_t>(k)] : kEmpty;
          MinmaxQuad& quad = quads[static_cast<std::size_t>(quad_row) * static_cast<std::size_t>(quad_columns) +
                                   static_cast<std::size_t>(k / 2)];
          quad.low[2 * half + k % 2] = range.low;
          quad.high[2 * half + k % 2] = range.high;
        }
      }
    });
    levels_.push_back(std::move(quads));
    mipmap.levels[level] = levels_.back().data();
    mipmap.quad_columns[level] = quad_columns;
    mipmap.num_levels = level + 1;
    if (quad_columns == 1 && quad_rows == 1) break;
    columns = quad_columns;
    rows = quad_rows;
  }
}

std::size_t MinmaxMipmap::bytes() const
{
  std::size_t sum = 0;
  for (const auto& level : levels_) sum += level.size() * sizeof(MinmaxQuad);
  return sum;
}

MethodTable minmax_table_make(const HeightFieldView& field, const RmipOptions&)
{
  return method_table_of(std::make_shared<const MinmaxMipmap>(field));
}

}  // namespace relief
