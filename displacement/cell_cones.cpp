#include "displacement/cell_cones.h"

#include <algorithm>
#include <cmath>

#include <tbb/parallel_for.h>

namespace relief {

namespace {

/// Largest heights of blocks of 2^level cells a side of one period.
struct MaximumLevel {
  int columns = 0, rows = 0;
  std::vector<float> most;
  float at(int i, int j) const
  {
    return most[static_cast<std::size_t>(j) * static_cast<std::size_t>(columns) + static_cast<std::size_t>(i)];
  }
};

float rounded_up(double h) { return std::nextafter(static_cast<float>(h), HUGE_VALF); }

/// A block beyond the period: of its copy, or beside a clamped map that of the border.
int wrapped(const LatticeAxis& axis, int i, int count)
{
  if (axis.wrap == Wrap::kClamp) return std::clamp(i, 0, count - 1);
  return i < 0 ? i + count : i >= count ? i - count : i;
}

}  // namespace

CellCones::CellCones(const HeightFieldView& f)
{
  std::vector<MaximumLevel> levels;
  levels.reserve(32);  // references stay
  MaximumLevel& finest = levels.emplace_back();
  finest.columns = f.x.num_cells;
  finest.rows = f.y.num_cells;
  const auto columns = static_cast<std::size_t>(finest.columns), rows = static_cast<std::size_t>(finest.rows);
  finest.most.resize(columns * rows);
  tbb::parallel_for(0, finest.rows, [&](int row) {
    for (int column = 0; column < finest.columns; ++column) {
      const CellHeights c = cell_heights(f, f.x.first_cell + column, f.y.first_cell + row);
      const double most = std::max(std::max(c.h00, c.h00 + c.hx), std::max(c.h00 + c.hy, c.h00 + c.hx + c.hy + c.hxy));
      finest.most[static_cast<std::size_t>(row) * columns + static_cast<std::size_t>(column)] = rounded_up(most);
    }
  });
  while (levels.back().columns > 1 || levels.back().rows > 1) {
    const MaximumLevel& below = levels.back();
    MaximumLevel level;
    level.columns = (below.columns + 1) / 2;
    level.rows = (below.rows + 1) / 2;
    for (int j = 0; j < level.rows; ++j) {
      for (int i = 0; i < level.columns; ++i) {
        const int right = std::min(2 * i + 1, below.columns - 1), lower = std::min(2 * j + 1, below.rows - 1);
        level.most.push_back(std::max(std::max(below.at(2 * i, 2 * j), below.at(right, 2 * j)),
                                      std::max(below.at(2 * i, lower), below.at(right, lower))));
      }
    }
    levels.push_back(std::move(level));
  }
  const float highest = levels.back().at(0, 0);

  cells_.resize(columns * rows);
  tbb::parallel_for(0, finest.rows, [&](int row) {
    for (int column = 0; column < finest.columns; ++column) {
      float top = -HUGE_VALF;
      for (int j = -1; j <= 1; ++j) {
        for (int i = -1; i <= 1; ++i) {
          top = std::max(top, finest.at(wrapped(f.x, column + i, finest.columns), wrapped(f.y, row + j, finest.rows)));
        }
      }
      double rise = 0;
      // Blocks around the cell's own on each level hold all that is beyond those of the level below.
      double reach = 1;
      for (std::size_t level = 0; level < levels.size() && highest > top; ++level) {
        const MaximumLevel& blocks = levels[level];
        const int size = 1 << level, own_i = column >> level, own_j = row >> level;
        for (int j = own_j - 1; j <= own_j + 1; ++j) {
          for (int i = own_i - 1; i <= own_i + 1; ++i) {
            if (i == own_i && j == own_j) continue;
            // The last block of a period may be cut short; its copies begin there.
            const bool beside = i < 0 || j < 0 || i >= blocks.columns || j >= blocks.rows;
            const float most =
                beside ? highest : blocks.at(wrapped(f.x, i, blocks.columns), wrapped(f.y, j, blocks.rows));
            if (!(most > top)) continue;
            const auto gap = [size](int own, int block, int cell, int period) {
              if (block == own) return 0;
              if (block > own) return std::min(block * size, period) - cell - 1;
              return cell - (block + 1) * size;
            };
            const double x = gap(own_i, i, column, finest.columns), y = gap(own_j, j, row, finest.rows);
            // Nearer than a cell are only the nine, which are no higher than the top.
            const double distance = std::max(std::hypot(std::max(x, 0.0), std::max(y, 0.0)), 1.0);
            rise = std::max(rise, (static_cast<double>(most) - top) / distance);
          }
        }
        reach = size;
      }
      // Whatever is farther away than the last blocks.
      rise = std::max(rise, (static_cast<double>(highest) - top) / std::max(reach, 1.0));
      cells_[static_cast<std::size_t>(row) * columns + static_cast<std::size_t>(column)] = {top, rounded_up(rise)};
    }
  });
  view_.cells = cells_.data();
}

MethodTable cell_cones_table_make(const HeightFieldView& field, const RmipOptions&)
{
  return method_table_of(std::make_shared<const CellCones>(field));
}

}  // namespace relief
