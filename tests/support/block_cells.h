// The micro-triangles of a diced mesh, in blocks or as quadrilaterals, as Embree has them.
#pragma once

#include "displacement/tessellation_lattice.h"

namespace relief::test {

/// A cell of a block.
struct BlockCell {
  std::uint32_t primitive;
  float u, v, side;  ///< of its first vertex, as Embree reports them, and how far they go along its sides
  std::uint64_t lower[3], upper[3];  ///< vertices of its micro-triangles
  bool has_upper;                    ///< it is not at the third side
};

/// Calls for every cell that has a micro-triangle.
template <typename Visit>
void for_each_cell(const Tessellation& tessellation, const Visit& visit)
{
  for (const TessellatedTriangle& t : tessellation.layout().triangles) {
    if (tessellation.layout().kind == TessellationKind::kQuads) {
      const LatticeRows rows{t.segments};
      std::uint32_t primitive = t.first_primitive;
      for (std::uint32_t j = 0; j < t.segments; ++j) {
        for (std::uint32_t i = 0; i + j < t.segments; ++i, ++primitive) {
          const std::uint64_t a = t.first_vertex + rows.vertex(i, j), b = t.first_vertex + rows.vertex(i, j + 1);
          visit(BlockCell{primitive, 0, 0, 1, {a, a + 1, b}, {a + 1, b + 1, b}, i + j + 1 < t.segments});
        }
      }
      continue;
    }
    const LatticeBlocks blocks(t.segments);
    for (std::uint32_t k = 0; k < blocks.num_blocks(); ++k) {
      const LatticeBlocks::Block block = blocks.block(k);
      const float side = 1.0f / static_cast<float>(block.cells);
      for (std::uint32_t y = 0; y < block.cells; ++y) {
        for (std::uint32_t x = 0; x < block.cells; ++x) {
          const std::uint32_t sum = block.i + x + block.j + y;
          if (sum >= t.segments) break;
          const std::uint64_t a = std::uint64_t{t.first_vertex} + block.first_vertex + y * (block.cells + 1) + x;
          const std::uint64_t b = a + block.cells + 1;
          visit(BlockCell{t.first_primitive + k,
                          static_cast<float>(x) * side,
                          static_cast<float>(y) * side,
                          side,
                          {a, a + 1, b},
                          {a + 1, b + 1, b},
                          sum + 1 < t.segments});
        }
      }
    }
  }
}

}  // namespace relief::test
