// The caustic pass: where photons start, how many, with what radius they are searched; and whether there is a pass at all.
//
// A light path belongs to it if, from the light, it meets one or more casters by their sharp lobes and then a soft lobe of
// a receiver: L S+ D, and again, L S+ D S+ D. What comes after, up to the camera, does not matter. All other paths are the
// path tracer's; see path_caustic_flags and closure_split for how it leaves these out.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <vector>

#include "integrator/medium_photon_map.h"
#include "integrator/photon_map.h"
#include "integrator/scene_context.h"
#include "integrator/wavefront.h"
#include "kernel/render_state.h"

namespace relief {

/// Pairs of lights and groups of casters; owner of what a PhotonSourcesView points to.
struct PhotonSources {
  std::vector<PhotonSource> sources;
  std::vector<double> cdf;
  std::vector<Box3> targets;
  std::vector<std::int32_t> target_of;
  Box3 scene_box;
  std::vector<float> factors;  ///< on the power of each; none: 1
  /// Photons that are to lie within the radius of one in the first pass. On the scenes of benchmarks/caustics 16 to 32 had the
  /// least error from 1 to 64 passes with alpha = 3/4: more blurred, fewer left noise.
  double within = 24;
  double share = 1;  ///< of photons_wanted, that a pass is to start

  PhotonSourcesView view(double photons_a_pass) const;
};

/// Finds the casters, groups them, and weighs each light's flux to each group.
/// @return no sources where no light can reach a caster
PhotonSources photon_sources_make(const SceneContext& context);

/// Photons that a pass is to start.
double photons_wanted(const RenderSettings& settings);

/// Samples of every active pixel in the next turn, where there are photons. While all of a picture is sampled, one, with photons
/// of its own. Where few tiles still wait, as many as pay for the two passes that even and odd samples get then: no sample has
/// more photons traced for it than it would have in a picture without a noise threshold.
/// @param active  part of the picture that is sampled, (0, 1]
std::uint32_t photon_turn_samples(double active);

class PhotonPass {
 public:
  /// Maps in use at once. Even and odd samples of a pixel never share photons, so that halves of its samples know nothing of
  /// each other's, and the error estimate holds for caustics as for the rest.
  static constexpr std::size_t kMaps = 2;

  /// @param settings  of the whole picture, so that a crop has the same photons
  PhotonPass(const SceneContext& context, const RenderSettings& settings, PhotonSources sources);

  /// Sees to the photons of a turn. Usually they are traced; those of the turn before are kept as long as the samples that they
  /// have served are fewer than one of each pixel.
  /// @param g        get the maps: of samples by their parity if there are several, else only the first
  /// @param samples  of each active pixel
  /// @param active   part of the picture that is sampled
  /// @param worker   the calling thread's
  /// @param stop     true: photons not begun are left out
  /// @param report   called by any thread when photons have been traced
  void next_turn(std::array<KernelGlobals, kMaps>& g,
                 std::uint32_t samples,
                 double active,
                 const StageTable& stages,
                 const std::function<Wavefront&()>& worker,
                 const std::atomic<bool>& stop,
                 const std::function<void()>& report);

  /// Traces the next pass's photons and sorts them.
  /// @param g     gets the map
  /// @param slot  the map's place: what was there is gone
  void next(KernelGlobals& g,
            std::size_t slot,
            const StageTable& stages,
            const std::function<Wavefront&()>& worker,
            const std::atomic<bool>& stop,
            const std::function<void()>& report);

  /// Leaves passes out: the next one is that of this number, counted from 0.
  /// @pre one has been traced, which sets the radius of all, and none beyond that number
  void skip_to(std::uint32_t pass);

  PhotonPassState state() const
  {
    return {photons_a_pass_, surfaces_.first_radius, media_.first_radius, stored_, seconds_, passes_, num_maps_,
            served_};
  }
  /// Goes on where another was.
  /// @param skipped  passes that it had left out
  void restore(const PhotonPassState& state, std::uint32_t skipped);

  /// Passes so far; of one under way, the part that is traced.
  double passes() const { return passes_ - skipped_ + static_cast<double>(under_way_.load()) / photons_a_pass_; }

  /// Photons traced so far.
  std::uint64_t photons() const;

  double seconds() const { return seconds_; }

  void fill(CausticStatistics& stats) const;

 private:
  /// Starts fewer photons a pass where those that are kept would not fit into the memory that is allowed. How many are
  /// kept is found out by a batch of them, and only where it matters.
  void keep_to_memory(const KernelGlobals& g, const StageTable& stages, Wavefront& worker);

  /// Photons that lie on surfaces, or in media.
  struct Kept {
    std::vector<std::vector<Photon>> chunks;
    float first_radius = 0;
  };
  /// The radii of those of the present pass.
  std::vector<float> radii(Kept& kept, PhotonPlaces places) const;
  void build_maps(KernelGlobals& g, std::size_t slot);

  const SceneContext& context_;
  CausticSettings settings_;
  PhotonSources sources_;
  std::uint32_t photons_a_pass_;
  std::uint32_t passes_ = 0, skipped_ = 0;   ///< the former with the latter
  std::atomic<std::uint32_t> under_way_{0};  ///< photons of the present pass
  Kept surfaces_, media_;
  std::array<PhotonMap, kMaps> maps_;
  std::array<MediumPhotonMap, kMaps> maps_in_media_;
  std::uint32_t num_maps_ = 0;  ///< in use
  double served_ = 0;           ///< samples of the whole window, by these
  bool are_lost_ = false;       ///< they were another's, and have to be traced again
  std::uint64_t stored_ = 0;
  double seconds_ = 0;
};

}  // namespace relief
