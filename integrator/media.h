// The media that camera rays start in, and what they leave of shadow rays. Paths know of a medium by having come in through what
// bounds it; one that starts within has to be told.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "integrator/scene_context.h"
#include "kernel/math/box.h"
#include "kernel/state/path_state.h"
#include "kernel/volume/shadow_way.h"

namespace relief {

class Media {
 public:
  /// Finds what media fill in a scene.
  /// @param context  must outlive this
  explicit Media(const SceneContext& context);

  bool exist() const { return exist_; }

  /// Meshes that bound a medium and are open or inside out, a line each.
  std::vector<std::string> problems() const;

  /// Gives paths whose rays have just been made the media that they start in; of camera paths, at the near clipping plane.
  /// @cost  a ray to there a path; where the camera is in the box of such a mesh, a ray through the scene once, or a path with a lens
  void start(PathState& state, const QueueView& paths) const;

 private:
  struct Filled {
    Box3 box;  ///< world, over all time
    std::int32_t instance;
  };
  bool has_medium(unsigned instance) const;
  void find(Vec3f P, float time, MediumState& out) const;
  void follow(Vec3f P, Vec3f D, float to, float time, MediumState& out) const;

  const SceneContext& context_;
  std::vector<Filled> filled_;
  bool exist_ = false;
};

/// A boundary that a shadow ray passes.
struct ShadowBoundary {
  float t;  ///< along the ray, metres
  std::int32_t instance;
  std::uint32_t triangle;  ///< of a hit that is met twice it is the same
  bool is_front;           ///< the ray enters
};

/// What media leave of a shadow ray; where some vary, a random number of that mean.
/// @param inside      those that it starts in; used up
/// @param boundaries  all that it passes, in any order; sorted
Vec3f shadow_transmittance(const KernelGlobals& g,
                           MediumState inside,
                           std::vector<ShadowBoundary>& boundaries,
                           const ShadowWay& way);

}  // namespace relief
