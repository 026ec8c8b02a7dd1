// Rays that value graphs ask for while surfaces are shaded.
#pragma once

#include "kernel/graph/graph_registers.h"

namespace relief {

struct SceneContext;

/// Where a share of what rounds an edge comes from: by (1 − r)³ over a disk of radius 1.
/// @param u  in [0, 1]: the share that is further away, (1 − r)⁴ (1 + 4 r)
/// @return   distance from the middle, r, within 2e-6
float bevel_distance(float u);

/// @param context  of the scene, with its tree; must outlive what asks
GraphRays graph_rays_make(const SceneContext& context);

}  // namespace relief
