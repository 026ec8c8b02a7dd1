// Cameras that no file describes: one that shows everything, and one between two points.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace relief {

/// For the camera that shows everything, whatever cameras there are; but one that is called so comes first.
inline constexpr const char* kAutoCamera = "auto";

/// What the user says of the camera.
struct CameraChoice {
  std::optional<Vec3f> look_from;  ///< empty: a camera of the scene, or one that shows everything
  std::optional<Vec3f> look_at;    ///< empty: the middle of everything; used only with look_from
  double fov = 0;                  ///< vertical field of view in degrees, of a camera that is made here; 0: 40
  float image_aspect = 0;          ///< width / height; 0: of the scene's resolution
  std::string name;                ///< of a camera of the scene, or its number, or kAutoCamera; empty: the first
  std::optional<float> shutter;    ///< frames that it is open; empty: as the camera has it

  bool operator==(const CameraChoice&) const = default;
};

/// Position of the camera of that name, or of that number if no camera is called so; the first one's if nothing is said.
std::optional<std::size_t> camera_named(std::span<const SceneCamera> cameras, const std::string& text);

/// Right-handed orthonormal frame that looks along −z, its y as near as possible to `up`.
Affine3 camera_frame(Vec3f z, Vec3f up, Vec3f P);

/// Points by which a mesh can be framed in place of all: for each of 128 directions the farthest one. What sticks out of their
/// hull is at most 2 % of a ball's radius.
std::vector<Vec3f> extreme_points(const std::vector<Vec3f>& points);

/// Finds the nearest place from which a perspective camera of a given direction sees all points. Nothing is kept of them but
/// how far they reach, so that the points of all frames of an animation can be added.
class Framing {
 public:
  /// The camera looks down on the scene from the front and a little from the right, where glTF says that the front is.
  /// @param fov  vertical field of view, degrees
  Framing(double fov, float image_aspect);

  /// @param reach_object, reach_world  how far the surface may lie from the points, metres before and after the transform
  void add(const Affine3& world_from_object,
           const std::vector<Vec3f>& points,
           float reach_object = 0,
           float reach_world = 0);

  /// Middle of the box around all points; the origin if there are none.
  Vec3f middle() const;

  /// A camera whose window the points fill to 88 % of its width or its height. Without points it frames a cube of 2 m around
  /// the origin.
  SceneCamera camera() const;

 private:
  static constexpr int kNumSides = 4;
  double half_width_ = 0, half_height_ = 0;  ///< of the window, on the plane z = −1
  Affine3 axes_;                             ///< of the camera, without a place
  Vec3f side_[kNumSides];    ///< across the planes that bound what is to be seen: right, left, top, bottom
  double reach_[kNumSides];  ///< of all points in those directions
  double nearest_;           ///< of all points along the camera's z
  Vec3f low_{kInfinity, kInfinity, kInfinity}, high_{-kInfinity, -kInfinity, -kInfinity};
};

/// A camera at one point that looks at another, upright.
/// @param fov  vertical field of view, degrees
SceneCamera look_camera(Vec3f from, Vec3f at, double fov, float image_aspect);

}  // namespace relief
