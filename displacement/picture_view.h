// Where a picture is seen from: how long things are in it.
#pragma once

#include <algorithm>
#include <cmath>

#include "displacement/vec3d.h"
#include "kernel/camera/camera.h"

namespace relief {

struct PictureView {
  Camera camera;
  double height = 1;  ///< pixels

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
    const Vec3d from_eye = P - to_double(camera.world_from_camera.p);
    const auto along = [&](Vec3f axis) { return dot(from_eye, to_double(normalize(axis))); };
    const double depth = -along(camera.world_from_camera.z);
    const double size = camera.projection == Projection::kPerspective ? depth : 1.0;
    if (!(size > 0.0)) return kMost;
    const double x = along(camera.world_from_camera.x) / (size * static_cast<double>(camera.half_width));
    const double y = along(camera.world_from_camera.y) / (size * static_cast<double>(camera.half_height));
    const double out = std::max(std::abs(x - 2.0 * static_cast<double>(camera.shift_x)),
                                std::abs(y - 2.0 * static_cast<double>(camera.shift_y)));
    return std::clamp(out / kAround, 1.0, kMost);
  }

 private:
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
    const Vec3d to_eye = to_double(camera.world_from_camera.p) - P;
    if (camera.projection == Projection::kPerspective) return scale / std::max(distance_to_line(to_eye, along), 1e-30);
    // As in the picture for as far around as it is wide, and then less.
    const Vec3d axis = to_double(normalize(camera.world_from_camera.z));
    const double within =
        (1.0 + std::abs(static_cast<double>(camera.shift_x)) + std::abs(static_cast<double>(camera.shift_y))) * 2.0 *
        std::hypot(static_cast<double>(camera.half_width), static_cast<double>(camera.half_height));
    const double distance = distance_to_line(to_eye - dot(to_eye, axis) * axis, along - dot(along, axis) * axis);
    return scale * std::min(within / distance, 1.0);
  }
};

}  // namespace relief
