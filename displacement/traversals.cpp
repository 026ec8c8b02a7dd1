// Compiled once an instruction set: RELIEF_TRAVERSAL_TABLE names the function that returns the table.
#include "displacement/embree_geometry.h"
#include "displacement/explain.h"
#include "displacement/traverse_chord.h"
#include "displacement/traverse_rmip.h"
#include "displacement/traverse_tfdm.h"
#include "kernel/math/rounding.h"

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
  const RayFrame frame = ray_frame_make(O, D);
  RayCurve curve;
  if (!ray_curve_make(frame, mesh.triangles[triangle], &curve)) return false;
  ++counters->prisms;
  switch (geometry.method) {
    case TraversalMethod::kRmip:
      return traverse_rmip(mesh, triangle, frame, curve, *geometry.rmip, geometry.rmip_options, t_min, t_max, any_hit,
                           hit, counters);
    case TraversalMethod::kRmipOnMinmax:
      return traverse_rmip(mesh, triangle, frame, curve, *geometry.mipmap, geometry.rmip_options, t_min, t_max, any_hit,
                           hit, counters);
    case TraversalMethod::kTfdm:
      return traverse_tfdm(mesh, triangle, frame, curve, *geometry.mipmap, t_min, t_max, any_hit, hit, counters);
    case TraversalMethod::kChord:
      break;
  }
  return traverse_chord(mesh, triangle, curve, t_min, t_max, any_hit, hit, counters);
}

/// Where queries that bring no counters count.
thread_local TraversalCounters uncounted;

/// One ray of a callback, in the geometry's space.
struct CallbackRay {
  unsigned id, instance, triangle;
  Vec3f O, D;
};

CallbackRay callback_ray(RTCRayN* rays, unsigned count, unsigned lane, unsigned triangle, unsigned instance)
{
  return {RTCRayN_id(rays, count, lane),
          instance,
          triangle,
          {RTCRayN_org_x(rays, count, lane), RTCRayN_org_y(rays, count, lane), RTCRayN_org_z(rays, count, lane)},
          {RTCRayN_dir_x(rays, count, lane), RTCRayN_dir_y(rays, count, lane), RTCRayN_dir_z(rays, count, lane)}};
}

/// Traces one ray and tells those who asked what it did.
bool trace_observed(const DisplacedGeometry& geometry,
                    const EmbreeContext& context,
                    const CallbackRay& ray,
                    double t_min,
                    double t_max,
                    bool any_hit,
                    DisplacedHit* hit)
{
  TraversalCounters& counters = context.displacement != nullptr ? *context.displacement : uncounted;
  const TraversalCounters before = counters;
  const bool found = trace(geometry, ray.triangle, ray.O, ray.D, t_min, t_max, any_hit, hit, &counters);
  if (context.steps == nullptr && context.visits == nullptr) return found;
  const TraversalCounters spent{counters.bounds - before.bounds, counters.texels - before.texels,
                                counters.inversions - before.inversions, counters.prisms - before.prisms};
  if (context.steps != nullptr) context.steps[ray.id] += static_cast<std::uint32_t>(spent.bounds + spent.texels);
  if (context.visits != nullptr) {
    prism_visits_add(*context.visits, {&geometry, ray.instance, ray.triangle, ray.O, ray.D, t_min, t_max, spent, found,
                                       found ? *hit : DisplacedHit{}});
  }
  return found;
}

void intersect(const RTCIntersectFunctionNArguments* arguments)
{
  const auto& geometry = *static_cast<const DisplacedGeometry*>(arguments->geometryUserPtr);
  const auto& context = *reinterpret_cast<const EmbreeContext*>(arguments->context);
  const unsigned count = arguments->N, triangle = arguments->primID;
  RTCRayN* rays = RTCRayHitN_RayN(arguments->rayhit, count);
  RTCHitN* hits = RTCRayHitN_HitN(arguments->rayhit, count);
  for (unsigned k = 0; k < count; ++k) {
    if (arguments->valid[k] != -1) continue;
    const CallbackRay ray = callback_ray(rays, count, k, triangle, arguments->context->instID[0]);
    DisplacedHit hit;
    if (!trace_observed(geometry, context, ray, RTCRayN_tnear(rays, count, k), RTCRayN_tfar(rays, count, k), false,
                        &hit)) {
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
  const auto& context = *reinterpret_cast<const EmbreeContext*>(arguments->context);
  const unsigned count = arguments->N, triangle = arguments->primID;
  RTCRayN* rays = arguments->ray;
  const bool opaque = geometry.shadow_filter == nullptr;
  for (unsigned k = 0; k < count; ++k) {
    if (arguments->valid[k] != -1) continue;
    const CallbackRay ray = callback_ray(rays, count, k, triangle, arguments->context->instID[0]);
    const double t_max = RTCRayN_tfar(rays, count, k);
    double t_min = RTCRayN_tnear(rays, count, k);
    DisplacedHit hit;
    // A surface that lets light through is met hit by hit, from the front.
    while (trace_observed(geometry, context, ray, t_min, t_max, opaque, &hit)) {
      if (opaque || !passes(geometry, arguments, k, hit)) {
        RTCRayN_tfar(rays, count, k) = -kInfinity;
        break;
      }
      // As far as a path moves on past a surface: the next search rounds the same hit to another last bit.
      t_min = next_float_up(static_cast<float>(hit.t));
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
