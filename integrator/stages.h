// Entry points of the shading stages. stages.cpp and graph_stage.cpp are compiled once for every instruction set; the table is chosen when
// the program starts.
#pragma once

#include <array>
#include <cstdint>

#include "kernel/counters.h"
#include "kernel/globals.h"
#include "kernel/photon/sources.h"
#include "kernel/stage/photon_queue.h"
#include "kernel/state/path_state.h"

namespace relief {

struct SubsurfaceWalks;  // kernel/stage/subsurface_walk.h
struct TraversalTable;   // displacement/embree_geometry.h

/// Surface kernels are instantiated for a few feature masks, in rising order of what they can do.
inline constexpr int kNumSurfaceKernels = 12;

/// A rectangle of pixels and a run of their samples; path i of a batch is pixel i / num_samples in the order of
/// batch_pixel, sample first_sample + i % num_samples. So neighbouring paths are of one pixel, and meet the same triangles and
/// texels. Of a film that counts the samples of each pixel, those that rest are left out, and first_sample is the first of
/// pixels that have had none: each goes on from its own.
struct Batch {
  int x0 = 0, y0 = 0, width = 0, height = 0;  ///< in the film window
  std::uint32_t first_sample = 0, num_samples = 0;
};

/// Paths by what they have met.
struct HitQueues {
  const std::uint8_t* surface_kernel = nullptr;  ///< of each material, index of its kernel
  std::array<QueueView, kNumSurfaceKernels> surfaces;
  QueueView lights, background;
};

/// Steps of eight walks below surfaces; between `choose` and `go` integrator/subsurface_stage.h asks what they meet.
struct WalkStages {
  bool (*begin)(const PathState&, std::uint32_t path, SubsurfaceWalks&, int lane);
  void (*choose)(SubsurfaceWalks&);
  void (*go)(SubsurfaceWalks&);
};

struct StageTable {
  const char* isa;
  /// Starts the batch's paths, from 0 on. @return  their number
  std::uint32_t (*generate)(const KernelGlobals&, PathState&, const Batch&);
  void (*shade_surface[kNumSurfaceKernels])(const KernelGlobals&,
                                            PathState&,
                                            const QueueView& queue,
                                            QueueView& next,
                                            ShadowQueue& shadow,
                                            Counters&);
  /// Takes paths through the media that they are in, before what they have met is shaded; those that do not get there, and those that
  /// have met a boundary alone, leave their queues.
  void (*shade_media)(const KernelGlobals&, PathState&, HitQueues& queues, QueueView& next, ShadowQueue& shadow);
  /// The same of photons; those that are kept in media are added to `photons`.
  void (*shade_photon_media)(const KernelGlobals&,
                             PathState&,
                             HitQueues& queues,
                             QueueView& next,
                             PhotonQueueView& photons);
  const WalkStages* walks;
  /// Lights and scatters paths that have walked below a surface and got out.
  void (*leave_surfaces)(const KernelGlobals&,
                         PathState&,
                         const QueueView& queue,
                         QueueView& next,
                         ShadowQueue& shadow,
                         Counters&);
  void (*shade_background)(const KernelGlobals&, PathState&, const QueueView& queue, Counters&);
  void (*shade_light)(const KernelGlobals&, PathState&, const QueueView& queue, QueueView& next);
  /// @param visibility  one entry a shadow ray
  void (*accumulate_shadow)(const KernelGlobals&, PathState&, const ShadowQueue& shadow, const Vec3f* visibility);
  /// Writes the photons that the paths' hits have around them to the caustic columns.
  void (*gather_photons)(const KernelGlobals&, PathState&, const QueueView& queue);
  /// Starts photons `first` … `first + count − 1`; those that carry light are queued, as paths from 0 on.
  void (*emit_photons)(const KernelGlobals&,
                       const PhotonSourcesView&,
                       PathState&,
                       std::uint64_t first,
                       std::uint32_t count,
                       QueueView& next);
  void (*shade_photons)(const KernelGlobals&,
                        const PhotonSourcesView&,
                        PathState&,
                        const QueueView& queue,
                        QueueView& next,
                        PhotonQueueView& photons);
  /// Adds the batch's finished samples to the film, in path order; what paths that forked have found goes to their root's.
  /// @param num_paths        from generate
  /// @param first_nonfinite  pixel << 32 | sample, lowered to the least of the samples that were dropped
  void (*finish)(const KernelGlobals&,
                 PathState&,
                 const Batch&,
                 std::uint32_t num_paths,
                 Counters&,
                 std::uint64_t& first_nonfinite);
  GraphRun run_graph;
  ShadowTransmittance shadow_transmittance;
  ShadowSurfacesPass shadow_surfaces;
};

/// The interpreter of value graphs: see GraphRun.
void graph_run_baseline(const GraphProgramView& program, const TextureView* textures, GraphRegisters& registers);
void graph_run_avx2(const GraphProgramView& program, const TextureView* textures, GraphRegisters& registers);
void graph_run_avx512(const GraphProgramView& program, const TextureView* textures, GraphRegisters& registers);

/// See StageTable::shade_media.
void shade_media_baseline(
    const KernelGlobals& g, PathState& state, HitQueues& queues, QueueView& next, ShadowQueue& shadow);
void shade_media_avx2(
    const KernelGlobals& g, PathState& state, HitQueues& queues, QueueView& next, ShadowQueue& shadow);

/// See StageTable::shade_photon_media.
void shade_photon_media_baseline(const KernelGlobals& g,
                                 PathState& state,
                                 HitQueues& queues,
                                 QueueView& next,
                                 PhotonQueueView& photons);
void shade_photon_media_avx2(const KernelGlobals& g,
                             PathState& state,
                             HitQueues& queues,
                             QueueView& next,
                             PhotonQueueView& photons);

/// See ShadowTransmittance.
Vec3f shadow_transmittance_baseline(const KernelGlobals& g,
                                    const MediumState& inside,
                                    const ShadowWay& way,
                                    float from,
                                    float to);
Vec3f shadow_transmittance_avx2(const KernelGlobals& g,
                                const MediumState& inside,
                                const ShadowWay& way,
                                float from,
                                float to);

extern const WalkStages walk_stages_baseline;
extern const WalkStages walk_stages_avx2;

/// See StageTable::leave_surfaces.
void leave_surfaces_baseline(
    const KernelGlobals& g, PathState& state, const QueueView& queue, QueueView& next, ShadowQueue& shadow, Counters& counters);
void leave_surfaces_avx2(
    const KernelGlobals& g, PathState& state, const QueueView& queue, QueueView& next, ShadowQueue& shadow, Counters& counters);

/// See ShadowSurfacesPass.
void shadow_surfaces_baseline(const KernelGlobals& g, const ShadowSurfaces& surfaces, Vec3f passes[8]);
void shadow_surfaces_avx2(const KernelGlobals& g, const ShadowSurfaces& surfaces, Vec3f passes[8]);

const StageTable& stage_table_baseline();
const StageTable& stage_table_avx2();

/// The best table for this machine of those that were built; $RELIEF_ISA (baseline, avx2) overrides.
/// @error std::runtime_error if $RELIEF_ISA names something else or something this machine lacks; if nothing that was built runs
const StageTable& stage_table_select();

/// The traversals of displaced meshes that go with it.
const TraversalTable& traversal_table_select();

}  // namespace relief
