// Compiled once an instruction set, as stages.cpp is; RELIEF_WALK_STAGES names the table.
#include "integrator/stages.h"
#include "kernel/stage/subsurface_walk.h"

namespace relief {

const WalkStages RELIEF_WALK_STAGES = {subsurface_walk_begin, subsurface_walks_choose, subsurface_walks_go};

}  // namespace relief
