// Displaced meshes as Embree user geometry: bounds, the callbacks that unpack a ray, call a method and pack its hit, and
// what becomes of the hit that is nearest. The callbacks are compiled once an instruction set, like the integrator's
// stages.
#pragma once

#include <optional>

#include "displacement/displaced_mesh.h"
#include "displacement/embree.h"
#include "displacement/level_of_detail.h"
#include "displacement/method.h"
#include "displacement/procedural_field.h"
#include "kernel/shape/triangle_lift.h"

namespace relief {

class PointTiles;

/// A level of a height map, and what the geometry's method needs of it.
struct DisplacementLevel {
  const HeightFieldView* field = nullptr;
  const void* table = nullptr;  ///< MethodTable::view
};

/// What of a map its coarser levels have lost, see level_facets.h.
struct MapFacets {
  HeightFieldView texels;                      ///< the map's own, without bounds
  double window = 1;                           ///< width of what is around a point, texels of the level
  Vec2f spread[kMaxLodLevels + 1] = {{1, 1}};  ///< facet_spread by level of the map; only of those that rays meet
};

/// User data of a geometry: what its callbacks need. Must stay where it is while the geometry is in use.
struct DisplacedGeometry {
  DisplacedMeshView mesh;  ///< with the finest level
  DisplacementMethod method = kDefaultMethod;
  bool smooth = false;  ///< shading normals come from the map's filtered gradient
  LodRule lod;
  DisplacementLevel levels[kMaxLodLevels];      ///< the finest first; lod.num_levels of them, and one more of a blend
  int first_level = 0;                          ///< of the map: what levels[0] is
  std::optional<MapFacets> facets;              ///< that coarser levels stand for; empty: there are none
  RmipOptions rmip_options;                     ///< for both of RMIP's
  RTCFilterFunctionN shadow_filter = nullptr;   ///< called for hits of shadow rays; null: all of them are opaque
  const ProceduralField* procedural = nullptr;  ///< heights in place of a map's; there are no levels then
  const PointTiles* tiles = nullptr;            ///< in place of all above but the filter: points that move
  RTCScene scene =
      nullptr;  ///< of this geometry, or of what it is tessellated to, committed; null: no neighbours are known
};

/// A question to one triangle of a geometry: the nearest (or any) hit of a ray.
struct DisplacedQuery {
  Vec3d O, D;  ///< object space
  double t_min = 0, t_max = 0;
  bool any_hit = false;
  LodCone cone = {};  ///< the detail that is asked for
  float texel = 0;    ///< width of a texel of the finest level in the space that `cone` is in
  float time = 0;     ///< 0…1; of no matter to meshes that do not deform
};

/// Traversals compiled for one instruction set.
struct TraversalTable {
  const char* isa;
  /// @param hit  written if the result is true
  bool (*trace)(const DisplacedGeometry& geometry,
                std::uint32_t triangle,
                const DisplacedQuery& query,
                DisplacedHit* hit,
                TraversalCounters* counters);
  RTCIntersectFunctionN intersect;
  RTCOccludedFunctionN occluded;
  RTCIntersectFunctionN intersect_tiles;  ///< of geometries that have them
  RTCOccludedFunctionN occluded_tiles;
};

const TraversalTable& traversal_table_baseline();
const TraversalTable& traversal_table_avx2();

/// What Embree's record of a hit has room for, and the time of its ray.
struct EmbreeHitRecord {
  float u = 0, v = 0, Ng_x = 0;
  float time = 0;
};

/// Where a hit is, as far as Embree's record keeps it.
struct DisplacedPlace {
  float b1 = 0, b2 = 0;  ///< weights of vertices 1 and 2
  int level = 0;
  int edge = -1;       ///< whose wall was hit; −1: the surface
  float fraction = 0;  ///< of a wall: along its edge
  float d = 0;         ///< of a wall: displacement, metres
  float time = 0;      ///< of the ray
};

/// The codec of hits: on the surface u and v are the weights and Ng_x is the level; on a wall u is the fraction, v the
/// displacement and Ng_x = −(1 + 3 · level + edge).
RELIEF_KERNEL EmbreeHitRecord displaced_hit_encode(const DisplacedHit& hit)
{
  if (hit.edge < 0) return {static_cast<float>(hit.b1), static_cast<float>(hit.b2), static_cast<float>(hit.level)};
  // The weight of the vertex that the edge leads to.
  const double fraction = hit.edge == 0 ? hit.b1 : (hit.edge == 1 ? hit.b2 : 1.0 - hit.b1 - hit.b2);
  return {static_cast<float>(fraction), static_cast<float>(hit.d), static_cast<float>(-(1 + 3 * hit.level + hit.edge))};
}

RELIEF_KERNEL DisplacedPlace displaced_hit_decode(EmbreeHitRecord record)
{
  if (record.Ng_x >= 0.0f) {
    return {record.u, record.v, static_cast<int>(record.Ng_x), -1, 0.0f, 0.0f, record.time};
  }
  const int code = static_cast<int>(-record.Ng_x) - 1, edge = code % 3;
  float b[3] = {0.0f, 0.0f, 0.0f};
  b[edge] = 1.0f - record.u;
  b[edge == 2 ? 0 : edge + 1] = record.u;
  return {b[1], b[2], code / 3, edge, record.u, record.v, record.time};
}

/// The point of the surface, or of a wall, in double precision.
SurfacePoint displaced_surface_point(const DisplacedGeometry& geometry,
                                     std::uint32_t triangle,
                                     const DisplacedPlace& place);

/// The point of the surface over a side of a triangle.
/// @param side      from the triangle's vertex `side` to the next
/// @param fraction  along it, 0…1
/// @param time      0…1
Vec3d displaced_edge_point(const DisplacedGeometry& geometry,
                           std::uint32_t triangle,
                           int side,
                           double fraction,
                           int level,
                           float time);

/// The shading normal of a point of the surface from the smoothed map.
Vec3d displaced_smooth_normal(const DisplacedGeometry& geometry, std::uint32_t triangle, const DisplacedPlace& place);

/// A hit on a displaced instance, as shading wants it.
struct DisplacedPoint {
  std::uint32_t triangle = 0;  ///< base triangle
  float u = 0, v = 0;          ///< its barycentric weights of vertices 1 and 2
  float width = kInfinity;     ///< widest cone that meets the surface again as it is here, see lod_width_of_level
  Vec3f P = {}, Ng = {};       ///< on the traced surface, object space; Ng unit, on the side of the displacement normal
  Vec3f Ns = {};               ///< unit shading normal, object space: Ng, or that of the smoothed map
  Vec3f leave = {};            ///< see SurfaceHit::leave; object space
  TriangleLift lift = {};      ///< world; 0: the surface is traced as it is, there is no smoother one
  float level = 0;             ///< of the map; above 0 it stands for facets of finer texels, see level_facets.h
};

/// Completes the nearest hit, once it is known.
///
/// A ray that leaves a crease of the surface has to start further away than rounding asks for, see clearance.h. Triangles
/// beside the point's own are looked up in the geometry's scene.
/// @param placement  the instance's
/// @param texel      width of a texel of the finest level, metres, world
DisplacedPoint displaced_resolve(const DisplacedGeometry& geometry,
                                 const InstanceView& placement,
                                 float texel,
                                 std::uint32_t triangle,
                                 EmbreeHitRecord record);

/// The errors of a point and of a ray's origin there, as its tracer sees them.
struct LeavingErrors {
  Vec3f offset;  ///< of an origin from the point, to the side of the normal; object space
  Vec3d error;   ///< of either, per axis; object space
  Vec3d reach;   ///< half sides of the box that both are in
};

/// @param P, Ng  object space
LeavingErrors leaving_errors(const InstanceView& placement, Vec3f P, Vec3f Ng);

/// Notes the level of a point, and that rays leave it along the normal that it has, whatever facet they come from.
/// @param level  of the map
/// @param point  complete but for that
void displaced_point_set_level(const DisplacedGeometry& geometry,
                               const InstanceView& placement,
                               float level,
                               DisplacedPoint* point);

/// A new geometry, one primitive a base triangle or tile, not committed.
RTCGeometry displaced_geometry_make(RTCDevice device, const DisplacedGeometry& geometry, const TraversalTable& table);

}  // namespace relief
