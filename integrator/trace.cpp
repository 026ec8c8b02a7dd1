#include "integrator/trace.h"

#include "kernel/shape/surface_hit.h"

namespace relief {

std::vector<TraceHit> trace_rays(const SceneContext& context, std::span<const TraceRay> rays)
{
  std::vector<TraceHit> hits;
  hits.reserve(rays.size());
  EmbreeContext embree;
  embree_context_init(embree, false);
  for (const TraceRay& ray : rays) {
    float t_min = ray.t_min;
    TraceHit result;
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
      SurfaceHit surface = surface_hit_make(context.meshes[static_cast<std::size_t>(instance.mesh_index)], instance,
                                            query.hit.primID, query.hit.u, query.hit.v);
      if ((instance.flags & kDisplaced) != 0) {
        const SurfacePoint point = context.displacements.point(object, query.hit.primID, query.hit.u, query.hit.v);
        surface_hit_displace(&surface, instance, to_float(point.P), to_float(point.Ng));
      }
      result = {true,
                query.ray.tfar,
                surface.P,
                surface.Ng,
                query.hit.u,
                query.hit.v,
                static_cast<std::int32_t>(object),
                instance.mesh_index,
                query.hit.primID};
      break;
    }
    hits.push_back(result);
  }
  return hits;
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
  Wavefront wavefront;
  wavefront.recorder = &rays;
  wavefront.run(g, *context.accel, stage_table_select(), context.surface_kernel, {0, 0, 1, 1, sample_index, 1});
  return rays;
}

}  // namespace relief
