// Where a picture is seen from: how long things are in it.
#pragma once

#include <algorithm>
#include <cmath>

#include "displacement/vec3d.h"
#include "kernel/camera/camera.h"

namespace relief {

class PictureView {
 public:
  /// How much coarser things are out of the picture if nobody says otherwise, as in Cycles.
  static constexpr double kUsualCoarsening = 4;

  /// @param height           pixels
  /// @param most_coarsening  out of the picture, see coarsening(); ≥ 1
  PictureView(const Camera& of, double picture_height, double most_coarsening = kUsualCoarsening)
      : camera(of),
        height(picture_height),
        most_coarsening_(most_coarsening),
        eye_(to_double(of.world_from_camera.p)),
        right_(unit(of.world_from_camera.x)),
        up_(unit(of.world_from_camera.y)),
        back_(unit(of.world_from_camera.z))
  {
    const auto half_width = static_cast<double>(of.half_width), half_height = static_cast<double>(of.half_height);
    const Vec3d ahead = (2.0 * half_width * static_cast<double>(of.shift_x)) * right_ +
                        (2.0 * half_height * static_cast<double>(of.shift_y)) * up_ - back_;
    ahead_ = ahead * (1.0 / length(ahead));
    half_angle_ = std::atan(std::hypot(half_width, half_height));
  }

  Camera camera;
  double height;  ///< pixels

  /// Of a panoramic camera, in the middle: solid angle for a unit of area of the picture.
  double middle_solid_angle() const
  {
    // A pole has none, and a lens may show nothing there.
    constexpr double kLeast = 1e-6;
    return std::max(static_cast<double>(panorama_point(camera.panorama, 0, 0).solid_angle), kLeast);
  }
  /// Whether a panorama's picture shows what is some way.
  /// @param D  the camera's space
  bool shows(Vec3f D) const
  {
    const Vec2f at = panorama_project(camera.panorama, D);
    const auto is_in = [](float x, float half, float shift) {
      return !(__builtin_fabsf(x / half - 2.0f * shift) > 1.0f);
    };
    return is_in(at.x, camera.half_width, camera.shift_x) && is_in(at.y, camera.half_height, camera.shift_y);
  }

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
  /// The most of pixels_a_metre within a ball, divided by the least of coarsening() there if things may be coarser outside.
  /// @param middle  world
  double most_pixels_a_metre(Vec3d middle, double radius, bool coarser_outside) const
  {
    const Vec3d from_eye = middle - eye_;
    const double depth = -dot(from_eye, back_);
    double most;
    if (camera.projection != Projection::kOrthographic) {
      most = pixels_a_radian() / std::max(length(from_eye) - radius, 1e-30);
    } else {
      most = pixels_in_plane(std::max(length(from_eye + depth * back_) - radius, 0.0));
    }
    if (!coarser_outside || camera.projection != Projection::kPerspective) return most;
    if (depth + radius <= 0) return most / most_coarsening_;
    if (depth - radius <= 0) return most;
    const auto out = [&](const Vec3d& axis, float half, float shift) {
      return (std::abs(dot(from_eye, axis)) - radius) / ((depth + radius) * static_cast<double>(half)) -
             2.0 * std::abs(static_cast<double>(shift));
    };
    const double least =
        std::max(out(right_, camera.half_width, camera.shift_x), out(up_, camera.half_height, camera.shift_y));
    return most / std::clamp(least / kAround, 1.0, most_coarsening_);
  }
  /// How much coarser a point may be for being outside of the picture: 1 in it and for half of it around, then growing with
  /// the distance from its middle, up to what was asked for. And see coarsening_afar.
  /// @param P  world
  double coarsening(Vec3d P) const
  {
    const Vec3d from_eye = P - eye_;
    if (camera.projection == Projection::kPanoramic)
      return std::clamp(out_of_panorama(P) / kAround, 1.0, most_coarsening_);
    const double depth = -dot(from_eye, back_);
    const double size = camera.projection == Projection::kPerspective ? depth : 1.0;
    if (!(size > 0.0)) return most_coarsening_ * coarsening_afar(P);
    const double x = dot(from_eye, right_) / (size * static_cast<double>(camera.half_width));
    const double y = dot(from_eye, up_) / (size * static_cast<double>(camera.half_height));
    const double out = std::max(std::abs(x - 2.0 * static_cast<double>(camera.shift_x)),
                                std::abs(y - 2.0 * static_cast<double>(camera.shift_y)));
    return std::clamp(out / kAround, 1.0, most_coarsening_) * coarsening_afar(P);
  }
  /// How much coarser a point may be for being far beside a picture that shows little of what is around: 1 within sixteen
  /// times the picture's angle, and then growing with the angle. What a telescope does not see would else be as fine as what
  /// it sees, and more than any memory holds. Angles of ordinary pictures are too wide for that.
  /// @param P  world
  double coarsening_afar(Vec3d P) const
  {
    constexpr double kAfar = 16, kHalfTurn = 3.14159265358979;
    if (camera.projection != Projection::kPerspective || kAfar * half_angle_ >= kHalfTurn) return 1;
    const Vec3d from_eye = P - eye_;
    const double angle = std::atan2(length(cross(from_eye, ahead_)), dot(from_eye, ahead_));
    return std::max(angle / (kAfar * half_angle_), 1.0);
  }

 private:
  static constexpr double kAround = 1.5;  ///< of coarsening()

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
    const Vec3d to_eye = eye_ - P;
    if (camera.projection != Projection::kOrthographic)
      return pixels_a_radian() / std::max(distance_to_line(to_eye, along), 1e-30);
    return pixels_in_plane(distance_to_line(to_eye - dot(to_eye, back_) * back_, along - dot(along, back_) * back_));
  }
  /// Of a perspective or panoramic camera, in the middle of its picture; of an orthographic one pixels a metre.
  /// By the shorter side of pixels that are not square; of a panorama's, by their solid angle.
  double pixels_a_radian() const
  {
    const double aspect = static_cast<double>(camera.pixel_aspect);
    const double side =
        camera.projection == Projection::kPanoramic ? std::sqrt(aspect * middle_solid_angle()) : std::min(aspect, 1.0);
    return height / (2.0 * static_cast<double>(camera.half_height) * side);
  }
  /// Of an orthographic camera, at a distance from its axis: as in the picture for as far around as it is wide, and then less.
  double pixels_in_plane(double distance) const
  {
    const double within =
        (1.0 + std::abs(static_cast<double>(camera.shift_x)) + std::abs(static_cast<double>(camera.shift_y))) * 2.0 *
        std::hypot(static_cast<double>(camera.half_width), static_cast<double>(camera.half_height));
    return pixels_a_radian() * std::min(within / distance, 1.0);
  }

  /// How far out of a panorama's picture a point is: 1 at its border.
  double out_of_panorama(const Vec3d& P) const
  {
    const Vec3d d = P - eye_;
    const Vec3f seen{static_cast<float>(dot(d, right_)), static_cast<float>(dot(d, up_)),
                     static_cast<float>(dot(d, back_))};
    const Vec2f at = panorama_project(camera.panorama, seen);
    return static_cast<double>(max(__builtin_fabsf(at.x / camera.half_width - 2.0f * camera.shift_x),
                                   __builtin_fabsf(at.y / camera.half_height - 2.0f * camera.shift_y)));
  }

  double most_coarsening_;
  Vec3d eye_, right_, up_, back_;  ///< world; the last three unit
  Vec3d ahead_;                    ///< unit, to the middle of the picture
  double half_angle_ = 1;          ///< from there to its corners, about; of a perspective camera
};

}  // namespace relief
