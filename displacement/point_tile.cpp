#include "displacement/point_tile.h"

#include <algorithm>
#include <cmath>

namespace relief {

namespace {

struct Range {
  float low = kInfinity, high = -kInfinity;
};

Range both(Range a, Range b) { return {std::min(a.low, b.low), std::max(a.high, b.high)}; }

/// A box's ends in steps of a tile's box.
void quantize(float tile_low, float step, Range range, std::uint8_t* low, std::uint8_t* high)
{
  if (!(range.low <= range.high)) {
    *low = 255;
    *high = 0;
    return;
  }
  // In double these products and sums are exact enough.
  const auto at = [&](int q) { return static_cast<double>(tile_low) + static_cast<double>(step) * q; };
  const auto steps = [&](float x) {
    if (!(step > 0)) return 0;
    return static_cast<int>(
        std::clamp((static_cast<double>(x) - static_cast<double>(tile_low)) / static_cast<double>(step), 0.0, 255.0));
  };
  int from = steps(range.low), to = steps(range.high);
  while (from > 0 && at(from) > static_cast<double>(range.low)) --from;
  while (to < 255 && at(to) < static_cast<double>(range.high)) ++to;
  *low = static_cast<std::uint8_t>(from);
  *high = static_cast<std::uint8_t>(to);
}

}  // namespace

void point_tile_finish(PointTile* tile, int num_rows)
{
  constexpr int kLeaves = PointTile::kCells / PointTile::kLeafCells, kRow = PointTile::kRow;
  constexpr int kNodes = PointTile::kCells / PointTile::kNodeCells,
                kInNode = PointTile::kNodeCells / PointTile::kLeafCells;
  for (int axis = 0; axis < 3; ++axis) {
    float* const P = tile->P[axis];
    std::fill_n(P + PointTile::kPoints, 3, P[PointTile::kPoints - 1]);
    Range leaves[kLeaves][kLeaves], nodes[kNodes][kNodes], whole;
    for (int y = 0; y < kLeaves; ++y) {
      for (int x = 0; x < kLeaves && PointTile::kLeafCells * (x + y) < num_rows; ++x) {
        Range leaf;
        for (int r = 0; r <= PointTile::kLeafCells; ++r) {
          for (int c = 0; c <= PointTile::kLeafCells; ++c) {
            const float p = P[(PointTile::kLeafCells * y + r) * kRow + PointTile::kLeafCells * x + c];
            leaf = both(leaf, {p, p});
          }
        }
        leaves[y][x] = leaf;
        nodes[y / kInNode][x / kInNode] = both(nodes[y / kInNode][x / kInNode], leaf);
        whole = both(whole, leaf);
      }
    }
    tile->low[axis] = whole.low;
    float step = (whole.high - whole.low) / 255.0f;
    while (static_cast<double>(whole.low) + static_cast<double>(step) * 255 < static_cast<double>(whole.high))
      step = std::nextafter(step, kInfinity);
    tile->step[axis] = step;
    for (int node = 0; node < kNodes * kNodes; ++node) {
      const int x = node % kNodes, y = node / kNodes;
      quantize(whole.low, step, nodes[y][x], &tile->nodes.low[axis][node], &tile->nodes.high[axis][node]);
      for (int k = 0; k < 8; ++k) {
        const Range leaf =
            k < kInNode * kInNode ? leaves[kInNode * y + k / kInNode][kInNode * x + k % kInNode] : Range{};
        quantize(whole.low, step, leaf, &tile->leaves[node].low[axis][k], &tile->leaves[node].high[axis][k]);
      }
    }
  }
}

}  // namespace relief
