// The interpreter of value graphs over ranges, compiled once an instruction set.
#pragma once

#include "kernel/graph/graph_range_registers.h"

namespace relief {

void graph_bounds_baseline(const GraphProgramView& program,
                           const TextureView* textures,
                           GraphRangeRegisters& registers);
void graph_bounds_avx2(const GraphProgramView& program, const TextureView* textures, GraphRangeRegisters& registers);

/// The one that goes with stage_table_select.
GraphBoundsRun graph_bounds_select();

}  // namespace relief
