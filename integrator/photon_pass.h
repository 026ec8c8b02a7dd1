// The caustic pass: where photons start, how many, with what radius they are searched; and whether there is a pass at all.
//
// A light path belongs to it if, from the light, it meets one or more casters by their sharp lobes and then a soft lobe of
// a receiver: L S+ D, and again, L S+ D S+ D. What comes after, up to the camera, does not matter. All other paths are the
// path tracer's; see path_caustic_flags and closure_split for how it leaves these out.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <vector>

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

  PhotonSourcesView view(double photons_a_pass) const;
};

/// Finds the casters, groups them, and weighs each light's flux to each group.
/// @return no sources where no light can reach a caster
PhotonSources photon_sources_make(const SceneContext& context);

class PhotonPass {
 public:
  /// @param num_pixels  of the whole picture, so that a crop has the same photons
  PhotonPass(const SceneContext& context, const CausticSettings& settings, double num_pixels);

  /// Traces the next pass's photons and sorts them. Every sample of a pixel has a pass of its own, so that halves of the
  /// samples know nothing of each other's photons, and the error estimate holds for caustics as for the rest.
  /// @param g       gets the map
  /// @param worker  the calling thread's
  /// @param stop    true: photons not begun are left out
  /// @param report  called by any thread when photons have been traced
  void next(KernelGlobals& g,
            const StageTable& stages,
            const std::function<Wavefront&()>& worker,
            const std::atomic<bool>& stop,
            const std::function<void()>& report);

  /// Leaves passes out: the next one is that of this number, counted from 0.
  /// @pre one has been traced, which sets the radius of all, and none beyond that number
  void skip_to(std::uint32_t pass);

  PhotonPassState state() const { return {photons_a_pass_, first_radius_, stored_, seconds_}; }
  /// Goes on where another was.
  /// @param passes   that it had finished
  /// @param skipped  that it had left out of them
  void restore(const PhotonPassState& state, std::uint32_t passes, std::uint32_t skipped);

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

  const SceneContext& context_;
  CausticSettings settings_;
  PhotonSources sources_;
  std::uint32_t photons_a_pass_;
  std::uint32_t passes_ = 0, skipped_ = 0;   ///< the former with the latter
  std::atomic<std::uint32_t> under_way_{0};  ///< photons of the present pass
  float first_radius_ = 0;
  std::vector<std::vector<Photon>> chunks_;
  PhotonMap map_;
  std::uint64_t stored_ = 0;
  double seconds_ = 0;
};

}  // namespace relief
