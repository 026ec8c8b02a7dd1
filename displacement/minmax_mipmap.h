// The min-max mipmap: a quadtree over the cells of a height field. It is the hierarchy of TFDM (methods/tfdm.cpp), and it
// answers range queries in RMIP's place where the two are compared.
#pragma once

#include <cstddef>
#include <vector>

#include "displacement/lattice_rect.h"
#include "displacement/method_table.h"

namespace relief {

/// Bounds of the four children of a node: (0, 0), (1, 0), (0, 1), (1, 1). Children outside of the period are empty:
/// low > high.
struct alignas(16) MinmaxQuad {
  std::uint16_t low[4], high[4];
};

inline constexpr int kMaxMipmapLevels = 32;

/// The mipmap without ownership. A node of level k has 2^k cells a side and starts at a multiple of that, counted from
/// the first cell of a period; the last one in a row may be cut off by the period's end.
struct MinmaxMipmapView {
  const MinmaxQuad* levels[kMaxMipmapLevels] = {};  ///< [k]: children of level k, by their parent
  int quad_columns[kMaxMipmapLevels] = {};          ///< parents in a row
  int num_levels = 0;                               ///< the last one has a single quad
  LatticeAxis x, y;

  /// @param column, row  of the node's parent at level k + 1
  const MinmaxQuad& quad(int k, int column, int row) const
  {
    return levels[k][static_cast<std::ptrdiff_t>(row) * quad_columns[k] + column];
  }
};

/// Bounds of one node.
RELIEF_KERNEL StoredRange minmax_node(const MinmaxMipmapView& mipmap, int level, int column, int row)
{
  const MinmaxQuad& quad = mipmap.quad(level, column >> 1, row >> 1);
  const int child = (column & 1) | (row & 1) << 1;
  return {quad.low[child], quad.high[child]};
}

/// Bounds of the heights over a rectangle, by at most four nodes that are neighbours, of the lowest level possible.
/// @param rect  rounding errors of its sides must have been added
/// @source      Greene, Kass, Miller 1993, "Hierarchical Z-buffer Visibility", as Thonat et al. 2023, §6, use it
RELIEF_KERNEL StoredRange range_query(const MinmaxMipmapView& mipmap, const LatticeRect& rect)
{
  const TableSpan x = table_span(mipmap.x, mipmap.x.num_cells, rect.x0, rect.x1);
  const TableSpan y = table_span(mipmap.y, mipmap.y.num_cells, rect.y0, rect.y1);
  const int longest = x.count > y.count ? x.count : y.count;
  // Nodes of half the length or less cannot do.
  int level = longest > 2 ? 31 - __builtin_clz(static_cast<unsigned>(longest - 1)) : 0;
  for (; level < mipmap.num_levels; ++level) {
    int columns[2], rows[2];
    const auto covers = [&](const LatticeAxis& axis, const TableSpan& span, int* nodes) {
      const int last = span.first + span.count - 1;
      const bool wraps = last >= axis.num_cells;
      nodes[0] = span.first >> level;
      nodes[1] = (wraps ? last - axis.num_cells : last) >> level;
      return wraps ? nodes[1] == 0 && nodes[0] == (axis.num_cells - 1) >> level : nodes[1] - nodes[0] <= 1;
    };
    if (!covers(mipmap.x, x, columns) || !covers(mipmap.y, y, rows)) continue;
    return merge_ranges(
        merge_ranges(minmax_node(mipmap, level, columns[0], rows[0]), minmax_node(mipmap, level, columns[1], rows[0])),
        merge_ranges(minmax_node(mipmap, level, columns[0], rows[1]), minmax_node(mipmap, level, columns[1], rows[1])));
  }
  // Nearly a whole period, across its end.
  const MinmaxQuad& root = mipmap.quad(mipmap.num_levels - 1, 0, 0);
  StoredRange range{65535, 0};
  for (int child = 0; child < 4; ++child) range = merge_ranges(range, {root.low[child], root.high[child]});
  return range;
}

/// Owns the mipmap; the height field is needed while it is built only.
class MinmaxMipmap {
 public:
  MinmaxMipmap() = default;
  /// @cost  5.3 bytes a cell, single cells included; parallel over rows
  explicit MinmaxMipmap(const HeightFieldView& field);

  const MinmaxMipmapView& view() const { return view_; }
  std::size_t bytes() const;

 private:
  std::vector<std::vector<MinmaxQuad>> levels_;
  MinmaxMipmapView view_;
};

/// A min-max mipmap as a method's table.
MethodTable minmax_table_make(const HeightFieldView& field, const RmipOptions& options);

}  // namespace relief
