#include "displacement/embree_geometry.h"

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
  const double distance = surface_clearance(on.mesh, on.tri, b1, b2, reach);
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
