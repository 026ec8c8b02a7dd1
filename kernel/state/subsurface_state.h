// What paths keep while they are below a surface.
#pragma once

#include "kernel/bsdf/closure_kinds.h"
#include "kernel/bsdf/subsurface_params.h"

namespace relief {

struct SubsurfaceState {
  Subsurface surface;  ///< as it is where they have entered
  Vec3f N;             ///< shading normal there, world, outwards
  Maths maths;         ///< of the closure
  bool front;          ///< they have entered on the triangle's front side
};

}  // namespace relief
