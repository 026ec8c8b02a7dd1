// The stage of media, compiled once an instruction set like stages.cpp, with RELIEF_SHADE_MEDIA naming its one function. Apart from
// the others, for scenes without media never come here.
#include "integrator/stages.h"
#include "kernel/stage/shade_medium.h"

namespace relief {

void RELIEF_SHADE_MEDIA(
    const KernelGlobals& g, PathState& state, HitQueues& queues, QueueView& next, ShadowQueue& shadow)
{
  const auto keep = [&](QueueView& queue, MediumHit hit) {
    std::uint32_t kept = 0;
    for (std::uint32_t i = 0; i < queue.size; ++i) {
      const std::uint32_t path = queue.paths[i];
      if (shade_medium(g, state, path, hit, next, shadow)) queue.paths[kept++] = path;
    }
    queue.size = kept;
  };
  for (QueueView& queue : queues.surfaces) keep(queue, MediumHit::kSurface);
  keep(queues.lights, MediumHit::kLight);
  keep(queues.background, MediumHit::kNothing);
}

}  // namespace relief
