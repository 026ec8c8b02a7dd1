// glTF animations: the pose of every animated node at one time.
#pragma once

#include <optional>
#include <unordered_map>
#include <vector>

#include "scene/gltf_document.h"
#include "scene/scene.h"
#include "scene/transform.h"

namespace relief {

/// What animations set on one node; absent parts keep the node's own value.
struct AnimatedPose {
  std::optional<Vec3d> translation, scale;
  std::optional<Quaternion> rotation;
  std::vector<double> weights;  ///< of morph targets; empty: absent
};

enum class Interpolation : std::uint8_t { kStep, kLinear, kCubicSpline };

/// Keyframes of one channel.
struct AnimationCurve {
  Interpolation interpolation = Interpolation::kLinear;
  bool is_rotation = false;
  std::vector<float> times;  ///< seconds, strictly increasing, not empty
  /// num_components a key (4 for rotations); with kCubicSpline three such groups a key: in-tangent, value, out-tangent.
  std::vector<float> values;
  int num_components = 3;  ///< of what is no rotation
};

/// Value at a time; before the first key the first value, after the last key the last one.
/// @return x, y, z (and w: a unit quaternion for rotations)
/// @source glTF 2.0, appendix C: slerp along the shorter arc; cubic Hermite with tangents scaled by the key distance
std::array<double, 4> animation_sample(const AnimationCurve& curve, double time_seconds);

/// Samples all animations of a document.
/// @return pose by node index
/// @error  SceneError: wrong accessor types or sizes, times that do not increase, a channel on a node with a matrix
std::unordered_map<int, AnimatedPose> animation_pose(const GltfDocument& document,
                                                     double time_seconds,
                                                     Warnings& warnings);

/// A document's animations, with their first and last keys.
/// @error SceneError: wrong accessor types or sizes
std::vector<AnimationClip> animation_clips(const GltfDocument& document);

}  // namespace relief
