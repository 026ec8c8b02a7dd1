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
};

/// Traversals compiled for one instruction set.
struct TraversalTable {
  const char* isa;
  /// Nearest (or any) hit of a ray with one triangle, by the geometry's method.
  /// @param texel  width of a texel of the finest level in the space that `cone` is in
  bool (*trace)(const DisplacedGeometry& geometry,
                std::uint32_t triangle,
                Vec3f O,
                Vec3f D,
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

/// A point of the displaced surface, as a level has it.
SurfacePoint displaced_point(const DisplacedGeometry& geometry,
                             std::uint32_t triangle,
                             int level,
                             double b1,
                             double b2);

/// Its shading normal from the smoothed map.
Vec3d displaced_smooth_normal(const DisplacedGeometry& geometry,
                              std::uint32_t triangle,
                              int level,
                              double b1,
                              double b2);

/// A new geometry, one primitive a base triangle, not committed. Hits report the barycentric weights of vertices 1 and 2
/// as u and v, and their level as the x of Ng; position and normal are left to displaced_point, once the nearest is known.
RTCGeometry displaced_geometry_make(RTCDevice device, const DisplacedGeometry& geometry, const TraversalTable& table);

}  // namespace relief
