#include "integrator/trace.h"

#include "kernel/shape/surface_hit.h"

namespace relief {

namespace {

/// @param visits  may be null
TraceHit trace_ray(const SceneContext& context, const TraceRay& ray, PrismVisits* visits)
{
  EmbreeContext embree;
  embree_context_init(embree, false);
  TraversalCounters counters;
  embree.displacement = &counters;
  embree.visits = visits;
  TraceHit result;
  float t_min = ray.t_min;
  while (true) {
    RTCRayHit query;
    query.ray.org_x = ray.O.x;
    query.ray.org_y = ray.O.y;
    query.ray.org_z = ray.O.z;
    query.ray.dir_x = ray.D.x;
    query.ray.dir_y = ray.D.y;
    query.ray.dir_z = ray.D.z;
    query.ray.tnear = t_min;
    query.ray.tfar = ray.t_max;
    query.ray.time = 0.0f;
    query.ray.mask = kRayBounce;
    query.ray.id = 0;
    query.ray.flags = 0;
    query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    embree_intersect1(context.accel->scene(), embree, query);
    if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) break;
    const unsigned object = query.hit.instID[0] != RTC_INVALID_GEOMETRY_ID ? query.hit.instID[0] : query.hit.geomID;
    if (object >= context.globals.num_instances) {
      t_min = next_float_up(query.ray.tfar);
      continue;
    }
    const InstanceView& instance = context.instances[object];
    DisplacedPoint point{query.hit.primID, query.hit.u, query.hit.v};
    const bool displaced = (instance.flags & kDisplaced) != 0;
    if (displaced)
      point = context.displacements.point(object, instance, point.triangle, point.u, point.v, query.hit.Ng_x);
    SurfaceHit surface = surface_hit_make(context.meshes[static_cast<std::size_t>(instance.mesh_index)], instance,
                                          point.triangle, point.u, point.v);
    if (displaced) surface_hit_displace(&surface, instance, point.P, point.Ng, point.Ns, point.leave);
    result.hit = true;
    result.t = query.ray.tfar;
    result.P = surface.P;
    result.Ng = surface.Ng;
    result.O_front = surface_hit_origin(surface, surface.P, true);
    result.O_back = surface_hit_origin(surface, surface.P, false);
    result.u = point.u;
    result.v = point.v;
    result.instance_index = static_cast<std::int32_t>(object);
    result.mesh_index = instance.mesh_index;
    result.triangle_index = point.triangle;
    break;
  }
  if (counters.prisms > 0) result.steps = counters.bounds + counters.texels;
  return result;
}

}  // namespace

std::vector<TraceHit> trace_rays(const SceneContext& context, std::span<const TraceRay> rays)
{
  std::vector<TraceHit> hits;
  hits.reserve(rays.size());
  for (const TraceRay& ray : rays) hits.push_back(trace_ray(context, ray, nullptr));
  return hits;
}

TraceExplanation trace_explain(const SceneContext& context, const TraceRay& ray)
{
  TraceExplanation out;
  PrismVisits visits;
  out.hit = trace_ray(context, ray, &visits);
  // The first time told how many there are; the same ray visits the same ones.
  out.visits.resize(visits.size);
  visits = {out.visits.data(), out.visits.size(), 0};
  trace_ray(context, ray, &visits);
  return out;
}

std::vector<RecordedRay> trace_path(const SceneContext& context,
                                    const RenderOptions& options,
                                    int x,
                                    int y,
                                    std::uint32_t sample_index)
{
  std::vector<RecordedRay> rays;
  Film film(1, 1, options.aov_mask);
  FilterTable filter;
  blackman_harris_table_make(filter);
  KernelGlobals g = render_globals(context, options, filter);
  g.crop_x = x;
  g.crop_y = y;
  g.film = film.accumulator();
  Wavefront wavefront(false);
  wavefront.recorder = &rays;
  wavefront.run(g, *context.accel, stage_table_select(), context.surface_kernel, {0, 0, 1, 1, sample_index, 1});
  return rays;
}

}  // namespace relief
