// Where a picture is seen from: how long things are in it.
#pragma once

#include <algorithm>
#include <cmath>

#include "displacement/vec3d.h"
#include "kernel/camera/camera.h"

namespace relief {

class PictureView {
 public:
  /// @param height  pixels
  PictureView(const Camera& of, double picture_height)
      : camera(of),
        height(picture_height),
        eye_(to_double(of.world_from_camera.p)),
        right_(unit(of.world_from_camera.x)),
        up_(unit(of.world_from_camera.y)),
        back_(unit(of.world_from_camera.z))
  {
  }

  Camera camera;
  double height;  ///< pixels

  /// Length of a line in the picture, pixels: as if all of it were as near as its nearest point.
  /// @param a, b  world
  double pixels(Vec3f a, Vec3f b) const
  {
    const Vec3d along = to_double(b) - to_double(a);
    return length(along) * pixels_a_metre(to_double(a), along);
  }
  /// Length of a metre at a point, pixels.
  /// @param P  world
  double pixels_a_metre(Vec3d P) const { return pixels_a_metre(P, {}); }
  /// How much coarser a point may be for being outside of the picture: 1 in it and for half of it around, then growing up to 4
  /// with the distance from its middle. (Cycles takes 4 at once; growing keeps neighbours alike.)
  /// @param P  world
  double coarsening(Vec3d P) const
  {
    constexpr double kAround = 1.5, kMost = 4.0;
    const Vec3d from_eye = P - eye_;
    const double depth = -dot(from_eye, back_);
    const double size = camera.projection == Projection::kPerspective ? depth : 1.0;
    if (!(size > 0.0)) return kMost;
    const double x = dot(from_eye, right_) / (size * static_cast<double>(camera.half_width));
    const double y = dot(from_eye, up_) / (size * static_cast<double>(camera.half_height));
    const double out = std::max(std::abs(x - 2.0 * static_cast<double>(camera.shift_x)),
                                std::abs(y - 2.0 * static_cast<double>(camera.shift_y)));
    return std::clamp(out / kAround, 1.0, kMost);
  }

 private:
  static Vec3d unit(Vec3f axis) { return to_double(normalize(axis)); }
  /// Distance of a point from the line from the origin to `end`.
  static double distance_to_line(const Vec3d& point, const Vec3d& end)
  {
    const double squared = dot(end, end);
    const double t = squared > 0 ? std::clamp(dot(point, end) / squared, 0.0, 1.0) : 0.0;
    return length(point - t * end);
  }
  /// Where a line from P along `along` is nearest.
  double pixels_a_metre(const Vec3d& P, const Vec3d& along) const
  {
    const double scale = height / (2.0 * static_cast<double>(camera.half_height));
    const Vec3d to_eye = eye_ - P;
    if (camera.projection == Projection::kPerspective) return scale / std::max(distance_to_line(to_eye, along), 1e-30);
    // As in the picture for as far around as it is wide, and then less.
    const double within =
        (1.0 + std::abs(static_cast<double>(camera.shift_x)) + std::abs(static_cast<double>(camera.shift_y))) * 2.0 *
        std::hypot(static_cast<double>(camera.half_width), static_cast<double>(camera.half_height));
    const double distance = distance_to_line(to_eye - dot(to_eye, back_) * back_, along - dot(along, back_) * back_);
    return scale * std::min(within / distance, 1.0);
  }

  Vec3d eye_, right_, up_, back_;  ///< world; the last three unit
};

}  // namespace relief
