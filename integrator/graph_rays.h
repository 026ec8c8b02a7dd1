// Rays that value graphs ask for while surfaces are shaded.
#pragma once

#include "integrator/accel.h"
#include "kernel/graph/graph_registers.h"

namespace relief {

/// @param accel  of the scene; must outlive what asks
GraphRays graph_rays_make(const Accel& accel);

}  // namespace relief
