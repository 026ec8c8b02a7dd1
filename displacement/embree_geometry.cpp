#include "displacement/embree_geometry.h"

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

SurfacePoint displaced_point(const DisplacedGeometry& geometry, std::uint32_t triangle, int level, double b1, double b2)
{
  const OnLevel on(geometry, triangle, level);
  return surface_point(on.mesh, on.tri, b1, b2);
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
