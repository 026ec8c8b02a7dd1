// Compiled once an instruction set, RELIEF_ISA, as the methods are: RELIEF_TRAVERSAL_TABLE names the function that returns the
// table.
#include "displacement/deformation.h"
#include "displacement/embree_geometry.h"
#include "displacement/explain.h"
#include "displacement/method.h"
#include "displacement/point_tiles.h"
#include "displacement/seam_walls.h"
#include "displacement/shadow_filter.h"
#include "displacement/trace_procedural.h"
#include "kernel/math/rounding.h"

namespace relief {

namespace {

constexpr const DisplacementMethodEntry* kMethods[] = {
    nullptr,  // kAuto: chosen before
#define X(name, label) &RELIEF_ISA::name##_method,
#include "kernel/shape/displacement_methods.inc"
#undef X
};

/// A query to one triangle, with the ray's curve in it.
struct CurveQuery {
  const DisplacedGeometry& geometry;
  const DisplacedMeshView& mesh;  ///< the geometry's, at the ray's time
  std::uint32_t triangle;         ///< of that
  const RayCurve& curve;
  const DisplacedQuery& ray;
  TraversalCounters& counters;
};

/// Nearest (or any) hit on one level.
/// @param mesh      has that level
/// @param triangle  of the mesh
bool trace_level(const CurveQuery& q,
                 const DisplacedMeshView& mesh,
                 std::uint32_t triangle,
                 int level,
                 double t_min,
                 double t_max,
                 DisplacedHit* hit)
{
  const DisplacedGeometry& g = q.geometry;
  return kMethods[static_cast<int>(g.method)]->traverse(
      {mesh, triangle, q.curve, t_min, t_max, q.ray.any_hit, g.rmip_options, q.counters}, g.levels[level].table, hit);
}

/// A mesh of one triangle: a query's, on one of its geometry's levels.
struct TriangleOnLevel {
  DisplacedTriangle tri;
  DisplacedMeshView mesh;

  TriangleOnLevel(const CurveQuery& q, int level)
      : tri(triangle_on_level(q.mesh.triangles[q.triangle], *q.mesh.field, *q.geometry.levels[level].field)),
        mesh{&tri, q.mesh.unfolded + q.triangle, 1, q.geometry.levels[level].field, q.mesh.scale, q.mesh.midlevel}
  {
  }
  // The mesh points to the triangle.
  TriangleOnLevel(const TriangleOnLevel&) = delete;
  TriangleOnLevel& operator=(const TriangleOnLevel&) = delete;
};

/// Where a ray passes from one level to the next, it may be above the one's surface and below the other's: it meets the
/// wall in between, there.
/// @param t  of the change
bool level_wall_intersect(const TriangleOnLevel& fine,
                          const TriangleOnLevel& coarse,
                          const RayCurve& curve,
                          double t,
                          DisplacedHit* hit)
{
  for (int k = 0; k < curve.num_segments; ++k) {
    const CurveSegment& g = curve.segments[k];
    if (t < g.t0 || t > g.t1) continue;
    const CurvePoint p = curve_point(fine.tri, g, curve_tau(curve, g, t));
    const CurvePoint q = curve_point(coarse.tri, g, p.tau);
    const double height = p.s * p.nu;
    if ((height < displacement_at(fine.mesh, p.x, p.y)) == (height < displacement_at(coarse.mesh, q.x, q.y))) continue;
    *hit = {t,
            p.b1,
            p.b2,
            static_cast<std::int64_t>(__builtin_floor(q.x)),
            static_cast<std::int64_t>(__builtin_floor(q.y)),
            p.tau};
    return true;
  }
  return false;
}

/// The levels that a ray sees of one triangle, one after the other.
bool trace_levels(const CurveQuery& q, DisplacedHit* hit)
{
  const auto& [geometry, mesh, triangle, curve, ray, counters] = q;
  double begin = __builtin_huge_val(), end = -__builtin_huge_val();
  for (int k = 0; k < curve.num_segments; ++k) {
    begin = min(begin, curve.segments[k].t0);
    end = max(end, curve.segments[k].t1);
  }
  begin = max(begin, ray.t_min);
  end = min(end, ray.t_max);
  // Where displacement lines cross, t does not grow along the curve: such a triangle has one level.
  const bool folded = mesh.unfolded[triangle] == 0;
  const auto level_end = [&](int level) {
    return folded ? __builtin_huge_val() : lod_level_end(q.geometry.lod, q.ray.cone, q.ray.texel, level, begin);
  };
  int level = lod_level(geometry.lod, ray.cone, ray.texel, begin);
  double change = level_end(level);
  if (level == 0 && !(change < end))  // mostly, where detail is wanted
    return trace_level(q, mesh, triangle, 0, ray.t_min, ray.t_max, hit);
  double from = ray.t_min;
  while (true) {
    const TriangleOnLevel fine(q, level);
    if (trace_level(q, fine.mesh, 0, level, from, min(change, ray.t_max), hit)) {
      hit->level = level;
      return true;
    }
    if (!(change < end)) return false;
    const TriangleOnLevel coarse(q, level + 1);
    if (change > ray.t_min && level_wall_intersect(fine, coarse, curve, change, hit)) {
      hit->level = level + 1;
      return true;
    }
    ++level;
    from = begin = change;
    change = level_end(level);
  }
}

/// Nearest hit of a ray's curve with the walls along a triangle's seams, each at the level that is seen there.
/// @param t_max  of the ray, or of what it has hit
bool seam_walls_intersect(const CurveQuery& q, double t_max, DisplacedHit* hit)
{
  const auto& [geometry, mesh, triangle, curve, ray, counters] = q;
  // As in trace_levels.
  const bool folded = mesh.unfolded[triangle] == 0;
  const double begin = max(curve.segments[0].t0, ray.t_min);
  bool found = false;
  for (int k = 0; k < curve.num_segments; ++k) {
    const CurveSegment& g = curve.segments[k];
    for (int end = 0; end < 2; ++end) {
      const double t = end == 0 ? g.t0 : g.t1;
      const int level =
          geometry.lod.num_levels > 1 ? lod_level(geometry.lod, ray.cone, ray.texel, folded ? begin : t) : 0;
      const SeamLevel seam_level{mesh.field, geometry.levels[level].field};
      for (int edge = 0; edge < 3; ++edge) {
        if ((mesh.seam_edges[triangle] >> edge & 1) == 0) continue;
        DisplacedHit candidate;
        if (!seam_wall_intersect(mesh, triangle, curve, g, end, edge, seam_level, &candidate)) continue;
        if (!(candidate.t > ray.t_min && candidate.t < t_max)) continue;
        *hit = candidate;
        hit->level = level;
        t_max = hit->t;
        found = true;
      }
    }
  }
  return found;
}

/// @param mesh      the geometry's, at the ray's time
/// @param triangle  of that
bool trace_triangle(const DisplacedGeometry& geometry,
                    const DisplacedMeshView& mesh,
                    std::uint32_t triangle,
                    const DisplacedQuery& ray,
                    DisplacedHit* hit,
                    TraversalCounters* counters)
{
  if (traversal_stop(*counters)) return false;
  RayCurve curve;
  if (!ray_curve_make(ray_frame_make(ray.O, ray.D), mesh.triangles[triangle], &curve)) return false;
  ++counters->prisms;
  const CurveQuery q{geometry, mesh, triangle, curve, ray, *counters};
  if (geometry.procedural != nullptr) {
    return trace_procedural(
        {mesh, triangle, curve, ray.t_min, ray.t_max, ray.any_hit, geometry.rmip_options, *counters},
        *geometry.procedural, kMethods[static_cast<int>(geometry.method)]->traverse, hit);
  }
  const bool found =
      geometry.lod.num_levels > 1 ? trace_levels(q, hit) : trace_level(q, mesh, triangle, 0, ray.t_min, ray.t_max, hit);
  if (mesh.seam_edges == nullptr || mesh.seam_edges[triangle] == 0 || (found && ray.any_hit)) return found;
  return seam_walls_intersect(q, found ? hit->t : ray.t_max, hit) || found;
}

[[gnu::noinline]] bool trace_deforming(const DisplacedGeometry& geometry,
                                       std::uint32_t triangle,
                                       const DisplacedQuery& ray,
                                       DisplacedHit* hit,
                                       TraversalCounters* counters)
{
  const TriangleAtTime at(geometry.mesh, triangle, ray.time);
  return trace_triangle(geometry, at.mesh, 0, ray, hit, counters);
}

bool trace(const DisplacedGeometry& geometry,
           std::uint32_t triangle,
           const DisplacedQuery& ray,
           DisplacedHit* hit,
           TraversalCounters* counters)
{
  if (geometry.mesh.deformation != nullptr) [[unlikely]]
    return trace_deforming(geometry, triangle, ray, hit, counters);
  return trace_triangle(geometry, geometry.mesh, triangle, ray, hit, counters);
}

/// Where queries that bring no counters count.
thread_local TraversalCounters uncounted;

/// One ray of a callback, in the geometry's space.
struct CallbackRay {
  unsigned id, instance, triangle;
  float time;
  ObjectRay ray;
};

CallbackRay callback_ray(RTCRayN* rays, unsigned count, unsigned lane, unsigned triangle, const EmbreeContext& context)
{
  CallbackRay out{RTCRayN_id(rays, count, lane), context.rtc.instID[0], triangle, RTCRayN_time(rays, count, lane), {}};
  if (context.object_ray != nullptr) {
    out.ray = *context.object_ray;
  } else {
    out.ray.O = {RTCRayN_org_x(rays, count, lane), RTCRayN_org_y(rays, count, lane), RTCRayN_org_z(rays, count, lane)};
    out.ray.D = {RTCRayN_dir_x(rays, count, lane), RTCRayN_dir_y(rays, count, lane), RTCRayN_dir_z(rays, count, lane)};
  }
  return out;
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
  DisplacedQuery query{ray.ray.O, ray.ray.D, t_min, t_max, any_hit};
  query.time = ray.time;
  if (context.cones != nullptr) query.cone = context.cones[ray.id];
  query.cone.width += query.cone.spread * static_cast<float>(ray.ray.t_start);
  query.cone.spread *= static_cast<float>(ray.ray.t_scale);
  query.texel = context.texels != nullptr ? context.texels[ray.instance] : geometry.lod.texel;
  const bool found = trace(geometry, ray.triangle, query, hit, &counters);
  if (context.steps == nullptr && context.visits == nullptr) return found;
  const TraversalCounters spent{counters.bounds - before.bounds,
                                counters.texels - before.texels,
                                counters.inversions - before.inversions,
                                counters.prisms - before.prisms,
                                nullptr,
                                false};
  if (context.steps != nullptr) context.steps[ray.id] += static_cast<std::uint32_t>(spent.bounds + spent.texels);
  if (context.visits != nullptr) {
    prism_visits_add(*context.visits, {&geometry, ray.instance, ray.triangle, ray.time, ray.ray, t_min, t_max, spent,
                                       found, found ? *hit : DisplacedHit{}});
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
    const CallbackRay ray = callback_ray(rays, count, k, triangle, context);
    DisplacedHit hit;
    if (!trace_observed(geometry, context, ray, RTCRayN_tnear(rays, count, k), RTCRayN_tfar(rays, count, k), false,
                        &hit)) {
      continue;
    }
    RTCRayN_tfar(rays, count, k) = static_cast<float>(hit.t);
    const EmbreeHitRecord record = displaced_hit_encode(hit);
    RTCHitN_u(hits, count, k) = record.u;
    RTCHitN_v(hits, count, k) = record.v;
    RTCHitN_Ng_x(hits, count, k) = record.Ng_x;
    RTCHitN_primID(hits, count, k) = triangle;
    RTCHitN_geomID(hits, count, k) = arguments->geomID;
    RTCHitN_instID(hits, count, k, 0) = arguments->context->instID[0];
  }
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
    const CallbackRay ray = callback_ray(rays, count, k, triangle, context);
    const double t_max = RTCRayN_tfar(rays, count, k);
    double t_min = RTCRayN_tnear(rays, count, k);
    DisplacedHit hit;
    // A surface that lets light through is met hit by hit, from the front.
    while (trace_observed(geometry, context, ray, t_min, t_max, opaque, &hit)) {
      if (opaque || !shadow_filter_passes(geometry.shadow_filter, arguments, k, displaced_hit_encode(hit), hit.t)) {
        RTCRayN_tfar(rays, count, k) = -kInfinity;
        break;
      }
      // As far as a path moves on past a surface: the next search rounds the same hit to another last bit.
      t_min = t_min_behind(static_cast<float>(hit.t));
    }
  }
}

}  // namespace

const TraversalTable& RELIEF_TRAVERSAL_TABLE()
{
  static constexpr TraversalTable table{
      RELIEF_ISA_NAME, trace, intersect, occluded, RELIEF_ISA::tiles_intersect, RELIEF_ISA::tiles_occluded};
  return table;
}

}  // namespace relief
