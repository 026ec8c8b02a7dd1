// The lattice over a height map and its min-max pyramid, against every texel and against the oracle's interpolation.
#include "displacement/height_field.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "tests/displacement/judge.h"
#include "tests/displacement/random_cases.h"
#include "tests/displacement/table_test_maps.h"

namespace relief {
namespace {

constexpr int kSizes[][2] = {{1, 1}, {1, 9}, {6, 1}, {2, 2}, {3, 5}, {16, 16}, {17, 31}, {64, 63}, {65, 130}};

/// Calls a function with each map of a size and each pair of wraps.
template <typename Function>
void for_all_maps(Function&& function)
{
  for (const auto& size : kSizes) {
    for (const Wrap wrap_u : kAllWraps) {
      for (const Wrap wrap_v : kAllWraps) {
        SCOPED_TRACE(testing::Message() << size[0] << " x " << size[1] << ", wraps " << static_cast<int>(wrap_u) << " "
                                        << static_cast<int>(wrap_v));
        function(TableTestMap(size[0], size[1], wrap_u, wrap_v, 7));
      }
    }
  }
}

TEST(HeightFieldPyramid, HoldsExactlyTheExtremesOfItsTexels)
{
  for_all_maps([](const TableTestMap& map) {
    const HeightField field(map.view);
    const HeightFieldView& f = field.view();
    for (int level = 0; level < f.num_levels; ++level) {
      const int node = 1 << (2 * (level + 1)), line_cells = 4 * node;
      const int rows = (f.y.num_cells + line_cells - 1) / line_cells;
      ASSERT_EQ(f.line_columns[level], (f.x.num_cells + line_cells - 1) / line_cells);
      for (int line = 0; line < rows * f.line_columns[level]; ++line) {
        for (int child = 0; child < 16; ++child) {
          const int i = line % f.line_columns[level] * line_cells + child % 4 * node;
          const int j = line / f.line_columns[level] * line_cells + child / 4 * node;
          if (i >= f.x.num_cells || j >= f.y.num_cells) continue;
          const StoredRange expected =
              map.range(f.x.first_cell + i, f.y.first_cell + j, f.x.first_cell + std::min(i + node, f.x.num_cells),
                        f.y.first_cell + std::min(j + node, f.y.num_cells));
          ASSERT_EQ(f.lines[level][line].low[child], expected.low) << "level " << level << " cell " << i << " " << j;
          ASSERT_EQ(f.lines[level][line].high[child], expected.high) << "level " << level << " cell " << i << " " << j;
        }
      }
    }
    const auto [lowest, highest] = std::minmax_element(map.texels.begin(), map.texels.end());
    EXPECT_EQ(f.range.low, *lowest);
    EXPECT_EQ(f.range.high, *highest);
  });
}

TEST(HeightFieldPyramid, OfFloatsAndBytesHoldsAllHeights)
{
  std::mt19937_64 random(11);
  const TableTestMap map(37, 21, Wrap::kRepeat, Wrap::kClamp, 3);
  std::vector<float> floats;
  std::vector<std::uint8_t> bytes;
  for (const std::uint16_t texel : map.texels) {
    floats.push_back(-3.f + 1e-3f * static_cast<float>(texel) + static_cast<float>(random_unit(random)));
    bytes.push_back(static_cast<std::uint8_t>(texel >> 8));
  }
  HeightMapView view = map.view;
  view.format = HeightFormat::kFloat;
  view.texels = floats.data();
  const HeightField of_floats(view);
  view.format = HeightFormat::kU8;
  view.texels = bytes.data();
  const HeightField of_bytes(view);
  for (const HeightField* field : {&of_floats, &of_bytes}) {
    const HeightFieldView& f = field->view();
    // One unit of stored heights and the roundings are all that may be lost.
    for (std::int64_t j = f.y.first_cell; j < f.y.first_cell + f.y.num_cells; ++j) {
      for (std::int64_t i = f.x.first_cell; i < f.x.first_cell + f.x.num_cells; ++i) {
        double low, high, true_low = HUGE_VAL, true_high = -HUGE_VAL;
        stored_to_heights(f, height_field_range(f, i, j, i, j), &low, &high);
        for (int corner = 0; corner < 4; ++corner) {
          const double h = lattice_height(f, i + (corner & 1), j + (corner >> 1));
          true_low = std::min(true_low, h);
          true_high = std::max(true_high, h);
        }
        ASSERT_LE(low, true_low);
        ASSERT_GE(high, true_high);
        ASSERT_GE(low, true_low - 1.001 * f.h_step);
        ASSERT_LE(high, true_high + 1.001 * f.h_step);
      }
    }
  }
}

TEST(HeightFieldRange, IsNeverNarrowerThanTheTexelsAndHardlyWider)
{
  std::mt19937_64 random(5);
  for_all_maps([&](const TableTestMap& map) {
    const HeightField field(map.view);
    for (int k = 0; k < 60; ++k) {
      const int width = 1 + random_index(random, k % 2 == 0 ? 8 : 90), height = 1 + random_index(random, 40);
      const std::int64_t i = random_index(random, 200) - 100, j = random_index(random, 200) - 100;
      const StoredRange range = height_field_range(field.view(), i, j, i + width - 1, j + height - 1);
      const StoredRange truth = map.range(i, j, i + width, j + height);
      ASSERT_LE(range.low, truth.low) << i << " " << j << " " << width << " x " << height;
      ASSERT_GE(range.high, truth.high) << i << " " << j << " " << width << " x " << height;
      const int more = std::min(width, height) / 16;
      const StoredRange around = map.range(i - more, j - more, i + width + more, j + height + more);
      ASSERT_GE(range.low, around.low) << i << " " << j << " " << width << " x " << height;
      ASSERT_LE(range.high, around.high) << i << " " << j << " " << width << " x " << height;
    }
  });
}

TEST(HeightFieldInterpolation, IsTheOraclesAnywhere)
{
  std::mt19937_64 random(6);
  for (int k = 0; k < 300; ++k) {
    const RandomCase drawn = random_case(random, 0);
    for (const HeightFormat format : {HeightFormat::kU8, HeightFormat::kU16, HeightFormat::kFloat}) {
      const oracle::HeightMap map = stored_heights(drawn.map, format);
      const TracedCase traced({drawn.triangle}, map, format);
      for (int n = 0; n < 50; ++n) {
        const double u = random_between(random, -3, 3), v = random_between(random, -3, 3);
        const double actual = interpolate_height(*traced.mesh().field, u * map.width - .5, v * map.height - .5);
        // Positions have up to seven bits before the point, and heights differ by up to 1 a texel.
        ASSERT_NEAR(actual, oracle::height_eval(map, {u, v}), 1e-13) << "case " << k << " uv " << u << " " << v;
      }
    }
  }
}

}  // namespace
}  // namespace relief
