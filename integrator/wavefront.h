// One worker's wavefront: path state for a batch, queues between stages, and the loop over stages.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "integrator/accel.h"
#include "integrator/intersect_stage.h"
#include "integrator/shadow_stage.h"
#include "integrator/stages.h"
#include "kernel/counters.h"
#include "kernel/globals.h"

namespace relief {

enum class Stage : int { kGenerate, kIntersectClosest, kGatherPhotons, kShade, kIntersectShadow, kFilm, kTracePhotons };
inline constexpr int kNumStages = 7;
inline constexpr std::array<const char*, kNumStages> kStageNames = {
    "generate", "intersect_closest", "gather_photons", "shade", "intersect_shadow", "film", "trace_photons"};

inline constexpr std::uint64_t kNoSample = ~std::uint64_t{0};

/// A ray of a path, as it was traced.
struct RecordedRay {
  bool shadow = false;
  Vec3f O, D;  ///< world; D unit
  float t_min = 0, t_max = kInfinity;
  float t = kInfinity;      ///< where it hit; shadow rays: t_max if it reached the light
  std::uint32_t pixel = 0;  ///< of the film window
};

/// Photons that were kept, in an order that depends on nothing else.
struct KeptPhotons {
  std::vector<Photon> on_surfaces, in_media;
};

/// What paths need columns for.
struct WavefrontColumns {
  bool caustics = false;      ///< camera paths gather photons
  bool motion = false;        ///< paths have a time
  bool facets = false;        ///< they may meet coarser levels of height maps
  bool media = false;         ///< something fills space
  bool subsurface = false;    ///< they may go below surfaces
  bool light_passes = false;  ///< layers tell their light apart by the first event
  bool gloss = false;         ///< lights, few, are chosen by what closures' gloss shows of them
  bool catchers = false;      ///< they may meet shadow catchers
};

class Media;

/// What is asked where shadow catchers are alone, in place of what there is for the whole scene.
struct CatchersAlone {
  const Light* lights = nullptr;                              ///< as LightsView::lights
  const std::vector<std::uint8_t>* surface_kernel = nullptr;  ///< of each material; they know no photons
};

/// Owned by one thread at a time.
class Wavefront {
 public:
  explicit Wavefront(const WavefrontColumns& columns);

  /// Renders a batch of at most kBatchPaths paths into the film.
  /// @return  false if `stop` ended it: what the film got of it must not count
  bool run(const KernelGlobals& g,
           const Accel& accel,
           const StageTable& stages,
           const std::vector<std::uint8_t>& surface_kernel,
           const Batch& batch);

  /// Follows photons `first` … `first + count − 1`.
  /// @param count  at most kBatchPaths
  /// @param out    gets those that were kept; some of them if `stop` ends it
  void trace_photons(const KernelGlobals& g,
                     const Accel& accel,
                     const StageTable& stages,
                     const std::vector<std::uint8_t>& surface_kernel,
                     const PhotonSourcesView& sources,
                     std::uint64_t first,
                     std::uint32_t count,
                     KeptPhotons& out);

  /// What the first sample of a pixel of the last batch was worth, finite or not; linear Rec.709.
  /// @param pixel  of the film window, in the batch
  Vec3f first_radiance(std::uint32_t pixel) const;

  static std::size_t bytes(const WavefrontColumns& columns);

  const Media* media = nullptr;                  ///< null: there are none
  const CatchersAlone* catchers = nullptr;       ///< null: there are no columns for them
  std::vector<RecordedRay>* recorder = nullptr;  ///< receives every ray of the batch, if set
  const std::atomic<bool>* stop = nullptr;       ///< true: searches in displaced meshes are given up; null: never
  Counters counters;
  std::array<double, kNumStages> seconds{};
  std::uint32_t most_displacement_steps = 0;  ///< bounds and texels, of any single ray
  /// Dropped because it was not finite: pixel of the film << 32 | sample. The least, not the earliest, so that it does
  /// not depend on the order of batches.
  std::uint64_t first_nonfinite = kNoSample;

 private:
  /// What a batch is rendered with.
  struct Tools {
    const KernelGlobals& g;
    const Accel& accel;
    const StageTable& stages;
  };

  void clear_queues();
  void drop_unseen(const KernelGlobals& g);
  /// Charges the time since the last call, or the start of the batch, to a stage.
  void charge(Stage stage);
  /// Finds what the active paths meet, and takes them through media on the way.
  void search(const Tools& tools, bool camera, DisplacementWork& displacement);
  /// Shades what they have met; those that go on are active afterwards.
  void shade(const Tools& tools, DisplacementWork& displacement);
  /// Follows the active paths to their ends.
  /// @param camera  they have just started
  /// @return        false if `stop` ended it
  bool follow(const Tools& tools, bool camera, DisplacementWork& displacement);
  /// Copies paths whose camera rays have met a shadow catcher to alone_.
  void split_at_catchers(const KernelGlobals& g);
  /// Follows those copies where there are catchers only, and gives the paths what came of it.
  /// @return  as follow
  bool follow_alone(const Tools& tools, std::uint32_t num_paths, DisplacementWork& displacement);
  void trace_shadows(const KernelGlobals& g, const Accel& accel, ShadowStart start, DisplacementWork& displacement);
  void note_displacement(const DisplacementWork& work);
  void record_rays() const;
  void record_shadow_rays() const;

  static constexpr std::size_t kNumQueues = 4 + kNumSurfaceKernels;

  /// Everything that is as large as a batch.
  struct Memory {
    PathState state;
    ShadowQueue shadow;
    Vec3f visibility[kShadowEntries];  ///< of the shadow rays
    std::uint32_t queues[kNumQueues][kColumnEntries];
  };
  struct CausticMemory {
    PathColumn<Vec3f> irradiance, radiance;
    std::uint32_t wi[kColumnEntries], bounces[kColumnEntries], root[kColumnEntries];
  };

  struct MotionMemory {
    float time[kColumnEntries];
    InstanceView instances[kColumnEntries];
    MeshView meshes[kColumnEntries];
  };
  struct SubsurfaceMemory {
    SubsurfaceState entries[kColumnEntries];
    std::uint32_t entered[kColumnEntries], left[kColumnEntries];
  };

  std::unique_ptr<Memory> memory_;
  std::unique_ptr<CausticMemory> caustic_memory_;
  std::unique_ptr<MotionMemory> motion_memory_;
  std::unique_ptr<SubsurfaceMemory> subsurface_memory_;
  std::unique_ptr<FacetState[]> facet_memory_;
  std::unique_ptr<MediumState[]> medium_memory_;
  std::unique_ptr<LightPassState[]> light_pass_memory_;
  std::unique_ptr<LightGloss[]> gloss_memory_;
  std::unique_ptr<CatcherState[]> catcher_memory_;
  /// Of copies of paths that have met catchers, under the same numbers; null: nothing is one.
  std::unique_ptr<Wavefront> alone_;
  std::chrono::steady_clock::time_point last_;  ///< when time was charged last
  PathState& state_;
  ShadowQueue& shadow_;
  QueueView active_, next_;
  HitQueues met_;
};

}  // namespace relief
