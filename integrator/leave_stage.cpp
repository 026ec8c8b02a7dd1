// Compiled once an instruction set, as stages.cpp is; RELIEF_LEAVE_SURFACES names the function.
#include "integrator/stages.h"
#include "integrator/surface_kernels.h"
#include "kernel/stage/leave_surface.h"

namespace relief {

namespace {

/// Graphs are run for up to eight paths that leave one material and follow each other.
template <unsigned kFeatures>
void leave_all(const KernelGlobals& g,
               PathState& state,
               const QueueView& queue,
               QueueView& next,
               ShadowQueue& shadow,
               Counters& counters)
{
  constexpr std::uint32_t kLanes = 8;
  const auto material_of = [&](std::uint32_t path) { return g.instances[state.hit_object[path]].material_index; };
  counters.surface_hits += queue.size;
  GraphRegisters registers;
  registers.rays = g.graph_scene.rays;
  SurfaceInteraction located[kLanes];
  for (std::uint32_t first = 0, count = 0; first < queue.size; first += count) {
    const std::uint32_t* const paths = queue.paths + first;
    const auto material = material_of(paths[0]);
    count = 1;
    while (count < kLanes && first + count < queue.size && material_of(paths[count]) == material) ++count;
    surface_interactions_locate<kFeatures & kFeatureTextures>(g, state, paths, static_cast<int>(count), located);
    const std::int32_t graph = g.materials[material].graph_index;
    const GraphProgramView* const program = graph >= 0 ? &g.graphs[graph] : nullptr;
    if (program != nullptr) {
      surface_graph_run(g, state, *program, paths, static_cast<int>(count), located, registers);
      counters.graph_runs += 1;
      counters.graph_points += count;
    }
    for (std::uint32_t k = 0; k < count; ++k) {
      const GraphHit hit{{program, &registers, static_cast<int>(k)}};
      leave_surface<kFeatures>(g, state, paths[k], located[k], program != nullptr ? &hit : nullptr, next, shadow);
    }
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
