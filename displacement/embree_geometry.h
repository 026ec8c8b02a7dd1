// Displaced meshes as Embree user geometry: bounds, and the callbacks that unpack a ray, call a traversal and pack its
// hit. The callbacks are compiled once an instruction set, like the integrator's stages.
#pragma once

#include "displacement/displaced_mesh.h"
#include "displacement/embree.h"
#include "displacement/leaf.h"
#include "displacement/level_of_detail.h"
#include "displacement/method.h"
#include "displacement/minmax_mipmap.h"
#include "displacement/rmip.h"

namespace relief {

/// A level of a height map, and what methods need besides.
struct DisplacementLevel {
  const HeightFieldView* field = nullptr;
  const RmipView* rmip = nullptr;            ///< for kRmip
  const MinmaxMipmapView* mipmap = nullptr;  ///< for kRmipOnMinmax and kTfdm
};

/// User data of a geometry: what its callbacks need. Must stay where it is while the geometry is in use.
struct DisplacedGeometry {
  DisplacedMeshView mesh;  ///< with the finest level
  TraversalMethod method = TraversalMethod::kChord;
  LodRule lod;
  DisplacementLevel levels[kMaxLodLevels];     ///< the finest first; lod.num_levels of them
  RmipOptions rmip_options;                    ///< for both of RMIP's
  RTCFilterFunctionN shadow_filter = nullptr;  ///< called for hits of shadow rays; null: all of them are opaque
  RTCScene scene = nullptr;                    ///< of this geometry alone, committed; null: see displaced_leave
};

/// Traversals compiled for one instruction set.
struct TraversalTable {
  const char* isa;
  /// Nearest (or any) hit of a ray with one triangle, by the geometry's method.
  /// @param texel  width of a texel of the finest level in the space that `cone` is in
  bool (*trace)(const DisplacedGeometry& geometry,
                std::uint32_t triangle,
                Vec3d O,
                Vec3d D,
                const LodCone& cone,
                float texel,
                double t_min,
                double t_max,
                bool any_hit,
                DisplacedHit* hit,
                TraversalCounters* counters);
  RTCIntersectFunctionN intersect;
  RTCOccludedFunctionN occluded;
};

const TraversalTable& traversal_table_baseline();
const TraversalTable& traversal_table_avx2();

/// What Embree's record keeps of a hit. On the surface u and v are the weights of vertices 1 and 2 and Ng_x the level; on
/// the wall of a seam u is the place along its edge, v the displacement and Ng_x = −(1 + 3 · level + edge).
struct ReportedHit {
  float u = 0, v = 0, Ng_x = 0;
};

RELIEF_KERNEL ReportedHit displaced_hit_report(const DisplacedHit& hit)
{
  if (hit.edge < 0) return {static_cast<float>(hit.b1), static_cast<float>(hit.b2), static_cast<float>(hit.level)};
  // The weight of the vertex that the edge leads to.
  const double fraction = hit.edge == 0 ? hit.b1 : (hit.edge == 1 ? hit.b2 : 1.0 - hit.b1 - hit.b2);
  return {static_cast<float>(fraction), static_cast<float>(hit.d), static_cast<float>(-(1 + 3 * hit.level + hit.edge))};
}

/// The point of a hit, and where it is in its triangle.
struct ReportedPoint {
  float b1 = 0, b2 = 0;  ///< weights of vertices 1 and 2
  int level = 0;
  bool on_wall = false;
  SurfacePoint point;
};

/// @param hit  as Embree has it
ReportedPoint displaced_point(const DisplacedGeometry& geometry, std::uint32_t triangle, ReportedHit hit);

/// The shading normal of a point of the surface from the smoothed map.
Vec3d displaced_smooth_normal(const DisplacedGeometry& geometry,
                              std::uint32_t triangle,
                              int level,
                              double b1,
                              double b2);

/// How far a ray's origin has to be moved to leave a point of the surface where it has a crease, see clearance.h. Triangles
/// beside the point's own are looked up in the geometry's scene; without one there are none.
/// @param reach  half sides of the box of errors, object space, metres
/// @return       to the side of N, object space; zero: it can leave along the normal
Vec3d displaced_leave(const DisplacedGeometry& geometry,
                      std::uint32_t triangle,
                      int level,
                      double b1,
                      double b2,
                      Vec3d reach);

/// A new geometry, one primitive a base triangle, not committed. Hits are reported as in ReportedHit; position and normal
/// are left to displaced_point, once the nearest is known.
RTCGeometry displaced_geometry_make(RTCDevice device, const DisplacedGeometry& geometry, const TraversalTable& table);

}  // namespace relief
