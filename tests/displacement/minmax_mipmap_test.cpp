// The min-max mipmap against the extremes of all texels below its nodes and rectangles.
#include "displacement/minmax_mipmap.h"

#include <gtest/gtest.h>

#include "tests/displacement/table_test_maps.h"

namespace relief {
namespace {

TEST(MinmaxMipmap, NodesAreTheRangeOfTheirCells)
{
  for (const auto& [width, height] : kTableTestSizes) {
    for (const Wrap wrap : kAllWraps) {
      const TableTestMap map(width, height, wrap, wrap, 21);
      const HeightField field(map.view);
      const MinmaxMipmap mipmap(field.view());
      const MinmaxMipmapView& view = mipmap.view();
      const LatticeAxis &x = view.x, &y = view.y;
      for (int level = 0; level < view.num_levels; ++level) {
        const int columns = (x.num_cells + (1 << level) - 1) >> level, rows = (y.num_cells + (1 << level) - 1) >> level;
        for (int row = 0; row < rows; ++row) {
          for (int column = 0; column < columns; ++column) {
            const StoredRange range = minmax_node(view, level, column, row);
            const StoredRange truth = map.range(x.first_cell + (column << level), y.first_cell + (row << level),
                                                x.first_cell + std::min((column + 1) << level, x.num_cells),
                                                y.first_cell + std::min((row + 1) << level, y.num_cells));
            ASSERT_EQ(range.low, truth.low) << width << "x" << height << " level " << level;
            ASSERT_EQ(range.high, truth.high) << width << "x" << height << " level " << level;
          }
        }
      }
    }
  }
}

/// Conservative always; where the rectangle does not wrap, within the aligned squares of twice its size.
TEST(MinmaxMipmapQuery, IsNeverNarrowerThanTheTexelsAndAtMostFourNodes)
{
  for (const auto& [width, height] : kTableTestSizes) {
    for (const Wrap wrap_u : kAllWraps) {
      for (const Wrap wrap_v : kAllWraps) {
        const TableTestMap map(width, height, wrap_u, wrap_v, 22);
        const HeightField field(map.view);
        const MinmaxMipmap mipmap(field.view());
        const LatticeAxis &x = field.view().x, &y = field.view().y;
        const int n = x.num_cells, m = y.num_cells;
        for (int y0 = -m - 1; y0 <= m + 1; y0 += 1 + m / 4) {
          for (int rows = 1; rows <= m + 1; rows += 1 + m / 6) {
            for (int x0 = -n - 1; x0 <= n + 1; ++x0) {
              for (int columns = 1; columns <= n + 1; ++columns) {
                const StoredRange range =
                    range_query(mipmap.view(), {x0 + .25, x0 + columns - .25, y0 + .25, y0 + rows - .25});
                const StoredRange truth = map.range(x0, y0, x0 + columns, y0 + rows);
                ASSERT_LE(range.low, truth.low);
                ASSERT_GE(range.high, truth.high);
                const int i0 = x0 - x.first_cell, j0 = y0 - y.first_cell, i1 = i0 + columns, j1 = j0 + rows;
                if (i0 < 0 || j0 < 0 || i1 > n || j1 > m) continue;
                int size = 1;
                while ((i1 - 1) / size - i0 / size > 1 || (j1 - 1) / size - j0 / size > 1) size *= 2;
                const auto down = [&](int i) { return i / size * size; };
                const StoredRange nodes = map.range(x.first_cell + down(i0), y.first_cell + down(j0),
                                                    x.first_cell + std::min(down(i1 - 1) + size, n),
                                                    y.first_cell + std::min(down(j1 - 1) + size, m));
                ASSERT_EQ(range.low, nodes.low);
                ASSERT_EQ(range.high, nodes.high);
              }
            }
          }
        }
      }
    }
  }
}

}  // namespace
}  // namespace relief
