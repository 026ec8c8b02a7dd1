// The way out of where planes meet: a short move after which a point is clear of all surfaces near it.
#pragma once

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <optional>
#include <vector>

#include "displacement/vec3d.h"

namespace relief {

/// A surface near a point, as flat as it is there.
struct NearPlane {
  Vec3d N;          ///< unit
  double distance;  ///< that a point has to be moved along N, > 0
};

/// The shortest v with N·v ≥ distance for all planes.
/// @return  empty if there is none: their normals are not all on one side of anything
/// @cost    the fourth power of their number
inline std::optional<Vec3d> few_planes_leave(const std::vector<NearPlane>& planes)
{
  std::optional<Vec3d> best;
  double least = static_cast<double>(kInfinity);
  const auto offer = [&](Vec3d v) {
    const double squared = dot(v, v);
    if (!(squared < least)) return;
    const bool is_clear = std::all_of(planes.begin(), planes.end(), [&](const NearPlane& plane) {
      return dot(plane.N, v) >= plane.distance * (1 - 1e-9);
    });
    if (!is_clear) return;
    best = v;
    least = squared;
  };
  // It lies on one, two or three of the planes' borders.
  const std::size_t count = planes.size();
  for (std::size_t i = 0; i < count; ++i) {
    const NearPlane& a = planes[i];
    offer(a.distance * a.N);
    for (std::size_t j = i + 1; j < count; ++j) {
      const NearPlane& b = planes[j];
      const Vec3d along = cross(a.N, b.N);
      const double squared = dot(along, along);
      if (!(squared > 1e-20)) continue;
      offer((a.distance * cross(b.N, along) + b.distance * cross(along, a.N)) * (1 / squared));
      for (std::size_t k = j + 1; k < count; ++k) {
        const NearPlane& c = planes[k];
        const double volume = dot(along, c.N);
        if (!(volume * volume > 1e-20)) continue;
        offer((a.distance * cross(b.N, c.N) + b.distance * cross(c.N, a.N) + c.distance * along) * (1 / volume));
      }
    }
  }
  return best;
}

/// Some v with N·v ≥ distance for all planes, not much longer than the shortest.
/// @return  empty if none is found
/// @cost    in proportion to their number
/// @source  Hildreth 1957, "A quadratic programming procedure"
inline std::optional<Vec3d> many_planes_leave(const std::vector<NearPlane>& planes)
{
  constexpr int kSweeps = 64;
  Vec3d v{};
  std::vector<double> pushed(planes.size(), 0.0);  // along each of the normals
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    for (std::size_t k = 0; k < planes.size(); ++k) {
      const double more = max(planes[k].distance - dot(planes[k].N, v), -pushed[k]);
      pushed[k] += more;
      v = v + more * planes[k].N;
    }
  }
  double longer = 1;
  for (const NearPlane& plane : planes) {
    const double along = dot(plane.N, v);
    if (!(along > 1e-6 * plane.distance)) return std::nullopt;
    longer = max(longer, plane.distance / along);
  }
  return v * longer;
}

/// @param Ng  unit, of the point's own surface. Planes know only the order of their vertices
/// @return    a move to the side of Ng that leaves all planes behind; zero if there is none
inline Vec3d planes_leave(const std::vector<NearPlane>& planes, Vec3d Ng)
{
  constexpr std::size_t kFew = 12;
  const std::optional<Vec3d> offset = planes.size() <= kFew ? few_planes_leave(planes) : many_planes_leave(planes);
  double own = 0;
  for (const NearPlane& plane : planes) {
    const double cosine = dot(plane.N, Ng);
    if (__builtin_fabs(cosine) > __builtin_fabs(own)) own = cosine;
  }
  return offset.value_or(Vec3d{}) * (own < 0 ? -1.0 : 1.0);
}

/// Squared distance of the origin from a triangle. @source Ericson 2005, Real-Time Collision Detection, §5.1.5
inline double squared_distance(Vec3d a, Vec3d b, Vec3d c)
{
  const auto to_line = [](Vec3d from, Vec3d to) {
    const Vec3d along = to - from;
    const double squared = dot(along, along);
    const double t = squared > 0 ? std::clamp(-dot(from, along) / squared, 0.0, 1.0) : 0.0;
    const Vec3d nearest = from + t * along;
    return dot(nearest, nearest);
  };
  const Vec3d n = cross(b - a, c - a);
  const bool inside = dot(cross(a, b), n) >= 0 && dot(cross(b, c), n) >= 0 && dot(cross(c, a), n) >= 0 && dot(n, n) > 0;
  if (inside) return dot(a, n) * dot(a, n) / dot(n, n);
  return std::min({to_line(a, b), to_line(b, c), to_line(c, a)});
}

/// Where what is near is larger than so many sides of micro-triangles, errors are larger than these are, as far from the origin as that
/// is: no surface is left to be clear of, and all that are near would take too long.
inline constexpr double kMostSidesAround = 2;

/// The planes of micro-triangles around a point.
struct NearPlanes {
  Vec3d P;
  Vec3d error;   ///< per axis, of the point and of an origin
  double reach;  ///< micro-triangles within this distance count
  std::vector<NearPlane> planes;

  /// Whether a box around some points is within reach: what tells of most of them that `add` need not be asked.
  bool may_reach(std::initializer_list<Vec3d> points) const
  {
    double squared = 0;
    for (double Vec3d::*axis : {&Vec3d::x, &Vec3d::y, &Vec3d::z}) {
      double least = static_cast<double>(kInfinity), most = -least;
      for (const Vec3d& point : points) {
        least = min(least, point.*axis);
        most = max(most, point.*axis);
      }
      const double out = max(max(least - P.*axis, P.*axis - most), 0.0);
      squared += out * out;
    }
    return squared <= reach * reach;
  }

  /// @param winding  1, or −1 of triangles that run clockwise around the normal of their front
  void add(double winding, Vec3d a, Vec3d b, Vec3d c)
  {
    const Vec3d normal = cross(b - a, c - a);
    const double squared = dot(normal, normal);
    if (!(squared > 0) || !(squared_distance(a - P, b - P, c - P) <= reach * reach)) return;
    const Vec3d N = normal * (winding / std::sqrt(squared));
    // On either side of it: rays leave a ridge below and a valley above alike.
    const double distance = 2 * dot(abs(N), error) + std::abs(dot(P - a, N));
    for (NearPlane& plane : planes) {
      if (dot(plane.N, N) < 1 - 1e-9) continue;
      plane.distance = std::max(plane.distance, distance);
      return;
    }
    planes.push_back({N, distance});
  }
};

}  // namespace relief
