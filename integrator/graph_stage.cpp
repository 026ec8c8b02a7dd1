// The interpreter of value graphs, compiled once an instruction set like stages.cpp, with RELIEF_GRAPH_RUN naming its one
// function. Apart from the stages, for opcodes are many and change often.
#include "integrator/graph_stop.h"
#include "integrator/stages.h"
#include "kernel/graph/graph_eval.h"

namespace relief {

void RELIEF_GRAPH_RUN(const GraphProgramView& program, const TextureView* textures, GraphRegisters& registers)
{
  graph_run(program, textures, registers, graph_stop);
}

}  // namespace relief
