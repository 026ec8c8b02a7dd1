// State of the paths of one wavefront batch: structure of arrays over path indices, generated from
// path_state_fields.inc. Shadow rays wait in a structure of arrays of their own.
#pragma once

#include <cstddef>
#include <cstdint>

#include "kernel/assert.h"
#include "kernel/math/vec.h"

namespace relief {

/// Columns of camera paths that the caustic pass needs; null where it is off.
struct CausticStateView {
  float *irradiance_r = nullptr, *irradiance_g = nullptr, *irradiance_b = nullptr;  ///< at the present hit, W/m²
  std::uint32_t* wi = nullptr;                                                      ///< octahedral: where it comes from
  float *radiance_r = nullptr, *radiance_g = nullptr, *radiance_b = nullptr;        ///< of the sample so far
};
inline constexpr int kNumCausticColumns = 7;

/// Columns of all paths of a batch; each is 64-byte aligned and has `capacity` entries.
struct PathStateView {
#define X(type, name) type* name = nullptr;
#include "kernel/state/path_state_fields.inc"
#undef X
  CausticStateView caustic;
  std::uint32_t capacity = 0;
};

inline constexpr std::size_t kPathStateBytes = 0
#define X(type, name) +sizeof(type)
#include "kernel/state/path_state_fields.inc"
#undef X
    ;

enum PathFlag : std::uint32_t {
  kPathSawSurface = 1u << 0,  ///< an opaque-enough surface was met: the AOVs of the first hit are written
  kPathCounted = 1u << 1,     ///< coverage was added to the film's alpha
  kPathOnlyDelta = 1u << 2,   ///< every scattering event so far was a delta one
  kPathAfterSoft = 1u << 3,   ///< the last scattering event is one where photons are gathered
  kPathCaustic =
      1u << 4,  ///< after such an event, all were sharp ones at casters: what lights lie ahead, photons bring
  kPathTransparentShift = 16,  ///< position of the count of transparent surfaces
};

/// Shadow rays of a batch: where to look, and what the path gains if nothing is in between.
struct ShadowQueueView {
  float *O_x, *O_y, *O_z, *D_x, *D_y, *D_z;  ///< world; D unit
  float* t_max;                              ///< metres
  float *cone_width, *cone_spread;           ///< ray cone at O
  float *gain_r, *gain_g, *gain_b;           ///< radiance × throughput, MIS weight included
  std::uint32_t* path;                       ///< whose
  std::uint32_t* scatterings;                ///< events between the camera and the light
  std::uint32_t size;                        ///< number of rays waiting
};

inline constexpr std::size_t kShadowRayBytes = 12 * sizeof(float) + 2 * sizeof(std::uint32_t);

/// Indices of paths waiting for a stage.
struct QueueView {
  std::uint32_t* paths = nullptr;
  std::uint32_t size = 0;
};

RELIEF_KERNEL void queue_push(QueueView& queue, std::uint32_t path) { queue.paths[queue.size++] = path; }

}  // namespace relief
