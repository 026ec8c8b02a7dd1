#include "displacement/picture_share.h"

#include <algorithm>
#include <cmath>

#include "kernel/math/box.h"

namespace relief {

namespace {

/// A polygon in a camera's space: x and y to the right and up on the picture's plane, times z, which is the depth, or 1.
struct Polygon {
  static constexpr int kMost =
      13;  ///< of a triangle's three, each of the picture's four sides makes half as many again at most
  Vec3d P[kMost];
  int count = 0;
};

/// What of a convex polygon is on the side of a plane through the origin that its normal points to.
Polygon clip(const Polygon& polygon, const Vec3d& normal)
{
  Polygon out;
  for (int k = 0; k < polygon.count; ++k) {
    const Vec3d &a = polygon.P[k], &b = polygon.P[k + 1 < polygon.count ? k + 1 : 0];
    const double da = dot(a, normal), db = dot(b, normal);
    if (da >= 0) out.P[out.count++] = a;
    if ((da < 0) != (db < 0)) out.P[out.count++] = a + (da / (da - db)) * (b - a);
  }
  return out;
}

/// With the sign of its direction of turning.
double area_in_picture(const Polygon& polygon)
{
  double twice = 0;
  for (int k = 0; k < polygon.count; ++k) {
    const Vec3d &a = polygon.P[k], &b = polygon.P[k + 1 < polygon.count ? k + 1 : 0];
    // The clipped polygon has depths above 0, but where it touches the eye.
    if (!(a.z > 0) || !(b.z > 0)) return 0;
    twice += a.x / a.z * (b.y / b.z) - b.x / b.z * (a.y / a.z);
  }
  return twice / 2;
}

/// Area of a triangle in a panorama's picture, about: its solid angle, as if it were in the middle; 0 if its own middle is not shown.
/// With the sign of its direction of turning.
/// @param a, b, c  the camera's space
/// @source van Oosterom and Strackee 1983, "The Solid Angle of a Plane Triangle"
double area_in_panorama(const Vec3d& a, const Vec3d& b, const Vec3d& c, const PictureView& view)
{
  const Vec3d middle = a + b + c;
  if (!view.shows({static_cast<float>(middle.x), static_cast<float>(middle.y), static_cast<float>(middle.z)})) return 0;
  const double la = length(a), lb = length(b), lc = length(c);
  const double over = la * lb * lc + dot(a, b) * lc + dot(a, c) * lb + dot(b, c) * la;
  return 2 * std::atan2(dot(a, cross(b, c)), over) / view.middle_solid_angle();
}

}  // namespace

double picture_share(const MeshView& mesh, std::span<const Affine3> places, const PictureView& view)
{
  const Camera& camera = view.camera;
  const bool is_perspective = camera.projection == Projection::kPerspective;
  const double half_width = camera.half_width, half_height = camera.half_height;
  const double middle_x = 2 * half_width * camera.shift_x, middle_y = 2 * half_height * camera.shift_y;
  const Vec3d sides[] = {{1, 0, half_width - middle_x},
                         {-1, 0, half_width + middle_x},
                         {0, 1, half_height - middle_y},
                         {0, -1, half_height + middle_y}};
  const Affine3 camera_from_world = inverse(camera.world_from_camera);
  constexpr double kLooked = 16384;
  const double total = static_cast<double>(mesh.num_triangles) * static_cast<double>(places.size());
  const double step = std::max(total / kLooked, 1.0);
  double seen[2] = {0, 0};
  double part = 0;  // 0 to 1, nowhere in step with the numbers of instances and triangles
  for (double at = 0; at < total; at += step) {
    constexpr double kGolden = 0.6180339887498949;
    part = std::fmod(part + kGolden, 1.0);
    const auto index = static_cast<std::uint64_t>(std::min(at + part * (step - 1), total - 1));
    const TriangleIndices& v = mesh.triangles[index % mesh.num_triangles];
    const Affine3 camera_from_object = camera_from_world * places[index / mesh.num_triangles];
    Polygon polygon;
    for (const std::uint32_t vertex : {v.v0, v.v1, v.v2})
      polygon.P[polygon.count++] = to_double(transform_point(camera_from_object, mesh.P[vertex]));
    double area;
    if (camera.projection == Projection::kPanoramic) {
      area = area_in_panorama(polygon.P[0], polygon.P[1], polygon.P[2], view);
    } else {
      for (Vec3d& P : polygon.P) P.z = is_perspective ? -P.z : 1.0;
      for (const Vec3d& side : sides) polygon = clip(polygon, side);
      area = area_in_picture(polygon);
    }
    seen[area < 0] += std::fabs(area);
  }
  return std::min(step * std::max(seen[0], seen[1]) / (4 * half_width * half_height), 1.0);
}

double box_share(const MeshView& mesh, std::span<const Affine3> places, const PictureView& view)
{
  const double width = view.height * view.camera.half_width / (view.camera.half_height * view.camera.pixel_aspect);
  Box3 box = box_empty();
  for (std::uint32_t i = 0; i < mesh.num_vertices; ++i) box = box_union(box, {mesh.P[i], mesh.P[i]});
  double share = 0;
  for (const Affine3& place : places) {
    const Vec3f low = transform_point(place, box.low), high = transform_point(place, box.high);
    const double pixels = view.pixels(low, high) / view.coarsening(0.5 * (to_double(low) + to_double(high)));
    share += std::min(pixels * pixels / (width * view.height), 1.0);
  }
  return std::min(share, 1.0);
}

}  // namespace relief
