// The medium that camera rays start in. A path knows of a medium by having come in through its surface; one that starts within
// an absorbing solid has to be told.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "integrator/scene_context.h"
#include "kernel/math/box.h"
#include "kernel/state/path_state.h"

namespace relief {

class CameraMedium {
 public:
  /// Finds the solids of a scene that absorb light.
  /// @param context  must outlive this
  explicit CameraMedium(const SceneContext& context);

  bool exists() const { return absorbs_; }

  /// That solids stand in each other of which one absorbs, a line a pair: a path knows of the last surface alone that it has
  /// passed.
  /// @cost  of a scene in which none absorbs: none
  std::vector<std::string> overlaps() const;

  /// Gives the first `count` paths, whose rays have just been made, the medium that they start in, at the near clipping plane: of solids in each other the one
  /// whose surface comes first.
  /// @cost  of a path that starts in the box of such a solid: a ray through the scene, unless the path before started there
  void apply(PathState& state, std::uint32_t count) const;

 private:
  struct Solid {
    Box3 box;  ///< world, over all time
    Vec3f sigma_a;
    std::size_t instance;
  };
  std::int32_t innermost_at(Vec3f P, float time, std::int32_t wanted) const;
  bool stands_in(const Solid& solid, std::int32_t other) const;

  const SceneContext& context_;
  std::vector<Solid> solids_;           ///< empty unless one absorbs
  std::vector<std::int32_t> solid_of_;  ///< an instance; −1: it is none
  bool absorbs_ = false;
};

}  // namespace relief
