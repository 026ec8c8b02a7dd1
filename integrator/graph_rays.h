// Rays that value graphs ask for while surfaces are shaded.
#pragma once

#include "kernel/graph/graph_registers.h"

namespace relief {

struct SceneContext;

/// @param context  of the scene, with its tree; must outlive what asks
GraphRays graph_rays_make(const SceneContext& context);

}  // namespace relief
