// Compiled once an instruction set: RELIEF_TRAVERSAL_TABLE names the function that returns the table.
#include "displacement/embree_geometry.h"
#include "displacement/traverse_chord.h"

namespace relief {

namespace {

bool trace(const DisplacedGeometry& geometry,
           std::uint32_t triangle,
           Vec3f O,
           Vec3f D,
           double t_min,
           double t_max,
           bool any_hit,
           DisplacedHit* hit,
           TraversalCounters* counters)
{
  const DisplacedMeshView& mesh = geometry.mesh;
  RayCurve curve;
  if (!ray_curve_make(ray_frame_make(O, D), mesh.triangles[triangle], &curve)) return false;
  ++counters->prisms;
  switch (geometry.method) {
    case TraversalMethod::kRmip:
    case TraversalMethod::kRmipOnMinmax:
    case TraversalMethod::kTfdm:
    case TraversalMethod::kChord:
      break;
  }
  return traverse_chord(mesh, triangle, curve, t_min, t_max, any_hit, hit, counters);
}

/// Where queries that bring no counters count.
thread_local TraversalCounters uncounted;

TraversalCounters* counters_of(void* context)
{
  TraversalCounters* counters = static_cast<const EmbreeContext*>(context)->displacement;
  return counters != nullptr ? counters : &uncounted;
}

void intersect(const RTCIntersectFunctionNArguments* arguments)
{
  const auto& geometry = *static_cast<const DisplacedGeometry*>(arguments->geometryUserPtr);
  TraversalCounters* counters = counters_of(arguments->context);
  const unsigned count = arguments->N, triangle = arguments->primID;
  RTCRayN* rays = RTCRayHitN_RayN(arguments->rayhit, count);
  RTCHitN* hits = RTCRayHitN_HitN(arguments->rayhit, count);
  for (unsigned k = 0; k < count; ++k) {
    if (arguments->valid[k] != -1) continue;
    const Vec3f O{RTCRayN_org_x(rays, count, k), RTCRayN_org_y(rays, count, k), RTCRayN_org_z(rays, count, k)};
    const Vec3f D{RTCRayN_dir_x(rays, count, k), RTCRayN_dir_y(rays, count, k), RTCRayN_dir_z(rays, count, k)};
    DisplacedHit hit;
    if (!trace(geometry, triangle, O, D, RTCRayN_tnear(rays, count, k), RTCRayN_tfar(rays, count, k), false, &hit,
               counters)) {
      continue;
    }
    RTCRayN_tfar(rays, count, k) = static_cast<float>(hit.t);
    RTCHitN_u(hits, count, k) = static_cast<float>(hit.b1);
    RTCHitN_v(hits, count, k) = static_cast<float>(hit.b2);
    RTCHitN_primID(hits, count, k) = triangle;
    RTCHitN_geomID(hits, count, k) = arguments->geomID;
    RTCHitN_instID(hits, count, k, 0) = arguments->context->instID[0];
  }
}

/// Whether the filter lets a shadow ray pass this hit.
bool passes(const DisplacedGeometry& geometry,
            const RTCOccludedFunctionNArguments* arguments,
            unsigned lane,
            const DisplacedHit& hit)
{
  const unsigned count = arguments->N;
  RTCHit rtc_hit;
  rtc_hit.Ng_x = rtc_hit.Ng_y = rtc_hit.Ng_z = 0.0f;
  rtc_hit.u = static_cast<float>(hit.b1);
  rtc_hit.v = static_cast<float>(hit.b2);
  rtc_hit.primID = arguments->primID;
  rtc_hit.geomID = arguments->geomID;
  rtc_hit.instID[0] = arguments->context->instID[0];
  RTCRay ray = rtcGetRayFromRayN(arguments->ray, count, lane);
  ray.tfar = static_cast<float>(hit.t);
  int valid = -1;
  RTCFilterFunctionNArguments filter;
  filter.valid = &valid;
  filter.geometryUserPtr = arguments->geometryUserPtr;
  filter.context = arguments->context;
  filter.ray = reinterpret_cast<RTCRayN*>(&ray);
  filter.hit = reinterpret_cast<RTCHitN*>(&rtc_hit);
  filter.N = 1;
  geometry.shadow_filter(&filter);
  return valid == 0;
}

void occluded(const RTCOccludedFunctionNArguments* arguments)
{
  const auto& geometry = *static_cast<const DisplacedGeometry*>(arguments->geometryUserPtr);
  TraversalCounters* counters = counters_of(arguments->context);
  const unsigned count = arguments->N, triangle = arguments->primID;
  RTCRayN* rays = arguments->ray;
  const bool opaque = geometry.shadow_filter == nullptr;
  for (unsigned k = 0; k < count; ++k) {
    if (arguments->valid[k] != -1) continue;
    const Vec3f O{RTCRayN_org_x(rays, count, k), RTCRayN_org_y(rays, count, k), RTCRayN_org_z(rays, count, k)};
    const Vec3f D{RTCRayN_dir_x(rays, count, k), RTCRayN_dir_y(rays, count, k), RTCRayN_dir_z(rays, count, k)};
    const double t_max = RTCRayN_tfar(rays, count, k);
    double t_min = RTCRayN_tnear(rays, count, k);
    DisplacedHit hit;
    // A surface that lets light through is met hit by hit, from the front.
    while (trace(geometry, triangle, O, D, t_min, t_max, opaque, &hit, counters)) {
      if (opaque || !passes(geometry, arguments, k, hit)) {
        RTCRayN_tfar(rays, count, k) = -kInfinity;
        break;
      }
      t_min = hit.t;
    }
  }
}

}  // namespace

const TraversalTable& RELIEF_TRAVERSAL_TABLE()
{
  static constexpr TraversalTable table{RELIEF_ISA_NAME, trace, intersect, occluded};
  return table;
}

}  // namespace relief
