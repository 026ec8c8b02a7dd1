// Compiled once an instruction set, RELIEF_GRAPH_BOUNDS naming its one function.
#include "integrator/graph_bounds_stage.h"

#include "integrator/graph_stop.h"
#include "kernel/graph/graph_bounds.h"

namespace relief {

void RELIEF_GRAPH_BOUNDS(const GraphProgramView& program, const TextureView* textures, GraphRangeRegisters& registers)
{
  graph_bounds_run(program, textures, registers, graph_stop);
}

}  // namespace relief
