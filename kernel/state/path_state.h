// State of the paths of one wavefront batch: structure of arrays over path indices, generated from
// path_state_fields.inc. Shadow rays wait in a structure of arrays of their own.
#pragma once

#include <cstdint>

#include "kernel/assert.h"
#include "kernel/light/light_receiver.h"
#include "kernel/math/vec.h"
#include "kernel/shape/triangle_lift.h"
#include "kernel/state/facet_state.h"
#include "kernel/state/light_pass_state.h"
#include "kernel/state/medium_state.h"
#include "kernel/state/path_event.h"
#include "kernel/state/subsurface_state.h"

namespace relief {

/// Paths of a full batch. State and queues take about 270 bytes a path, so a batch nearly stays in a second-level cache of
/// 1 MiB.
inline constexpr std::uint32_t kBatchPaths = 4096;

/// Entries of a column. Columns are staggered by one cache line each: at equal distances of a power of two they would all
/// fall into the same few sets of a cache.
inline constexpr std::uint32_t kColumnEntries = kBatchPaths + 64 / 4;

/// A column of one type.
template <class T, std::uint32_t kEntries = kColumnEntries>
struct PathColumn {
  T entries[kEntries];

  [[gnu::always_inline]] T& operator[](std::uint32_t i) { return entries[i]; }
  [[gnu::always_inline]] const T& operator[](std::uint32_t i) const { return entries[i]; }
};

/// One entry of a column of vectors.
struct Vec3fEntry {
  float &x, &y, &z;

  [[gnu::always_inline]] operator Vec3f() const { return {x, y, z}; }
  [[gnu::always_inline]] const Vec3fEntry& operator=(Vec3f v) const
  {
    x = v.x;
    y = v.y;
    z = v.z;
    return *this;
  }
  [[gnu::always_inline]] const Vec3fEntry& operator=(const Vec3fEntry& v) const { return *this = Vec3f(v); }
};

/// Vectors, component by component.
template <std::uint32_t kEntries>
struct PathColumn<Vec3f, kEntries> {
  float x[kEntries], y[kEntries], z[kEntries];

  [[gnu::always_inline]] Vec3fEntry operator[](std::uint32_t i) { return {x[i], y[i], z[i]}; }
  [[gnu::always_inline]] Vec3f operator[](std::uint32_t i) const { return {x[i], y[i], z[i]}; }
};

/// Columns of camera paths that the caustic pass needs; null where it is off. A batch has one sample of each pixel then, and
/// so room for paths that fork.
struct CausticStateView {
  PathColumn<Vec3f>* irradiance = nullptr;  ///< at the present hit, W/m²
  PathColumn<Vec3f>* radiance = nullptr;    ///< of the sample so far
  std::uint32_t* wi = nullptr;              ///< octahedral: where the irradiance comes from
  std::uint32_t* bounces = nullptr;         ///< of the photon that is there for all, see PhotonArrival
  std::uint32_t* root = nullptr;            ///< camera path it forked from, or itself
  std::uint32_t num_paths = 0;              ///< forked ones included
};

/// Indices of paths waiting for a stage.
struct QueueView {
  std::uint32_t* paths = nullptr;
  std::uint32_t size = 0;
};

RELIEF_KERNEL void queue_push(QueueView& queue, std::uint32_t path) { queue.paths[queue.size++] = path; }

/// Columns of paths that may go below surfaces; null where none may.
struct SubsurfaceStateView {
  SubsurfaceState* entries = nullptr;
  QueueView entered;  ///< those that have just done so
};

struct InstanceView;
struct MeshView;

/// Columns that paths need while the shutter is open; null where nothing takes time.
struct MotionStateView {
  float* time = nullptr;  ///< of the path, see motion.h
  InstanceView* instances =
      nullptr;                 ///< at the present hit, if it is on an instance that moves: as it is at the path's time
  MeshView* meshes = nullptr;  ///< likewise, of one that deforms
};

/// What a path has of the shadow catcher that it met first.
struct CatcherState {
  bool is_met = false;
  Vec3f direct, indirect, caustic;  ///< what the path had brought before
  Vec3f light[kNumLightPasses];     ///< likewise, where layers tell light apart by its first event
  float share = 0;                  ///< of its light that what is before the catcher lets through
  Vec3f alone;                      ///< what the path would have brought from there if there were catchers only
  Vec3f backdrop;                   ///< what the camera would see in the catcher's place
};

/// Columns of all paths of a batch. They lie at fixed places, so that one register reaches them all.
struct alignas(64) PathState {
#define X(type, name) PathColumn<type> name;
#include "kernel/state/path_state_fields.inc"
#undef X
  CausticStateView caustic;
  MotionStateView motion;
  SubsurfaceStateView subsurface;
  FacetState* facets = nullptr;            ///< of the present hit; null where no ray meets any
  MediumState* media = nullptr;            ///< null where nothing has a medium
  LightPassState* light_passes = nullptr;  ///< null where no layer tells light apart by its first event
  LightGloss* scatter_gloss = nullptr;     ///< beside scatter_N; null: lights are chosen without
  CatcherState* catchers = nullptr;        ///< null where nothing is a shadow catcher
};

enum PathFlag : std::uint32_t {
  kPathSawSurface = 1u << 0,  ///< the AOVs of the first hit are written, or none will be, see shade_medium_scatter
  kPathCounted = 1u << 1,     ///< coverage was added to the film's alpha
  kPathOnlyDelta = 1u << 2,   ///< every scattering event so far was a delta one
  kPathAfterSoft = 1u << 3,   ///< the last scattering event is one where photons are gathered
  kPathCaustic = 1u << 4,     ///< after such an event, only sharp ones at casters: lights ahead are brought by photons
  kPathSawFeature = 1u << 5,  ///< what a denoiser is told is written, see Aov::kDenoisingAlbedo
  kPathEventShift = 6,        ///< position of the two bits of PathEvent
  kPathPhoton = 1u << 8,      ///< it started at a light
  kPathHiddenShift = 9,       ///< position of four bits, of a photon: Light::hidden_from
  kPathCovers = 1u << 13,     ///< an event after which the film is not clear, whatever is seen behind it
  kPathScattered = 1u << 14,  ///< the last scattering event was in a medium: the two bits of PathEvent mean nothing
  kPathLast = 1u << 15,       ///< it has scattered or passed as often as it may: what it meets is seen, but not lit
  kPathTranslucent = 1u << 16,  ///< kTransmission was by a diffuse lobe
  kPathTransparentShift = 17,   ///< position of the count of transparent surfaces
};

/// Entries of a column of shadow rays. A camera path's first hit may ask for a second one, for ambient occlusion.
inline constexpr std::uint32_t kShadowEntries = 2 * kBatchPaths + 64 / 4;

/// In place of `scatterings`: a ray that looks for ambient occlusion.
inline constexpr std::uint32_t kAmbientRay = ~0u;
/// Within `scatterings`: the number of events, above it that of the light's group, of transparent surfaces that the path had passed,
/// and whether the first event is in a medium.
inline constexpr std::uint32_t kShadowScatterings = 0x3ffu;
inline constexpr int kShadowLightGroupShift = 10;
inline constexpr int kShadowTransparentShift = 16;
inline constexpr std::uint32_t kMediumRay = 1u << 31;

/// Shadow rays of a batch: where to look, and what the path gains if nothing is in between.
struct alignas(64) ShadowQueue {
  PathColumn<Vec3f, kShadowEntries> O;                            ///< world
  PathColumn<Vec3f, kShadowEntries> D;                            ///< world, unit
  float t_max[kShadowEntries];                                    ///< metres
  float cone_width[kShadowEntries], cone_spread[kShadowEntries];  ///< ray cone at O
  PathColumn<Vec3f, kShadowEntries> gain;                         ///< radiance × throughput, MIS weight included
  std::uint32_t path[kShadowEntries];                             ///< whose
  std::uint32_t scatterings[kShadowEntries];  ///< events before the light, see kShadowScatterings; or kAmbientRay
  std::uint32_t size;                         ///< number of rays waiting
};

}  // namespace relief
