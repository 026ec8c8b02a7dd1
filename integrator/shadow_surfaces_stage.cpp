// Compiled once an instruction set, as stages.cpp is; RELIEF_SHADOW_SURFACES names the function.
#include "integrator/stages.h"
#include "kernel/stage/shadow_surfaces.h"

namespace relief {

void RELIEF_SHADOW_SURFACES(const KernelGlobals& g, const ShadowSurfaces& surfaces, Vec3f passes[8])
{
  shadow_surfaces_pass(g, surfaces, passes);
}

}  // namespace relief
