// Range queries of the RMIP against the extremes of all texels below them.
#include "displacement/rmip.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/displacement/table_test_maps.h"

namespace relief {
namespace {

/// First cell and past the last one of the blocks that a stretch touches; blocks may be of any width.
struct Cells {
  std::int64_t begin, end;
};

Cells touched_blocks(const LatticeAxis& axis, int num_blocks, double low, double high)
{
  const double width = static_cast<double>(axis.num_cells) / num_blocks;
  double first = std::floor((low - axis.first_cell) / width), last = std::ceil((high - axis.first_cell) / width);
  last = std::max(last, first + 1);
  if (axis.wrap == Wrap::kClamp) {
    first = std::clamp(first, 0.0, num_blocks - 1.0);
    last = std::clamp(last, 1.0, static_cast<double>(num_blocks));
  } else if (last - first >= num_blocks) {
    first = 0;
    last = num_blocks;
  }
  // Borders of blocks may be those of cells up to rounding.
  return {axis.first_cell + static_cast<std::int64_t>(std::floor(first * width + 1e-9)),
          axis.first_cell + static_cast<std::int64_t>(std::ceil(last * width - 1e-9))};
}

void expect_exact(const TableTestMap& map, const HeightField& field, const Rmip& rmip, const LatticeRect& rect)
{
  const RmipView& table = rmip.view();
  const StoredRange range = range_query(table, rect);
  const Cells x = touched_blocks(table.x, table.columns, rect.x0, rect.x1);
  const Cells y = touched_blocks(table.y, table.rows, rect.y0, rect.y1);
  const StoredRange expected = map.range(x.begin, y.begin, x.end, y.end);
  EXPECT_EQ(range.low, expected.low);
  EXPECT_EQ(range.high, expected.high);
  // Tight to the blocks is never narrower than the truth.
  const StoredRange truth =
      map.range(static_cast<std::int64_t>(std::floor(rect.x0)), static_cast<std::int64_t>(std::floor(rect.y0)),
                static_cast<std::int64_t>(std::max(std::ceil(rect.x1), std::floor(rect.x0) + 1)),
                static_cast<std::int64_t>(std::max(std::ceil(rect.y1), std::floor(rect.y0) + 1)));
  const double width = static_cast<double>(field.view().x.num_cells) / table.columns,
               height = static_cast<double>(field.view().y.num_cells) / table.rows;
  if (width == 1.0 && height == 1.0) {
    EXPECT_EQ(range.low, truth.low);
    EXPECT_EQ(range.high, truth.high);
  }
  EXPECT_LE(range.low, truth.low);
  EXPECT_GE(range.high, truth.high);
}

TEST(RmipQuery, IsTheRangeOfTheBlocksForEveryWindowOfSmallMaps)
{
  for (const auto& [width, height] : kTableTestSizes) {
    for (const Wrap wrap_u : kAllWraps) {
      for (const Wrap wrap_v : kAllWraps) {
        const TableTestMap map(width, height, wrap_u, wrap_v, 11);
        const HeightField field(map.view);
        // One block a cell; fewer, not dividing the cells; the default.
        for (const int resolution : {1 << 20, 3, 0}) {
          SCOPED_TRACE(testing::Message() << width << "x" << height << " wrap " << static_cast<int>(wrap_u)
                                          << static_cast<int>(wrap_v) << " R " << resolution);
          const Rmip rmip(field.view(), resolution);
          const int n = field.view().x.num_cells, m = field.view().y.num_cells;
          for (int y0 = -m - 1; y0 <= m + 1; y0 += 1 + m / 4) {
            for (int rows = 1; rows <= m + 1; rows += 1 + m / 6) {
              for (int x0 = -n - 1; x0 <= n + 1; ++x0) {
                for (int columns = 1; columns <= n + 1; ++columns) {
                  const LatticeRect rect{x0 + .25, x0 + columns - .25, y0 + .25, y0 + rows - .25};
                  ASSERT_NO_FATAL_FAILURE(expect_exact(map, field, rmip, rect));
                  if (HasFailure()) return;
                }
              }
            }
          }
        }
      }
    }
  }
}

TEST(RmipQuery, IsTheRangeOfTheBlocksForRandomRectangles)
{
  std::mt19937_64 random(5);
  const auto unit = [&] { return static_cast<double>(random() >> 11) * 0x1p-53; };
  for (const auto& [width, height] : {std::pair{64, 64}, {100, 37}, {129, 256}}) {
    for (const Wrap wrap : kAllWraps) {
      const TableTestMap map(width, height, wrap, wrap, 7);
      const HeightField field(map.view);
      for (const int resolution : {0, 16, 30}) {
        const Rmip rmip(field.view(), resolution);
        for (int k = 0; k < 500; ++k) {
          LatticeRect rect;
          rect.x0 = width * (6 * unit() - 3);
          rect.y0 = height * (6 * unit() - 3);
          rect.x1 = rect.x0 + width * 1.2 * unit() * unit();
          rect.y1 = rect.y0 + height * 1.2 * unit() * unit();
          expect_exact(map, field, rmip, rect);
          ASSERT_FALSE(HasFailure()) << width << "x" << height << " wrap " << static_cast<int>(wrap) << " query " << k;
        }
      }
    }
  }
}

TEST(RmipQuery, RoundsFloatHeightsOutward)
{
  std::mt19937_64 random(3);
  std::vector<float> texels(24 * 24);
  for (float& texel : texels) texel = static_cast<float>(random() >> 40) * 0x1p-20f - 3.0f;
  const HeightField field({texels.data(), 24, 24, HeightFormat::kFloat});
  const Rmip rmip(field.view(), 24);
  for (int j = 0; j < 23; ++j) {
    for (int i = 0; i < 23; ++i) {
      double low, high;
      stored_to_heights(field.view(), range_query(rmip.view(), {i + .1, i + .9, j + .1, j + .9}), &low, &high);
      for (const int at : {24 * j + i, 24 * j + i + 1, 24 * j + i + 24, 24 * j + i + 25}) {
        EXPECT_LE(low, texels[static_cast<std::size_t>(at)]);
        EXPECT_GE(high, texels[static_cast<std::size_t>(at)]);
      }
    }
  }
}

TEST(RmipResolution, IsThePapersForItsMaps)
{
  EXPECT_EQ(rmip_linear_resolution(2048), 256);
  EXPECT_EQ(rmip_linear_resolution(4096), 512);
  EXPECT_EQ(rmip_linear_resolution(1), 1);
  for (int n = 1; n < 5000; ++n) EXPECT_LE(rmip_linear_resolution(n), n);
}

}  // namespace
}  // namespace relief
