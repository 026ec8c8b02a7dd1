// A scene's motion while the shutter is open, as rays and hits ask for it. The tracer and shading have it from here, so that
// both mean the same place.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "displacement/deformation.h"
#include "kernel/math/motion.h"
#include "kernel/shape/mesh_view.h"
#include "scene/scene.h"

namespace relief {

/// Translation, rotation and stretch of a transform; what mirrors is in the stretch.
/// @param before  key that the rotation is to be near to; null: none
/// @param m       can be inverted
/// @source Higham 1986, "Computing the Polar Decomposition—with Applications", Eq. 3.5
MotionKey motion_key_make(const Affine3& m, const MotionKey* before);

/// Bound on how far a point strays from the straight line between two keys, at an even pace along it; same unit as `reach`.
/// @param reach  farthest that it may be from the origin before the transform
double motion_stray(const MotionKey& from, const MotionKey& to, double reach);

class SceneMotion {
 public:
  /// @param scene  must outlive this
  explicit SceneMotion(const Scene& scene);
  SceneMotion(const SceneMotion&) = delete;
  SceneMotion& operator=(const SceneMotion&) = delete;

  /// Counts a mesh after those of the scene.
  /// @param shapes  as shapes() gives them
  void add_mesh(std::vector<MeshShape> shapes) { shapes_.push_back(std::move(shapes)); }

  /// Of a mesh at evenly spaced times; none: it does not deform.
  const std::vector<MeshShape>& shapes(std::size_t mesh_index) const { return shapes_[mesh_index]; }

  /// Whether anything takes time.
  bool is_open() const { return is_open_; }

  /// By index into Scene::motions.
  const MotionView* views() const { return views_.data(); }
  /// @param index  −1: nothing moves
  MotionView view(int index) const { return index >= 0 ? views_[static_cast<std::size_t>(index)] : MotionView{}; }

  /// An instance as it is at a time.
  /// @param centre  as it is when the shutter is half done
  InstanceView instance_at(const InstanceView& centre, float time) const;

  /// Its mesh likewise.
  MeshView mesh_at(const InstanceView& instance, const MeshView& centre, float time) const;

  std::size_t bytes() const { return keys_.size() * sizeof(MotionKey) + views_.size() * sizeof(MotionView); }

 private:
  const Scene& scene_;
  bool is_open_ = false;
  std::vector<std::vector<MeshShape>> shapes_;  ///< by mesh
  std::vector<MotionKey> keys_;
  std::vector<MotionView> views_;
};

}  // namespace relief
