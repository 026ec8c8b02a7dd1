// The fast method: a ray's curve over the height map as straight chords, each a plain ray over a plain height field,
// which descends a pyramid of 4 × 4 children to single cells.
//
// Exact in spite of straight chords: the curve is known in closed form (ray_curve.h), and so is what it can deviate from
// a chord, in both lattice coordinates and in height. Every rectangle and height interval is widened by that, so no cell
// is passed over; the leaf test is done on the curve itself. Eight chords, and eight children, are tested side by side.
//
// Reading order: traverse, segment_intersect, chords_intersect, chord_intersect, node_intersect.
#include "displacement/lanes.h"
#include "displacement/method.h"

namespace relief {

namespace {

/// Rounding of a few float operations in sequence on numbers up to the one it is multiplied with.
inline constexpr float kFloatSlack = 0x1p-20f;
/// What the float parameter of a chord may be off by.
inline constexpr float kParameterSlack = 0x1p-18f;
/// A chord is split while it may deviate by more than this from the curve; a matter of speed only. Lattice units, and
/// parts of the map's range.
inline constexpr float kWantedDeviation = 0.3f;
inline constexpr float kWantedHeightDeviation = 1.0f / 128;
inline constexpr int kMaxSplits = 6;
/// Curves are cut in double precision until the least of their W is at least this part of the largest: floats would
/// lose it.
inline constexpr double kLeastFloatW = 0x1p-10;
/// Metres between two stored heights, below which a displacement is taken for none: floats of stored units end there.
inline constexpr double kLeastHeightStep = 1e-25;
/// Where an unbounded cell beside a clamped map ends: beyond all lattice coordinates.
inline constexpr float kFarAway = 1e18f;
/// Chords are split down to so many periods of the map, as long as what they run along (bands_meet) does not rule them
/// out; below, one tile after the other costs less.
inline constexpr float kPeriodsAChord = 8;
/// Lattice units that a float can count with little error, see slack_x.
inline constexpr float kFloatUnits = 0x1p17f;
/// A triangle that reaches less far beside a clamped map is traced like any other.
inline constexpr double kLittleBeside = 16;

/// A straight stretch of the curve. Positions are relative to an integer lattice point, heights in stored units.
struct Chord {
  std::int64_t origin_x, origin_y;
  float x0, y0, q0;      ///< at u = 0
  float dx, dy, dq;      ///< to u = 1
  float inv_dx, inv_dy;  ///< finite, also where dx or dy is 0
  float pad_x, pad_y, pad_q;
  double tau0, dtau;  ///< τ = tau0 + u·dtau
};

struct ChordSearch : PrismSearch {
  double q_per_metre = 1, q_zero = 0;  ///< stored height = q_zero + q_per_metre · displacement
  float q_pad = 0;                     ///< and this much more or less
  const CurveSegment* segment = nullptr;
  const double *x = nullptr,
               *y = nullptr;     ///< lattice coordinates of the vertices, or of one place for all, see ClampCuts
  float long_x = 0, long_y = 0;  ///< chords are split while they are longer
  int max_long_splits = 0;       ///< after which none is
  double tau_end = 1;            ///< nothing beyond matters: a hit is known there
};

/// Heights of five texels in a row, stored units; the other lanes are anything.
/// @param i, j    lattice coordinates of the first
/// @param inside  eight texels from there are in the map's row, so that they can be read at once
RELIEF_KERNEL F8 row_heights(const HeightFieldView& f, std::int64_t i, std::int64_t j, int column, bool inside)
{
  const HeightMapView& map = f.map;
  const std::int64_t row = static_cast<std::int64_t>(lattice_texel(f.y, j)) * map.width;
  if (inside && map.format == HeightFormat::kU16) {
    return load8(static_cast<const std::uint16_t*>(map.texels) + row + column);
  }
  if (inside && map.format == HeightFormat::kU8) {
    return load8(static_cast<const std::uint8_t*>(map.texels) + row + column) * 257.0f;
  }
  alignas(32) float values[8] = {};
  for (int k = 0; k < 5; ++k) {
    const std::int64_t at = row + lattice_texel(f.x, i + k);
    switch (map.format) {
      case HeightFormat::kU8:
        values[k] = static_cast<const std::uint8_t*>(map.texels)[at] * 257.0f;
        break;
      case HeightFormat::kU16:
        values[k] = static_cast<const std::uint16_t*>(map.texels)[at];
        break;
      case HeightFormat::kFloat:
        values[k] = static_cast<float>((static_cast<const float*>(map.texels)[at] - f.h_offset) / f.h_step);
        break;
    }
  }
  return load8(values);
}

/// @return  true when the search is over
RELIEF_KERNEL bool cell_on_chord_intersect(ChordSearch& c,
                                           const Chord& chord,
                                           std::int64_t i,
                                           std::int64_t j,
                                           float u0,
                                           float u1)
{
  const auto tau_at = [&](double u) { return chord.tau0 + u * chord.dtau; };
  if (!cell_intersect(c, *c.segment, i, j, tau_at(static_cast<double>(u0) - kParameterSlack),
                      tau_at(static_cast<double>(u1) + kParameterSlack))) {
    return false;
  }
  if (c.unfolded) c.tau_end = c.hit.tau;
  return c.any_hit;
}

/// A node of 4^level cells a side in one period of the lattice.
struct Node {
  int column, row;  ///< its first cell, in pyramid columns
  int level;
  float u0, u1;  ///< where the chord may be inside
};

/// The bounds of a node's children.
/// @param column, row  of any of its cells, in pyramid columns
/// @param level        of the node, 2 or more
RELIEF_KERNEL const PyramidLine& children_line(const HeightFieldView& f, int column, int row, int level)
{
  const std::ptrdiff_t row_of_lines = row >> (2 * level);
  return f.lines[level - 2][row_of_lines * f.line_columns[level - 2] + (column >> (2 * level))];
}

/// Starts to fetch the texels of a node of 4 × 4 cells.
/// @param i, j  lattice coordinates of its first cell
RELIEF_KERNEL void prefetch_cells(const HeightFieldView& f, std::int64_t i, std::int64_t j)
{
  static_assert(static_cast<int>(HeightFormat::kU8) == 0 && static_cast<int>(HeightFormat::kU16) == 1 &&
                static_cast<int>(HeightFormat::kFloat) == 2);
  const int log2_bytes = static_cast<int>(f.map.format);
  const std::int64_t column = lattice_texel(f.x, i);
  for (int r = 0; r < 5; ++r) {
    const std::int64_t at = static_cast<std::int64_t>(lattice_texel(f.y, j + r)) * f.map.width + column;
    __builtin_prefetch(static_cast<const char*>(f.map.texels) + (at << log2_bytes));
  }
}

/// Children that are met, nearest first: they are few.
/// @param hits   bit by child
/// @param entry  where the chord enters each
/// @return       how many
RELIEF_KERNEL int order_by_entry(unsigned hits, const float* entry, int* order)
{
  int count = 0;
  for (; hits != 0; hits &= hits - 1) {
    const int child = __builtin_ctz(hits);
    int k = count++;
    for (; k > 0 && entry[order[k - 1]] > entry[child]; --k) order[k] = order[k - 1];
    order[k] = child;
  }
  return count;
}

/// What a chord needs of a node's children, the same for all nodes: lanes 0…3 are columns, lanes 4…7 rows. A child is entered
/// by one of its lines and left by the other.
struct ChordSlabs {
  F8 start;                   ///< of the chord, from its origin
  F8 inverse;                 ///< of how far it goes along the axis
  F8 enter_lane, leave_lane;  ///< lines, in children from the node's corner
  F8 enter_pad, leave_pad;    ///< outward
  I8 forward;                 ///< where the chord's coordinate grows
};

RELIEF_KERNEL F8 by_axis(float x, float y) { return F8{x, x, x, x, y, y, y, y}; }

RELIEF_KERNEL ChordSlabs chord_slabs_make(const Chord& chord)
{
  ChordSlabs s;
  s.start = by_axis(chord.x0, chord.y0);
  s.inverse = by_axis(chord.inv_dx, chord.inv_dy);
  s.forward = s.inverse > 0.0f;
  const F8 lane{0, 1, 2, 3, 0, 1, 2, 3}, pad = by_axis(chord.pad_x, chord.pad_y);
  s.enter_lane = s.forward ? lane : lane + 1.0f;
  s.leave_lane = s.forward ? lane + 1.0f : lane;
  s.enter_pad = s.forward ? -pad : pad;
  s.leave_pad = -s.enter_pad;
  return s;
}

/// A chord's descent through the nodes of one period of the lattice.
struct ChordDescent {
  const HeightFieldView& field;
  const Chord& chord;
  const ChordSlabs& slabs;
  std::int64_t period_x, period_y;  ///< lattice coordinates of pyramid column and row 0
  std::int64_t offset_x, offset_y;  ///< the same from the chord's origin
  float cell_slack;                 ///< rounding of heights up to 65535, and of float maps to stored units
  float twist_pad;
  float u_limit;  ///< of the chord, beyond which nothing matters
};

/// Of a chord, beyond which nothing matters any more.
RELIEF_KERNEL float chord_limit(const ChordSearch& c, const Chord& chord)
{
  const double left = (c.tau_end - chord.tau0) / chord.dtau;
  return left < 1.0 ? static_cast<float>(left) + 2.0f * kParameterSlack : 1.0f + 2.0f * kParameterSlack;
}

RELIEF_KERNEL ChordDescent chord_descent_make(const ChordSearch& c,
                                              const Chord& chord,
                                              const ChordSlabs& slabs,
                                              std::int64_t period_x,
                                              std::int64_t period_y)
{
  return {*c.mesh.field,
          chord,
          slabs,
          period_x,
          period_y,
          period_x - chord.origin_x,
          period_y - chord.origin_y,
          chord.pad_q + 65536.0f * 4.0f * kFloatSlack,
          (1.0f + chord.pad_x) * chord.pad_y + (1.0f + chord.pad_y) * chord.pad_x + chord.pad_x * chord.pad_y,
          chord_limit(c, chord)};
}

/// What the children of a node are: nodes, of which only their bounds are known, or cells. Either is left open.
struct NodeChildren {
  int level;  ///< 0: cells
  int size;   ///< of one, cells a side
  F8 low[2], high[2];
  F8 heights[5];  ///< of texels, a row each
};

RELIEF_KERNEL void node_children_load(const ChordDescent& d, const Node& n, NodeChildren& out)
{
  const HeightFieldView& f = d.field;
  out.level = n.level - 1;
  out.size = 1 << (2 * out.level);
  if (out.level == 0) {
    const std::int64_t i = d.period_x + n.column, j = d.period_y + n.row;
    const int column = lattice_texel(f.x, i);
    const bool inside = f.x.wrap != Wrap::kMirror && (f.x.wrap == Wrap::kRepeat || i >= 0) && column + 8 <= f.map.width;
    for (int r = 0; r < 5; ++r) out.heights[r] = row_heights(f, i, j + r, column, inside);
    return;
  }
  const PyramidLine& line = children_line(f, n.column, n.row, n.level);
  for (int half = 0; half < 2; ++half) {
    out.low[half] = load8(line.low + 8 * half);
    out.high[half] = load8(line.high + 8 * half);
  }
}

/// Where a chord is between the lines of a node's children, lanes as in ChordSlabs.
struct ChildSlabs {
  F8 corner;        ///< of the node, from the chord's start
  F8 enter, leave;  ///< along each axis, from there
  unsigned exists;  ///< children that do, a bit each
};

RELIEF_KERNEL ChildSlabs child_slabs_make(const ChordDescent& d, const Node& n, int size)
{
  const HeightFieldView& f = d.field;
  const ChordSlabs& slabs = d.slabs;
  const bool clamp_x = f.x.wrap == Wrap::kClamp, clamp_y = f.y.wrap == Wrap::kClamp;
  const float width = static_cast<float>(size);
  ChildSlabs s;
  s.corner = by_axis(static_cast<float>(d.offset_x + n.column), static_cast<float>(d.offset_y + n.row)) - slabs.start;
  s.enter = fused(slabs.enter_lane, splat8(width), s.corner + slabs.enter_pad);
  s.leave = fused(slabs.leave_lane, splat8(width), s.corner + slabs.leave_pad);
  s.exists = 0xffff;
  if (n.column + 4 * size >= f.x.num_cells || n.row + 4 * size >= f.y.num_cells ||
      ((clamp_x || clamp_y) && (n.column == 0 || n.row == 0))) [[unlikely]] {
    // Columns are small integers; far beside a clamped map floats do not tell `corner` of one from that of the next (hard
    // cases "clamp at uv …").
    const F8 lane{0, 1, 2, 3, 0, 1, 2, 3};
    const F8 index = lane * width + by_axis(static_cast<float>(n.column), static_cast<float>(n.row));
    const F8 count = by_axis(static_cast<float>(f.x.num_cells), static_cast<float>(f.y.num_cells));
    // Children that begin beyond the period belong to the next one.
    const unsigned begun = mask_of(index < count);
    s.exists = 0;
    for (int row = 0; row < 4; ++row)
      if ((begun >> (4 + row) & 1) != 0) s.exists |= (begun & 0xf) << (4 * row);
    const I8 clamped = by_axis(clamp_x ? 1.0f : 0.0f, clamp_y ? 1.0f : 0.0f) > 0.0f;
    const I8 first = clamped & (index <= 0.0f), last = clamped & (index + width >= count);
    s.enter = (slabs.forward & first) ? splat8(-kFarAway) : ((~slabs.forward & last) ? splat8(kFarAway) : s.enter);
    s.leave = (slabs.forward & last) ? splat8(kFarAway) : ((~slabs.forward & first) ? splat8(-kFarAway) : s.leave);
  }
  return s;
}

/// Half of a node's cells where the chord is over each of them from u_in to u_out: whether it may be near the patch.
///
/// Height of the chord over the bilinear patch at both ends; in between it bends by the twist, and the curve itself is
/// somewhere within the pads.
/// @param half        0: the lower two rows of cells
/// @param q_in, q_out  heights of the chord
RELIEF_KERNEL I8 cells_are_near(const ChordDescent& d,
                                const F8* heights,
                                const F8& corner,
                                int half,
                                F8 u_in,
                                F8 u_out,
                                F8 q_in,
                                F8 q_out)
{
  const Chord& chord = d.chord;
  const int r = 2 * half;
  const F8 h00 = join_low_halves(heights[r], heights[r + 1]);
  const F8 h01 = join_low_halves(heights[r + 1], heights[r + 2]);
  const F8 hx = join_low_halves(shift_down(heights[r]), shift_down(heights[r + 1])) - h00;
  const F8 hy = h01 - h00;
  const F8 hxy = join_low_halves(shift_down(heights[r + 1]), shift_down(heights[r + 2])) - h01 - hx;
  const F8 x_low = F8{0, 1, 2, 3, 0, 1, 2, 3} + splat8(corner[0]);
  const F8 y_low = (half == 0 ? F8{0, 0, 0, 0, 1, 1, 1, 1} : F8{2, 2, 2, 2, 3, 3, 3, 3}) + splat8(corner[4]);
  const F8 dx = splat8(chord.dx), dy = splat8(chord.dy);
  const F8 x_in = fused(u_in, dx, -x_low), x_out = fused(u_out, dx, -x_low);
  const F8 y_in = fused(u_in, dy, -y_low), y_out = fused(u_out, dy, -y_low);
  const F8 g_in = q_in - fused(fused(hxy, x_in, hy), y_in, fused(hx, x_in, h00));
  const F8 g_out = q_out - fused(fused(hxy, x_out, hy), y_out, fused(hx, x_out, h00));
  const F8 bend = fused(splat8(0.25f), abs((x_out - x_in) * (y_out - y_in)), splat8(d.twist_pad));
  const F8 slack = fused(
      abs(hxy), bend, fused(abs(hy), splat8(chord.pad_y), fused(abs(hx), splat8(chord.pad_x), splat8(d.cell_slack))));
  return (min(g_in, g_out) <= slack) & (max(g_in, g_out) >= -slack);
}

/// The children that a chord may meet.
struct ChildrenMet {
  unsigned hits;  ///< a bit each
  alignas(32) float entry[16];
  alignas(32) float exit[16];
};

RELIEF_KERNEL void children_meet(const ChordDescent& d, const Node& n, const NodeChildren& children, ChildrenMet& out)
{
  const Chord& chord = d.chord;
  const ChildSlabs s = child_slabs_make(d, n, children.size);
  const F8 from = max(s.enter * d.slabs.inverse, splat8(n.u0)),
           to = min(s.leave * d.slabs.inverse, splat8(min(n.u1, d.u_limit)));
  const F8 column_from = __builtin_shufflevector(from, from, 0, 1, 2, 3, 0, 1, 2, 3);
  const F8 column_to = __builtin_shufflevector(to, to, 0, 1, 2, 3, 0, 1, 2, 3);
  unsigned hits = 0;
  for (int half = 0; half < 2; ++half) {
    const F8 row_from = half == 0 ? __builtin_shufflevector(from, from, 4, 4, 4, 4, 5, 5, 5, 5)
                                  : __builtin_shufflevector(from, from, 6, 6, 6, 6, 7, 7, 7, 7);
    const F8 row_to = half == 0 ? __builtin_shufflevector(to, to, 4, 4, 4, 4, 5, 5, 5, 5)
                                : __builtin_shufflevector(to, to, 6, 6, 6, 6, 7, 7, 7, 7);
    const F8 u_in = max(column_from, row_from), u_out = min(column_to, row_to);
    const F8 q_in = fused(u_in, splat8(chord.dq), splat8(chord.q0)),
             q_out = fused(u_out, splat8(chord.dq), splat8(chord.q0));
    I8 overlaps = u_in <= u_out + kParameterSlack;
    if (children.level > 0) {
      overlaps &= (min(q_in, q_out) - chord.pad_q <= children.high[half]) &
                  (max(q_in, q_out) + chord.pad_q >= children.low[half]);
    } else {
      overlaps &= cells_are_near(d, children.heights, s.corner, half, u_in, u_out, q_in, q_out);
    }
    hits |= mask_of(overlaps) << (8 * half);
    store8(out.entry + 8 * half, u_in);
    store8(out.exit + 8 * half, u_out);
  }
  out.hits = hits & s.exists;
}

/// Tests the cells of a node that a chord may meet, nearest first.
/// @return true when the search is over
RELIEF_KERNEL bool cells_intersect(ChordSearch& c, ChordDescent& d, const Node& n, const ChildrenMet& met)
{
  int order[16];
  const int count = order_by_entry(met.hits, met.entry, order);
  for (int k = 0; k < count; ++k) {
    const int child = order[k];
    if (met.entry[child] > d.u_limit) break;
    if (cell_on_chord_intersect(c, d.chord, d.period_x + n.column + (child & 3), d.period_y + n.row + (child >> 2),
                                met.entry[child], met.exit[child]))
      return true;
    if (c.found) d.u_limit = chord_limit(c, d.chord);
  }
  return false;
}

/// Descends from one node.
/// @return true when the search is over
RELIEF_KERNEL bool node_intersect(ChordSearch& c, ChordDescent d, const Node& root)
{
  // A node leaves at most 15 siblings on the stack while one is descended into.
  constexpr int kStackSize = 15 * (kMaxPyramidLevels + 1);
  Node stack[kStackSize];
  int depth = 0;
  Node n = root;
  while (true) {
    NodeChildren children;
    node_children_load(d, n, children);
    c.counters.bounds += 1;
    if (traversal_poll(c.counters, c.next_poll)) return true;
    ChildrenMet met;
    children_meet(d, n, children, met);
    const int child_level = children.level, size = children.size;
    if (child_level == 0) {
      if (cells_intersect(c, d, n, met)) return true;
    } else if (met.hits != 0) {
      const Node parent = n;
      const auto node_of = [&](int child) {
        return Node{parent.column + (child & 3) * size, parent.row + (child >> 2) * size, child_level, met.entry[child],
                    met.exit[child]};
      };
      if ((met.hits & (met.hits - 1)) == 0) {
        n = node_of(__builtin_ctz(met.hits));
        continue;
      }
      int order[16];
      const int count = order_by_entry(met.hits, met.entry, order);
      for (int k = count; k-- > 1;) {
        const Node next = node_of(order[k]);
        stack[depth++] = next;
        // Maps do not stay in near caches: with 32 MiB of texels this takes 2 to 5 % less time, with 8 MiB 0 to 1.
        if (child_level > 1) {
          __builtin_prefetch(&children_line(d.field, next.column, next.row, child_level));
        } else {
          prefetch_cells(d.field, d.period_x + next.column, d.period_y + next.row);
        }
      }
      n = node_of(order[0]);
      continue;
    }
    do {
      if (depth == 0) return false;
      n = stack[--depth];
    } while (n.u0 > d.u_limit);
  }
}

/// Where a chord is within [from, to] along one axis.
RELIEF_KERNEL void clip(float from, float to, float start, float inverse, float* u0, float* u1)
{
  const float a = (from - start) * inverse, b = (to - start) * inverse;
  *u0 = max(*u0, min(a, b) - kParameterSlack);
  *u1 = min(*u1, max(a, b) + kParameterSlack);
}

/// Pyramid nodes of one level that a stretch of an axis covers, one after the other, in any direction.
struct NodeWalk {
  std::int64_t first, last;  ///< cells left, lattice coordinates
  int step;                  ///< +1: from first to last; −1: from last to first
};

struct NodeSpan {
  std::int64_t period;  ///< lattice coordinate of pyramid column 0
  int column;           ///< first cell of the node, in pyramid columns
  float from, to;       ///< its extent relative to the chord's origin
};

RELIEF_KERNEL bool next_node(NodeWalk& walk, const LatticeAxis& axis, int size, std::int64_t origin, NodeSpan* out)
{
  if (walk.first > walk.last) return false;
  const std::int64_t at = (walk.step > 0 ? walk.first : walk.last) - axis.first_cell;
  const bool in_first_period = at >= 0 && at < axis.num_cells;  // mostly; divisions are slow
  const std::int64_t cell = in_first_period || axis.wrap == Wrap::kClamp ? at : lattice_modulo(at, axis.num_cells);
  out->period = at - cell + axis.first_cell;
  out->column = static_cast<int>(cell) & ~(size - 1);
  const int end = out->column + size < axis.num_cells ? out->column + size : axis.num_cells;
  const std::int64_t begin_lattice = out->period + out->column, end_lattice = out->period + end;
  const bool clamped = axis.wrap == Wrap::kClamp;
  out->from = clamped && out->column == 0 ? -kFarAway : static_cast<float>(begin_lattice - origin);
  out->to = clamped && end == axis.num_cells ? kFarAway : static_cast<float>(end_lattice - origin);
  if (walk.step > 0) {
    walk.first = end_lattice;
  } else {
    walk.last = begin_lattice - 1;
  }
  return true;
}

/// Cells that [low, high] reaches into.
RELIEF_KERNEL NodeWalk walk_over(const LatticeAxis& axis, std::int64_t origin, float low, float high, bool forward)
{
  NodeWalk walk{origin + static_cast<std::int64_t>(__builtin_floorf(low)),
                origin + static_cast<std::int64_t>(__builtin_floorf(high)), forward ? 1 : -1};
  if (axis.wrap == Wrap::kClamp) {
    const std::int64_t first = axis.first_cell, last = axis.first_cell + axis.num_cells - 1;
    walk.first = walk.first < first ? first : (walk.first > last ? last : walk.first);
    walk.last = walk.last < first ? first : (walk.last > last ? last : walk.last);
  }
  return walk;
}

/// @return true when the search is over
RELIEF_KERNEL bool chord_intersect(ChordSearch& c, const Chord& chord)
{
  const HeightFieldView& f = *c.mesh.field;
  // Nodes as large as the chord or more: it meets four of them at most.
  const float extent =
      max(__builtin_fabsf(chord.dx) + 2.0f * chord.pad_x, __builtin_fabsf(chord.dy) + 2.0f * chord.pad_y);
  int level = 1;
  while (level <= f.num_levels && static_cast<float>(1 << (2 * level)) < extent) ++level;
  const int size = 1 << (2 * level);
  const ChordSlabs slabs = chord_slabs_make(chord);

  const float x1 = chord.x0 + chord.dx;
  NodeWalk columns = walk_over(f.x, chord.origin_x, min(chord.x0, x1) - chord.pad_x, max(chord.x0, x1) + chord.pad_x,
                               chord.dx >= 0.0f);
  NodeSpan column;
  while (next_node(columns, f.x, size, chord.origin_x, &column)) {
    float u0 = 0.0f, u1 = 1.0f;
    clip(column.from - chord.pad_x, column.to + chord.pad_x, chord.x0, chord.inv_dx, &u0, &u1);
    if (!(u0 <= u1)) continue;
    const float ya = chord.y0 + u0 * chord.dy, yb = chord.y0 + u1 * chord.dy;
    NodeWalk rows =
        walk_over(f.y, chord.origin_y, min(ya, yb) - chord.pad_y, max(ya, yb) + chord.pad_y, chord.dy >= 0.0f);
    NodeSpan row;
    while (next_node(rows, f.y, size, chord.origin_y, &row)) {
      float v0 = u0, v1 = u1;
      clip(row.from - chord.pad_y, row.to + chord.pad_y, chord.y0, chord.inv_dy, &v0, &v1);
      if (!(v0 <= v1)) continue;
      if (chord.tau0 + (static_cast<double>(v0) - kParameterSlack) * chord.dtau > c.tau_end) continue;
      if (level <= f.num_levels) {
        const int own = 2 * level;
        const PyramidLine& line = children_line(f, column.column, row.column, level + 1);
        const int child = (column.column >> own & 3) + 4 * (row.column >> own & 3);
        const float qa = chord.q0 + v0 * chord.dq, qb = chord.q0 + v1 * chord.dq;
        c.counters.bounds += 1;
        if (traversal_poll(c.counters, c.next_poll)) return true;
        if (min(qa, qb) - chord.pad_q > line.high[child] || max(qa, qb) + chord.pad_q < line.low[child]) continue;
      }
      const ChordDescent descent = chord_descent_make(c, chord, slabs, column.period, row.period);
      if (node_intersect(c, descent, {column.column, row.column, level, v0, v1})) return true;
    }
  }
  return false;
}

/// Whether the heights of bands along one axis reach into an interval.
/// @param low, high  stretch of the other axis, from `origin`
/// @return  true also if it is too wide to be worth looking at, and for NaN
RELIEF_KERNEL bool band_meets(const LatticeAxis& axis,
                              const StoredRange* bands,
                              int log2_band,
                              std::int64_t origin,
                              float low,
                              float high,
                              float q_low,
                              float q_high)
{
  constexpr int kMostBands = 8;
  if (!(high - low < static_cast<float>(kMostBands << log2_band))) return true;
  NodeWalk walk = walk_over(axis, origin, low, high, true);
  NodeSpan span;
  while (next_node(walk, axis, 1 << log2_band, origin, &span)) {
    const StoredRange& range = bands[span.column >> log2_band];
    if (!(q_low > range.high || q_high < range.low)) return true;
  }
  return false;
}

/// Eight values of a quadratic.
RELIEF_KERNEL F8 quadratic_lanes(const Quadratic& p, F8 u)
{
  return fused(fused(splat8(static_cast<float>(p.a)), u, splat8(static_cast<float>(p.b))), u,
               splat8(static_cast<float>(p.c)));
}

/// A piece of the curve as eight straight stretches in single precision: the whole, its halves, its quarters, and the whole
/// once more. Each is known with what the curve may deviate from it and what rounding may do.
struct ChordLanes {
  double origin_x, origin_y;  ///< integer lattice point near the piece's start
  float extent_x, extent_y;   ///< of the triangle, about, lattice units
  F8 u0, u1;                  ///< parameters within the piece
  F8 x0, x1, y0, y1, q0, q1;  ///< ends: lattice units from the origin, and stored heights
  F8 bend_x, bend_y;          ///< what a split can make less
  F8 pad_x, pad_y, pad_q;
};

/// A piece of the curve over which u goes from 0 to 1, as quotients by W; what is displaced from where.
struct CurvePiece {
  const Quadratic &W, &e1, &e2, &X, &Y;
  Vec3f N0, Nu, Nv;  ///< the normal at vertex 0, and from there to those of vertices 1 and 2
  float s0, ds;
};

/// Eight points of it.
struct PointLanes {
  F8 W, b1, b2, x, y, nu, height;
  F8 N[3];
};

RELIEF_KERNEL F8 length_squared_lanes(const F8* v) { return fused(v[2], v[2], fused(v[1], v[1], v[0] * v[0])); }

[[gnu::always_inline]] RELIEF_KERNEL PointLanes point_lanes(const CurvePiece& c, F8 u)
{
  PointLanes p;
  p.W = quadratic_lanes(c.W, u);
  const F8 inverse_W = 1.0f / p.W;
  p.b1 = quadratic_lanes(c.e1, u) * inverse_W;
  p.b2 = quadratic_lanes(c.e2, u) * inverse_W;
  p.x = quadratic_lanes(c.X, u) * inverse_W;
  p.y = quadratic_lanes(c.Y, u) * inverse_W;
  p.N[0] = fused(p.b2, splat8(c.Nv.x), fused(p.b1, splat8(c.Nu.x), splat8(c.N0.x)));
  p.N[1] = fused(p.b2, splat8(c.Nv.y), fused(p.b1, splat8(c.Nu.y), splat8(c.N0.y)));
  p.N[2] = fused(p.b2, splat8(c.Nv.z), fused(p.b1, splat8(c.Nu.z), splat8(c.N0.z)));
  p.nu = sqrt(length_squared_lanes(p.N));
  p.height = (c.s0 + u * c.ds) * p.nu;
  return p;
}

/// @param tau0, step   the piece of the segment
/// @param W, e1, e2    over the piece, divided by W at its start
/// @param inverse      1 / that
[[gnu::always_inline]] RELIEF_KERNEL ChordLanes chord_lanes_make(const ChordSearch& c,
                                                                 double tau0,
                                                                 double step,
                                                                 const Quadratic& W,
                                                                 Quadratic e1,
                                                                 Quadratic e2,
                                                                 double inverse)
{
  const DisplacedTriangle& tri = c.tri;
  const CurveSegment& g = *c.segment;
  e1 = e1 * inverse;
  e2 = e2 * inverse;
  const double xu = c.x[1] - c.x[0], xv = c.x[2] - c.x[0], yu = c.y[1] - c.y[0], yv = c.y[2] - c.y[0];
  ChordLanes out;
  const double origin_x = __builtin_floor(c.x[0] + e1.c * xu + e2.c * xv);
  const double origin_y = __builtin_floor(c.y[0] + e1.c * yu + e2.c * yv);
  const Quadratic X = W * (c.x[0] - origin_x) + e1 * xu + e2 * xv;
  const Quadratic Y = W * (c.y[0] - origin_y) + e1 * yu + e2 * yv;

  // Equal steps of τ crowd where the facet is seen edge-on; equal steps of the parameter whose weights are the same at
  // both ends do not.
  const float bend = static_cast<float>(__builtin_sqrt(1.0 / (W.a + W.b + W.c)));
  const auto spread = [&](F8 k) { return bend * k / (bend * k + (1.0f - k)); };
  // Lanes: the whole, two halves, four quarters, and the whole once more.
  out.u0 = spread(F8{0, 0, 0.5f, 0, 0.25f, 0.5f, 0.75f, 0});
  out.u1 = spread(F8{1, 0.5f, 1, 0.25f, 0.5f, 0.75f, 1, 1});
  out.u1[0] = out.u1[2] = out.u1[6] = out.u1[7] = 1.0f;
  const F8 u0 = out.u0, u1 = out.u1;

  const Vec3f Nu = tri.N[1] - tri.N[0], Nv = tri.N[2] - tri.N[0];
  const float s0 = static_cast<float>(g.s0 + tau0 * g.ds), ds = static_cast<float>(step * g.ds);
  const CurvePiece piece{W, e1, e2, X, Y, tri.N[0], Nu, Nv, s0, ds};
  const PointLanes a = point_lanes(piece, u0), b = point_lanes(piece, u1);

  // As in curve_deviation.
  const F8 width = u1 - u0;
  const F8 Wa = static_cast<float>(W.a) * width * width;
  const F8 Wb = (static_cast<float>(W.b) + 2.0f * static_cast<float>(W.a) * u0) * width;
  const F8 Wc = a.W;
  // The vertex of a W that opens upward may lie in between; its value is at least this.
  const F8 W_least = max(min(a.W, b.W) - 0.25f * abs(Wa), splat8(static_cast<float>(g.W_min * inverse * 0.999)));
  const F8 quarter_over_W = 0.25f * (1.0f + kFloatSlack) / W_least;
  const auto deviation = [&](const Quadratic& p, F8 from, F8 to) {
    const F8 slope = to - from;
    const F8 alpha = (static_cast<float>(p.b) + 2.0f * static_cast<float>(p.a) * u0) * width - from * Wb - slope * Wc;
    const F8 beta = slope * Wa;
    return quarter_over_W * max(abs(alpha), abs(alpha + beta));
  };
  const F8 deviation_x = deviation(X, a.x, b.x), deviation_y = deviation(Y, a.y, b.y);
  const F8 deviation_N = deviation(e1, a.b1, b.b1) * length(Nu) + deviation(e2, a.b2, b.b2) * length(Nv);
  const F8 dN[3] = {b.N[0] - a.N[0], b.N[1] - a.N[1], b.N[2] - a.N[2]};
  const F8 turn_squared = length_squared_lanes(dN);
  const F8 least_nu = 0.5f * (a.nu + b.nu - sqrt(turn_squared)) - deviation_N;
  const F8 s_largest = max(abs(s0 + u0 * ds), abs(s0 + u1 * ds));
  F8 deviation_height =
      s_largest * (turn_squared / (8.0f * least_nu) + deviation_N) + 0.25f * abs(width * ds * (b.nu - a.nu));
  deviation_height = least_nu > 0.0f ? deviation_height : splat8(kInfinity);

  // Rounding of the floats above, by the size of what went in.
  const float extent_x = static_cast<float>(__builtin_fabs(xu) + __builtin_fabs(xv)),
              extent_y = static_cast<float>(__builtin_fabs(yu) + __builtin_fabs(yv));
  const F8 worst_W = splat8(1.0f) / W_least;
  const float X_size = static_cast<float>(__builtin_fabs(X.a) + __builtin_fabs(X.b) + __builtin_fabs(X.c));
  const float Y_size = static_cast<float>(__builtin_fabs(Y.a) + __builtin_fabs(Y.b) + __builtin_fabs(Y.c));
  const float W_size = static_cast<float>(__builtin_fabs(W.a) + __builtin_fabs(W.b) + 1.0);
  const F8 slack_x = kFloatSlack * worst_W * (X_size + W_size * max(abs(a.x), abs(b.x)));
  const F8 slack_y = kFloatSlack * worst_W * (Y_size + W_size * max(abs(a.y), abs(b.y)));
  const float e_size = static_cast<float>(__builtin_fabs(e1.a) + __builtin_fabs(e1.b) + __builtin_fabs(e1.c) +
                                          __builtin_fabs(e2.a) + __builtin_fabs(e2.b) + __builtin_fabs(e2.c));
  const F8 slack_b = kFloatSlack * worst_W * (e_size + 2.0f * W_size);
  const float q_per_metre = static_cast<float>(c.q_per_metre), q_zero = static_cast<float>(c.q_zero);
  const F8 bend_x = deviation_x + slack_x, bend_y = deviation_y + slack_y;
  // No split makes the curve better known than it is.
  const F8 pad_x = bend_x + static_cast<float>(g.relative_error) * extent_x,
           pad_y = bend_y + static_cast<float>(g.relative_error) * extent_y;
  const F8 q_a = q_zero + q_per_metre * a.height, q_b = q_zero + q_per_metre * b.height;
  const float q_slope = __builtin_fabsf(q_per_metre);
  const F8 pad_q = q_slope * (deviation_height + s_largest * (slack_b * (length(Nu) + length(Nv)) + kFloatSlack)) +
                   kFloatSlack * (__builtin_fabsf(q_zero) + max(abs(q_a), abs(q_b)) + 1.0f);
  out.origin_x = origin_x;
  out.origin_y = origin_y;
  out.extent_x = extent_x;
  out.extent_y = extent_y;
  out.x0 = a.x;
  out.x1 = b.x;
  out.y0 = a.y;
  out.y1 = b.y;
  out.q0 = q_a;
  out.q1 = q_b;
  out.bend_x = bend_x;
  out.bend_y = bend_y;
  out.pad_x = pad_x;
  out.pad_y = pad_y;
  out.pad_q = pad_q;
  return out;
}

/// The curve between two parameters as one, two or four chords; those that may deviate too far are split again.
/// @return true when the search is over
RELIEF_KERNEL bool chords_intersect(ChordSearch& c, double tau0, double tau1, int splits)
{
  const CurveSegment& g = *c.segment;
  const HeightFieldView& f = *c.mesh.field;
  const double step = tau1 - tau0;
  Quadratic W = quadratic_shift(g.W, tau0, step);
  Quadratic e1 = quadratic_shift(g.e[1], tau0, step), e2 = quadratic_shift(g.e[2], tau0, step);
  const double inverse = 1.0 / W.c;
  W = W * inverse;
  const double end_W = W.a + W.b + W.c, least_W = quadratic_minimum(W);
  if (least_W < kLeastFloatW * max(1.0, end_W) && splits < kMaxSplits) {
    // At its minimum, or else where W is the geometric mean of its ends.
    double cut = -W.b / (2.0 * W.a);
    if (!(least_W < kLeastFloatW * min(1.0, end_W))) {
      double roots[2] = {0.5, 0.5};
      quadratic_roots_inside({W.a, W.b, W.c - __builtin_sqrt(end_W)}, 0.0, 1.0, roots, 0);
      cut = roots[0];
    }
    const double middle = tau0 + cut * step;
    if (chords_intersect(c, tau0, middle, splits + 1)) return true;
    return middle <= c.tau_end && chords_intersect(c, middle, tau1, splits + 1);
  }
  const ChordLanes n = chord_lanes_make(c, tau0, step, W, e1, e2, inverse);
  // What is not a number is not known to miss.
  unsigned alive = ~mask_of((min(n.q0, n.q1) - n.pad_q > splat8(static_cast<float>(f.range.high) + c.q_pad)) |
                            (max(n.q0, n.q1) + n.pad_q < splat8(static_cast<float>(f.range.low) - c.q_pad)));
  const float wanted_q = kWantedHeightDeviation * static_cast<float>(f.range.high - f.range.low) + 1.0f;
  const unsigned straight = mask_of((n.bend_x <= splat8(kWantedDeviation)) & (n.bend_y <= splat8(kWantedDeviation)) &
                                    (n.pad_q <= splat8(wanted_q)));
  c.counters.bounds += 1;
  if (traversal_poll(c.counters, c.next_poll)) return true;
  // As few chords as are straight enough; a chord that misses the map's range need not be.
  constexpr unsigned kWhole = 0x01, kHalves = 0x06, kQuarters = 0x78;
  const unsigned good = straight | ~alive;
  alive &= (good & kWhole) == kWhole ? kWhole : ((good & kHalves) == kHalves ? kHalves : kQuarters);
  for (; alive != 0; alive &= alive - 1) {
    const int k = __builtin_ctz(alive);
    const double from = tau0 + static_cast<double>(n.u0[k]) * step, to = tau0 + static_cast<double>(n.u1[k]) * step;
    if (from > c.tau_end) return false;
    const bool long_x = __builtin_fabsf(n.x1[k] - n.x0[k]) > c.long_x,
               long_y = __builtin_fabsf(n.y1[k] - n.y0[k]) > c.long_y;
    if (long_x || long_y) {
      const auto meets = [&](const LatticeAxis& axis, const StoredRange* bands, double origin, const F8& from_lanes,
                             const F8& to_lanes, float pad) {
        return band_meets(axis, bands, f.log2_band, static_cast<std::int64_t>(origin),
                          min(from_lanes[k], to_lanes[k]) - pad, max(from_lanes[k], to_lanes[k]) + pad,
                          min(n.q0[k], n.q1[k]) - n.pad_q[k] - c.q_pad, max(n.q0[k], n.q1[k]) + n.pad_q[k] + c.q_pad);
      };
      if (long_x && !meets(f.y, f.row_bands, n.origin_y, n.y0, n.y1, n.pad_y[k])) continue;
      if (long_y && !meets(f.x, f.column_bands, n.origin_x, n.x0, n.x1, n.pad_x[k])) continue;
    }
    if (((straight >> k & 1) == 0 && splits < kMaxSplits) || ((long_x || long_y) && splits < c.max_long_splits)) {
      if (chords_intersect(c, from, to, splits + 1)) return true;
      continue;
    }
    Chord chord;
    chord.origin_x = static_cast<std::int64_t>(n.origin_x);
    chord.origin_y = static_cast<std::int64_t>(n.origin_y);
    chord.x0 = n.x0[k];
    chord.y0 = n.y0[k];
    chord.q0 = n.q0[k];
    chord.dx = n.x1[k] - n.x0[k];
    chord.dy = n.y1[k] - n.y0[k];
    chord.dq = n.q1[k] - n.q0[k];
    chord.inv_dx = 1.0f / (__builtin_fabsf(chord.dx) > 1e-15f ? chord.dx : 1e-15f);
    chord.inv_dy = 1.0f / (__builtin_fabsf(chord.dy) > 1e-15f ? chord.dy : 1e-15f);
    // No point of the curve is outside of the triangle, whatever the bounds say. A short chord near a lattice point is
    // known better than its distance from the borders of nodes, which reach up to five times as far as the chord does along
    // either axis.
    chord.pad_x = min(n.pad_x[k], n.extent_x + 1.0f);
    chord.pad_y = min(n.pad_y[k], n.extent_y + 1.0f);
    const float reach =
        max(__builtin_fabsf(chord.dx) + 2.0f * chord.pad_x, __builtin_fabsf(chord.dy) + 2.0f * chord.pad_y);
    chord.pad_x += kFloatSlack * (4.0f + 5.0f * reach);
    chord.pad_y += kFloatSlack * (4.0f + 5.0f * reach);
    chord.pad_q = n.pad_q[k] + c.q_pad;
    chord.tau0 = from;
    chord.dtau = to - from;
    if (chord_intersect(c, chord)) return true;
  }
  return false;
}

/// Where a segment passes from over a clamped map to beside it. What is beside the map in one axis varies along the other
/// only, so that one place stands for all of it: chords of any length then fit into floats.
struct ClampCuts {
  double cuts[9];  ///< τ, ascending; the last one is the segment's end
  int count = 0;
};

/// How far from the map's last texels the cuts of an axis are: more than rounding may take a point of the curve.
RELIEF_KERNEL double clamp_margin(const CurveSegment& g, const double* x)
{
  return 1.0 + (g.relative_error + 0x1p-40) * (__builtin_fabs(x[1] - x[0]) + __builtin_fabs(x[2] - x[0]));
}

RELIEF_KERNEL bool reaches_beside(const LatticeAxis& axis, const double* x)
{
  return axis.wrap == Wrap::kClamp && (min(x[0], min(x[1], x[2])) < -kLittleBeside ||
                                       max(x[0], max(x[1], x[2])) > axis.num_texels - 1 + kLittleBeside);
}

RELIEF_KERNEL void add_clamp_cuts(const LatticeAxis& axis,
                                  const double* x,
                                  const CurveSegment& g,
                                  const CurveRange& range,
                                  ClampCuts* out)
{
  if (!reaches_beside(axis, x)) return;
  const double margin = clamp_margin(g, x);
  for (const double at : {-margin, axis.num_texels - 1 + margin}) {
    const Quadratic p = g.W * (x[0] - at) + g.e[1] * (x[1] - x[0]) + g.e[2] * (x[2] - x[0]);
    out->count = quadratic_roots_inside(p, range.tau0, range.tau1, out->cuts, out->count);
  }
}

/// Lattice coordinates of the vertices, or those of the place that stands for a piece beside the map.
/// @param beside  room for the latter
RELIEF_KERNEL const double* seen_coordinates(const LatticeAxis& axis,
                                             const double* x,
                                             const CurveSegment& g,
                                             double tau,
                                             double* beside)
{
  if (!reaches_beside(axis, x)) return x;
  const double at = (x[0] * quadratic_at(g.W, tau) + (x[1] - x[0]) * quadratic_at(g.e[1], tau) +
                     (x[2] - x[0]) * quadratic_at(g.e[2], tau)) /
                    quadratic_at(g.W, tau);
  const double margin = clamp_margin(g, x), last = axis.num_texels - 1;
  if (at > -margin && at < last + margin) return x;
  beside[0] = beside[1] = beside[2] = at < 0.0 ? -0.5 : last + 0.5;
  return beside;
}

/// The part of a segment within a range.
/// @return true when the search is over
RELIEF_KERNEL bool segment_intersect(ChordSearch& c, const CurveSegment& g, const CurveRange& range)
{
  const HeightFieldView& f = *c.mesh.field;
  ClampCuts pieces;
  add_clamp_cuts(f.x, c.tri.x, g, range, &pieces);
  add_clamp_cuts(f.y, c.tri.y, g, range, &pieces);
  pieces.cuts[pieces.count++] = range.tau1;
  curve_detail::sort_ascending(pieces.cuts, pieces.count);
  double from = range.tau0;
  for (int k = 0; k < pieces.count; ++k) {
    const double to = pieces.cuts[k], middle = 0.5 * (from + to);
    double beside_x[3], beside_y[3];
    c.x = seen_coordinates(f.x, c.tri.x, g, middle, beside_x);
    c.y = seen_coordinates(f.y, c.tri.y, g, middle, beside_y);
    if (from > c.tau_end) return false;
    if (chords_intersect(c, from, to, 0)) return true;
    from = to;
  }
  return false;
}

/// Splits after which no chord along an axis is long any more; each quarters one, unless the curve bends.
/// @param wanted  length of a chord that is not long
RELIEF_KERNEL int splits_of_long(const double* x, float wanted)
{
  int splits = 0;
  double length = __builtin_fabs(x[1] - x[0]) + __builtin_fabs(x[2] - x[0]);
  if (length <= static_cast<double>(wanted)) return splits;
  for (; length > static_cast<double>(wanted); length *= 0.25) ++splits;
  return splits + kMaxSplits;
}

bool traverse(const PrismQuery& q, const void*, DisplacedHit* hit)
{
  const DisplacedMeshView& mesh = q.mesh;
  const HeightFieldView& f = *mesh.field;
  const RayCurve& curve = q.curve;
  ChordSearch c{prism_search_make(q, hit)};
  c.long_x = min(kFloatUnits, kPeriodsAChord * static_cast<float>(f.x.num_cells));
  c.long_y = min(kFloatUnits, kPeriodsAChord * static_cast<float>(f.y.num_cells));
  const int splits_x = splits_of_long(c.tri.x, c.long_x), splits_y = splits_of_long(c.tri.y, c.long_y);
  c.max_long_splits = splits_x > splits_y ? splits_x : splits_y;
  // d = scale·(h_offset + h_step·q − midlevel). A scale of zero says nothing about q: then all of the map is met.
  const double metres_per_step = mesh.scale * f.h_step;
  const bool flat = !(__builtin_fabs(metres_per_step) > kLeastHeightStep);
  c.q_per_metre = flat ? 0.0 : 1.0 / metres_per_step;
  c.q_zero = flat ? 0.0 : (mesh.midlevel - f.h_offset) / f.h_step;
  c.q_pad = flat ? 65536.0f : 0.0f;
  for (int k = 0; k < curve.num_segments; ++k) {
    const CurveSegment& g = curve.segments[k];
    if (g.t0 >= c.t_max && c.unfolded) break;
    c.segment = &g;
    c.tau_end = 1.0;
    const CurveRange range = curve_clip(curve, g, c.unfolded, c.t_min, c.t_max);
    if (range.tau0 > range.tau1) continue;
    if (c.unfolded) c.tau_end = range.tau1;
    if (segment_intersect(c, g, range)) break;
  }
  return c.found;
}

}  // namespace

const DisplacementMethodEntry RELIEF_ISA::chord_method{
    .title = "Chord",
    .description = "The fast method: exact, with little memory",
    .traverse = traverse,
    .cost = MethodCost{930, 0, 0},
};

}  // namespace relief
