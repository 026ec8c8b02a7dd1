// Displaced meshes as Embree user geometry: bounds, and the callbacks that unpack a ray, call a traversal and pack its
// hit. The callbacks are compiled once an instruction set, like the integrator's stages.
#pragma once

#include "displacement/displaced_mesh.h"
#include "displacement/embree.h"
#include "displacement/leaf.h"
#include "displacement/method.h"
#include "displacement/minmax_mipmap.h"
#include "displacement/rmip.h"

namespace relief {

/// User data of a geometry: what its callbacks need. Must stay where it is while the geometry is in use.
struct DisplacedGeometry {
  DisplacedMeshView mesh;
  TraversalMethod method = TraversalMethod::kChord;
  const RmipView* rmip = nullptr;              ///< for kRmip
  const MinmaxMipmapView* mipmap = nullptr;    ///< for kRmipOnMinmax and kTfdm
  RmipOptions rmip_options;                    ///< for both of RMIP's
  RTCFilterFunctionN shadow_filter = nullptr;  ///< called for hits of shadow rays; null: all of them are opaque
};

/// Traversals compiled for one instruction set.
struct TraversalTable {
  const char* isa;
  /// Nearest (or any) hit of a ray with one triangle, by the geometry's method.
  bool (*trace)(const DisplacedGeometry& geometry,
                std::uint32_t triangle,
                Vec3f O,
                Vec3f D,
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

/// A new geometry, one primitive a base triangle, not committed. Hits report the barycentric weights of vertices 1 and 2
/// as u and v; position and normal are left to surface_point, once the nearest hit is known.
RTCGeometry displaced_geometry_make(RTCDevice device, const DisplacedGeometry& geometry, const TraversalTable& table);

}  // namespace relief
