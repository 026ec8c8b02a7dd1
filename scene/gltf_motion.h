// Where animated nodes are while the shutter is open.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "scene/composition.h"
#include "scene/memory.h"
#include "scene/scene.h"
#include "scene/shutter.h"

namespace relief {

/// World transforms of all animated nodes, and weights of their morph targets, at the steps of a shutter. Nodes are told apart by the number of their visit by
/// composition_traverse, which is the same at all times.
class ShutterNodes {
 public:
  ShutterNodes() = default;
  /// @param frame  that is rendered
  /// @error SceneError
  ShutterNodes(DocumentSet& documents,
               const GltfDocument& root,
               const Shutter& shutter,
               double frame,
               double frames_per_second);

  /// Places of a node, or of a copy that stands in it; those of the first step first.
  /// @param visit  number of the node
  /// @param copy   world = node · copy
  /// @return       empty: it stands still
  std::vector<Affine3> steps(std::size_t visit, const Transform& copy = {}) const;

  /// Weights of a node's morph targets likewise; empty: they stay the same.
  std::vector<std::vector<double>> weights(std::size_t visit) const;

 private:
  std::unordered_map<std::size_t, std::vector<Transform>> worlds_;
  std::unordered_map<std::size_t, std::vector<std::vector<double>>> weights_;
  MemoryWatch memory_;
};

/// Why places can not be gone through from one to the next; empty: they can.
std::string motion_defect(const std::vector<Affine3>& steps);

/// Motion of a light from where it is when the shutter is half done, see LightsView::motions.
/// @param steps   of its node
/// @param placed  its node when the shutter is half done
/// @param P       the light's, world
/// @return        empty: the node does more than move and turn
std::vector<Affine3> light_motion(const std::vector<Affine3>& steps, const Affine3& placed, Vec3f P);

}  // namespace relief
