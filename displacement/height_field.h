// The height map as every displacement method sees it: a lattice of cells, one between each four neighbouring texel
// centres, with heights bilinear inside a cell; and a min-max pyramid over the cells.
//
// Lattice coordinates put texel centres at integers: x = u·width − ½, y = v·height − ½ (uv after the texture transform,
// v = 0 at the top row). Cell (i, j) spans [i, i + 1] × [j, j + 1]. Beyond the map the wrap mode says which texels are
// met, so cells repeat with a period: the width for kRepeat, twice that for kMirror. With kClamp the heights outside are
// those of the border: cells left of the first texel or right of the last are infinitely wide.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "kernel/shape/height_map_view.h"

namespace relief {

/// Conservative bounds of stored heights. Stored height q means h = h_offset + h_step · q.
struct StoredRange {
  std::uint16_t low = 0, high = 0;
};

/// Bounds of the 16 children of one pyramid node, row by row: one cache line.
struct alignas(64) PyramidLine {
  std::uint16_t low[16], high[16];
};

inline constexpr int kMaxPyramidLevels = 16;

/// Cells along one axis.
struct LatticeAxis {
  int num_texels = 1;
  Wrap wrap = Wrap::kRepeat;
  int num_cells = 1;   ///< in one period: n, 2n (kMirror) or n + 1 (kClamp, which has no period)
  int first_cell = 0;  ///< lattice coordinate of pyramid column 0: 0, or −1 for kClamp
};

RELIEF_KERNEL int lattice_modulo(std::int64_t a, int n)
{
  const auto r = static_cast<int>(a % n);
  return r < 0 ? r + n : r;
}

/// Texel at an integer lattice coordinate.
RELIEF_KERNEL int lattice_texel(const LatticeAxis& axis, std::int64_t i)
{
  const int n = axis.num_texels;
  if (i >= 0 && i < n) return static_cast<int>(i);  // mostly; divisions are slow
  if (axis.wrap == Wrap::kClamp) return i < 0 ? 0 : n - 1;
  if (axis.wrap == Wrap::kRepeat) return lattice_modulo(i, n);
  const int r = lattice_modulo(i, 2 * n);
  return r < n ? r : 2 * n - 1 - r;
}

/// The lattice and its pyramid, without ownership.
struct HeightFieldView {
  HeightMapView map;
  LatticeAxis x, y;
  double h_offset = 0, h_step = 1;  ///< of StoredRange
  /// lines[k] bounds nodes of 4^(k+1) cells a side, 16 in a line; the bounds of single cells are made from texels. The
  /// last level has one line.
  const PyramidLine* lines[kMaxPyramidLevels] = {};
  int line_columns[kMaxPyramidLevels] = {};  ///< lines in a row of a level
  int num_levels = 0;
  StoredRange range;  ///< of the whole map
  /// Bounds of bands of 2^log2_band cells from one end of the map to the other, in pyramid rows and columns: all that a
  /// ray along a row of tiles may meet.
  const StoredRange* row_bands = nullptr;
  const StoredRange* column_bands = nullptr;
  int log2_band = 0;
};

/// Height at an integer lattice coordinate.
RELIEF_KERNEL double lattice_height(const HeightFieldView& f, std::int64_t i, std::int64_t j)
{
  const std::int64_t at = static_cast<std::int64_t>(lattice_texel(f.y, j)) * f.map.width + lattice_texel(f.x, i);
  switch (f.map.format) {
    case HeightFormat::kU8:
      return static_cast<const std::uint8_t*>(f.map.texels)[at] / 255.0;
    case HeightFormat::kU16:
      return static_cast<const std::uint16_t*>(f.map.texels)[at] / 65535.0;
    case HeightFormat::kFloat:
      break;
  }
  return static_cast<const float*>(f.map.texels)[at];
}

/// Heights at the corners of a cell; bilinear between them: h = h00 + hx·fx + hy·fy + hxy·fx·fy with fx, fy from the
/// cell's lower corner.
struct CellHeights {
  double h00 = 0, hx = 0, hy = 0, hxy = 0;
};

RELIEF_KERNEL CellHeights cell_heights(const HeightFieldView& f, std::int64_t i, std::int64_t j)
{
  const double h00 = lattice_height(f, i, j), h10 = lattice_height(f, i + 1, j);
  const double h01 = lattice_height(f, i, j + 1), h11 = lattice_height(f, i + 1, j + 1);
  return {h00, h10 - h00, h01 - h00, (h11 - h01) - (h10 - h00)};
}

/// Height at any lattice position; double precision.
RELIEF_KERNEL double interpolate_height(const HeightFieldView& f, double x, double y)
{
  const double i = __builtin_floor(x), j = __builtin_floor(y);
  const CellHeights c = cell_heights(f, static_cast<std::int64_t>(i), static_cast<std::int64_t>(j));
  const double fx = x - i, fy = y - j;
  return c.h00 + c.hx * fx + (c.hy + c.hxy * fx) * fy;
}

/// Owns the pyramid of a height map; the texels stay where they are.
class HeightField {
 public:
  HeightField() = default;
  /// @param map  its texels must outlive the field
  /// @cost    0.27 bytes a texel (times 4 for kMirror on both axes); parallel over rows
  explicit HeightField(const HeightMapView& map);

  const HeightFieldView& view() const { return view_; }
  std::size_t bytes() const;  ///< besides the map

 private:
  void make_bands();

  std::vector<std::vector<PyramidLine>> levels_;
  std::vector<StoredRange> row_bands_, column_bands_;
  HeightFieldView view_;
};

/// The lattice of a map alone: without its pyramid and bounds.
HeightFieldView height_lattice_make(const HeightMapView& map);

/// The field of a map small enough to be made where it is needed, without bands: for chords within eight periods.
/// @param lines     room for the pyramid
/// @param num_lines at least what its levels take
HeightFieldView small_height_field_make(const HeightMapView& map, PyramidLine* lines, int num_lines);

/// Bounds of one texel's height.
/// @param at  row · width + column
StoredRange texel_range(const HeightFieldView& field, std::int64_t at);

/// Conservative bounds of the interpolated heights over whole cells.
/// @param i0, j0  first cell, inclusive; i1, j1  last cell, inclusive; lattice coordinates, any period
/// @return        bounds over the rectangle and at most a sixteenth of its shorter side more
StoredRange height_field_range(const HeightFieldView& field,
                               std::int64_t i0,
                               std::int64_t j0,
                               std::int64_t i1,
                               std::int64_t j1);

/// Bounds of the heights of stored bounds, rounded outward.
RELIEF_KERNEL void stored_to_heights(const HeightFieldView& f, StoredRange r, double* low, double* high)
{
  // One rounding each in the product and the sum; four ulps are enough and too little to matter.
  constexpr double kPad = 4.0 * 1.1102230246251565e-16;
  const double a = f.h_step * r.low, b = f.h_step * r.high;
  const double magnitude = __builtin_fabs(f.h_offset) + __builtin_fmax(__builtin_fabs(a), __builtin_fabs(b));
  *low = f.h_offset + a - kPad * magnitude;
  *high = f.h_offset + b + kPad * magnitude;
}

}  // namespace relief
