// Stage: paths that have entered an object walk about in it until they leave.
#pragma once

#include "integrator/intersect_stage.h"
#include "integrator/stages.h"

namespace relief {

/// Lets every path in the queue walk from where its ray starts, inside the object that it has hit last, through what its
/// SubsurfaceState says, or leave it as far away as a profile has it. Those that get out have hit the object from the outside then,
/// against the way that they came.
/// @param left          gets these; the others end
/// @param displacement  what these rays did is added to it
void walk_below_surfaces(const KernelGlobals& g,
                         const Accel& accel,
                         const WalkStages& stages,
                         PathState& state,
                         const QueueView& queue,
                         QueueView& left,
                         DisplacementWork& displacement);

}  // namespace relief
