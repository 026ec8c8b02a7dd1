// The stages of media, compiled once an instruction set like stages.cpp, with RELIEF_SHADE_MEDIA, RELIEF_SHADE_PHOTON_MEDIA and
// RELIEF_SHADOW_TRANSMITTANCE naming its functions. Apart from the others, for scenes without media never come here.
#include "integrator/stages.h"
#include "kernel/stage/shade_medium.h"

namespace relief {

namespace {

/// Keeps of each queue the paths whose hit is to be shaded.
/// @param shades  whether that of a path is; told of what kind it is
template <typename Shades>
void keep_those_that_arrive(HitQueues& queues, const Shades& shades)
{
  const auto keep = [&](QueueView& queue, MediumHit hit) {
    std::uint32_t kept = 0;
    for (std::uint32_t i = 0; i < queue.size; ++i) {
      const std::uint32_t path = queue.paths[i];
      if (shades(path, hit)) queue.paths[kept++] = path;
    }
    queue.size = kept;
  };
  for (QueueView& queue : queues.surfaces) keep(queue, MediumHit::kSurface);
  keep(queues.lights, MediumHit::kLight);
  keep(queues.background, MediumHit::kNothing);
}

}  // namespace

void RELIEF_SHADE_MEDIA(const KernelGlobals& g,
                        PathState& state,
                        HitQueues& queues,
                        QueueView& next,
                        ShadowQueue& shadow)
{
  keep_those_that_arrive(
      queues, [&](std::uint32_t path, MediumHit hit) { return shade_medium(g, state, path, hit, next, shadow); });
}

void RELIEF_SHADE_PHOTON_MEDIA(const KernelGlobals& g,
                               PathState& state,
                               HitQueues& queues,
                               QueueView& next,
                               PhotonQueueView& photons)
{
  keep_those_that_arrive(
      queues, [&](std::uint32_t path, MediumHit hit) { return photon_medium(g, state, path, hit, next, photons); });
}

Vec3f RELIEF_SHADOW_TRANSMITTANCE(const KernelGlobals& g,
                                  const MediumState& inside,
                                  const ShadowWay& way,
                                  float from,
                                  float to)
{
  return media_shadow_transmittance(g, inside, way, from, to);
}

}  // namespace relief
