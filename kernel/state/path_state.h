// State of the paths of one wavefront batch: structure of arrays over path indices, generated from
// path_state_fields.inc. Shadow rays wait in a structure of arrays of their own.
#pragma once

#include <cstdint>

#include "kernel/assert.h"
#include "kernel/math/vec.h"
#include "kernel/state/path_event.h"

namespace relief {

/// Columns of camera paths that the caustic pass needs; null where it is off. A batch has one sample of each pixel then, and
/// so room for paths that fork.
struct CausticStateView {
  float *irradiance_r = nullptr, *irradiance_g = nullptr, *irradiance_b = nullptr;  ///< at the present hit, W/m²
  std::uint32_t* wi = nullptr;                                                      ///< octahedral: where it comes from
  float *radiance_r = nullptr, *radiance_g = nullptr, *radiance_b = nullptr;        ///< of the sample so far
  std::uint32_t* bounces = nullptr;  ///< of the photon that is there for all, see PhotonArrival
  std::uint32_t* root = nullptr;     ///< camera path it forked from, or itself
  std::uint32_t num_paths = 0;       ///< forked ones included
};
inline constexpr int kNumCausticFloats = 6;

/// Paths of a full batch. State and queues take about 270 bytes a path, so a batch nearly stays in a second-level cache of
/// 1 MiB.
inline constexpr std::uint32_t kBatchPaths = 4096;

/// Entries of a column. Columns are staggered by one cache line each: at equal distances of a power of two they would all
/// fall into the same few sets of a cache.
inline constexpr std::uint32_t kColumnEntries = kBatchPaths + 64 / 4;

/// Columns of all paths of a batch. They lie at fixed places, so that one register reaches them all.
struct alignas(64) PathState {
#define X(type, name) type name[kColumnEntries];
#include "kernel/state/path_state_fields.inc"
#undef X
  CausticStateView caustic;
};

enum PathFlag : std::uint32_t {
  kPathSawSurface = 1u << 0,   ///< an opaque-enough surface was met: the AOVs of the first hit are written
  kPathCounted = 1u << 1,      ///< coverage was added to the film's alpha
  kPathOnlyDelta = 1u << 2,    ///< every scattering event so far was a delta one
  kPathAfterSoft = 1u << 3,    ///< the last scattering event is one where photons are gathered
  kPathCaustic = 1u << 4,      ///< after such an event, only sharp ones at casters: lights ahead are brought by photons
  kPathSawFeature = 1u << 5,   ///< what a denoiser is told is written, see Aov::kDenoisingAlbedo
  kPathEventShift = 6,         ///< position of the two bits of PathEvent
  kPathTransparentShift = 16,  ///< position of the count of transparent surfaces
};

/// Entries of a column of shadow rays. A camera path's first hit may ask for a second one, for ambient occlusion.
inline constexpr std::uint32_t kShadowEntries = 2 * kBatchPaths + 64 / 4;

/// In place of `scatterings`: a ray that looks for ambient occlusion.
inline constexpr std::uint32_t kAmbientRay = ~0u;

/// Shadow rays of a batch: where to look, and what the path gains if nothing is in between.
struct alignas(64) ShadowQueue {
  float O_x[kShadowEntries], O_y[kShadowEntries], O_z[kShadowEntries];  ///< world
  float D_x[kShadowEntries], D_y[kShadowEntries], D_z[kShadowEntries];  ///< world, unit
  float t_max[kShadowEntries];                                          ///< metres
  float cone_width[kShadowEntries], cone_spread[kShadowEntries];        ///< ray cone at O
  float gain_r[kShadowEntries], gain_g[kShadowEntries],
      gain_b[kShadowEntries];                 ///< radiance × throughput, MIS weight included
  std::uint32_t path[kShadowEntries];         ///< whose
  std::uint32_t scatterings[kShadowEntries];  ///< events between the camera and the light, or kAmbientRay
  std::uint32_t size;                         ///< number of rays waiting
};

/// Indices of paths waiting for a stage.
struct QueueView {
  std::uint32_t* paths = nullptr;
  std::uint32_t size = 0;
};

RELIEF_KERNEL void queue_push(QueueView& queue, std::uint32_t path) { queue.paths[queue.size++] = path; }

}  // namespace relief
