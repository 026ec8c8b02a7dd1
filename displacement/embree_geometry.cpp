#include "displacement/embree_geometry.h"

#include <algorithm>
#include <cmath>

#include "displacement/clearance.h"
#include "displacement/seam_walls.h"

namespace relief {

namespace {

void bounds(const RTCBoundsFunctionArguments* arguments)
{
  const auto& geometry = *static_cast<const DisplacedGeometry*>(arguments->geometryUserPtr);
  const Box3f box = displaced_triangle_bounds(geometry.mesh, arguments->primID);
  RTCBounds* out = arguments->bounds_o;
  out->lower_x = box.low.x;
  out->lower_y = box.low.y;
  out->lower_z = box.low.z;
  out->upper_x = box.high.x;
  out->upper_y = box.high.y;
  out->upper_z = box.high.z;
}

/// A geometry's mesh and one of its triangles, on one level.
struct OnLevel {
  DisplacedMeshView mesh;
  DisplacedTriangle tri;

  OnLevel(const DisplacedGeometry& geometry, std::uint32_t triangle, int level)
      : mesh(geometry.mesh), tri(geometry.mesh.triangles[triangle])
  {
    if (level == 0) return;
    mesh.field = geometry.levels[level].field;
    tri = triangle_on_level(tri, *geometry.mesh.field, *mesh.field);
  }
};

/// A box around a point of the surface that reaches over sides of its triangle.
struct BoxOverSides {
  const DisplacedGeometry& geometry;
  std::uint32_t triangle;
  int level;
  double weights[3];  ///< of the triangle's vertices; 0 where the box reaches over the side opposite to them
  double d;           ///< the point's displacement, metres
  Vec3d reach;
  double clearance;  ///< of the triangle itself, then of its neighbours too
  bool has_neighbors = false;
};

/// Widens the clearance by that of a triangle that has all vertices between which the point is, if it has the surface in
/// common there: at a seam it has not.
bool widen_by_neighbor(RTCPointQueryFunctionArguments* arguments)
{
  auto& box = *static_cast<BoxOverSides*>(arguments->userPtr);
  if (arguments->primID == box.triangle) return false;
  const DisplacedTriangle& own = box.geometry.mesh.triangles[box.triangle];
  const OnLevel other(box.geometry, arguments->primID, box.level);
  double b[3] = {0, 0, 0};
  for (int k = 0; k < 3; ++k) {
    if (box.weights[k] == 0) continue;
    int at = 0;
    while (at < 3 && !(other.tri.P[at] == own.P[k] && other.tri.N[at] == own.N[k])) ++at;
    if (at == 3) return false;
    b[at] = box.weights[k];
  }
  // From the point to where it is on the side, and from there once more.
  const SurfaceInBox near = surface_in_box(other.mesh, other.tri, b[1], b[2], 2.0 * box.reach);
  const double d = surface_point(other.mesh, other.tri, b[1], b[2]).d;
  if (!(std::abs(d - box.d) <= near.clearance)) return false;
  box.clearance = std::max(box.clearance, near.clearance);
  box.has_neighbors = true;
  return false;
}

}  // namespace

ReportedPoint displaced_point(const DisplacedGeometry& geometry, std::uint32_t triangle, ReportedHit hit)
{
  ReportedPoint out;
  if (hit.Ng_x >= 0.0f) {
    out.b1 = hit.u;
    out.b2 = hit.v;
    out.level = static_cast<int>(hit.Ng_x);
    const OnLevel on(geometry, triangle, out.level);
    out.point = surface_point(on.mesh, on.tri, hit.u, hit.v);
    return out;
  }
  const int code = static_cast<int>(-hit.Ng_x) - 1, edge = code % 3;
  float b[3] = {0.0f, 0.0f, 0.0f};
  b[edge] = 1.0f - hit.u;
  b[edge == 2 ? 0 : edge + 1] = hit.u;
  out.b1 = b[1];
  out.b2 = b[2];
  out.level = code / 3;
  out.on_wall = true;
  out.point = seam_wall_point(geometry.mesh, triangle, edge, hit.u, hit.v,
                              {geometry.mesh.field, geometry.levels[out.level].field});
  return out;
}

Vec3d displaced_smooth_normal(const DisplacedGeometry& geometry,
                              std::uint32_t triangle,
                              int level,
                              double b1,
                              double b2)
{
  const OnLevel on(geometry, triangle, level);
  return surface_smooth_normal(on.mesh, on.tri, b1, b2);
}

Vec3d displaced_leave(const DisplacedGeometry& geometry,
                      std::uint32_t triangle,
                      int level,
                      double b1,
                      double b2,
                      Vec3d reach)
{
  const OnLevel on(geometry, triangle, level);
  const SurfaceInBox own = surface_in_box(on.mesh, on.tri, b1, b2, reach);
  double distance = own.crease ? own.clearance : 0;
  // A triangle within the box has no side that it could share.
  if (own.sides != 0 && own.sides != 7 && geometry.scene != nullptr) {
    const SurfacePoint point = surface_point(on.mesh, on.tri, b1, b2);
    BoxOverSides box{geometry, triangle, level, {1.0 - b1 - b2, b1, b2}, point.d, reach, own.clearance};
    double sum = 0;
    for (int k = 0; k < 3; ++k) {
      if ((own.sides >> k & 1) != 0) box.weights[k] = 0;
      sum += box.weights[k];
    }
    for (double& weight : box.weights) weight /= sum;
    const Vec3f P = to_float(point.P);
    RTCPointQuery query{P.x, P.y, P.z, 0.0f, static_cast<float>(2.0 * length(reach))};
    RTCPointQueryContext context;
    rtcInitPointQueryContext(&context);
    rtcPointQuery(geometry.scene, &query, &context, widen_by_neighbor, &box);
    if (box.has_neighbors) distance = box.clearance;
  }
  if (!(distance > 0)) return {};
  const Vec3d N = base_point(on.tri, b1, b2).N;
  return N * (distance / length(N));
}

RTCGeometry displaced_geometry_make(RTCDevice device, const DisplacedGeometry& geometry, const TraversalTable& table)
{
  RTCGeometry out = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
  rtcSetGeometryUserPrimitiveCount(out, geometry.mesh.num_triangles);
  // Embree hands the pointer back as it was given; no callback writes through it.
  rtcSetGeometryUserData(out, const_cast<DisplacedGeometry*>(&geometry));
  rtcSetGeometryBoundsFunction(out, bounds, nullptr);
  rtcSetGeometryIntersectFunction(out, table.intersect);
  rtcSetGeometryOccludedFunction(out, table.occluded);
  return out;
}

}  // namespace relief
