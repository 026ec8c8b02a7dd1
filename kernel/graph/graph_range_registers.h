// What a run of a value graph over ranges reads and leaves.
#pragma once

#include "kernel/graph/graph_program.h"
#include "kernel/graph/graph_range.h"
#include "kernel/graph/image_bounds.h"
#include "kernel/texture/texture_view.h"

namespace relief {

/// Registers of one run; its inputs are written before, its outputs read after.
struct GraphRangeRegisters {
  GraphRange lanes[kMostGraphRegisters];
  const ImageBounds* images;  ///< of the textures, one by one; null: there are none
};

/// Runs a program over eight parallelograms.
/// @param registers  the program's inputs are filled
using GraphBoundsRun = void (*)(const GraphProgramView& program,
                                const TextureView* textures,
                                GraphRangeRegisters& registers);

RELIEF_KERNEL GraphRange graph_range_operand(const GraphProgramView& program,
                                             const GraphRangeRegisters& registers,
                                             std::uint16_t operand)
{
  return operand < kMostGraphRegisters ? registers.lanes[operand]
                                       : range_point(splat8(program.constants[operand - kMostGraphRegisters]));
}

}  // namespace relief
