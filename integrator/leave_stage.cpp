// Compiled once an instruction set, as stages.cpp is; RELIEF_LEAVE_SURFACES names the function.
#include "integrator/stages.h"
#include "integrator/surface_kernels.h"
#include "kernel/stage/leave_surface.h"

namespace relief {

namespace {

template <unsigned kFeatures>
void leave_all(const KernelGlobals& g,
               PathState& state,
               const QueueView& queue,
               QueueView& next,
               ShadowQueue& shadow,
               Counters& counters)
{
  for (std::uint32_t i = 0; i < queue.size; ++i) {
    leave_surface<kFeatures>(g, state, queue.paths[i], next, shadow, counters);
  }
}

}  // namespace

void RELIEF_LEAVE_SURFACES(const KernelGlobals& g,
                           PathState& state,
                           const QueueView& queue,
                           QueueView& next,
                           ShadowQueue& shadow,
                           Counters& counters)
{
  (g.caustics.enabled ? leave_all<kFeatureCaustics | kMixtureFeatures> : leave_all<kMixtureFeatures>)(
      g, state, queue, next, shadow, counters);
}

}  // namespace relief
