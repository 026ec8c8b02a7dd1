#include "integrator/trace.h"

#include <cmath>
#include <optional>

#include <tbb/enumerable_thread_specific.h>

#include "integrator/flush_denormals.h"
#include "integrator/media.h"
#include "integrator/photon_benefit.h"
#include "integrator/photon_pass.h"
#include "integrator/ray_surface.h"
#include "integrator/scene_context.h"
#include "integrator/stages.h"

namespace relief {

namespace {

/// Single rays see what moves as it is when the shutter is half done.
constexpr float kTraceTime = 0.5f;

/// Directions of any length are traced as long as Embree takes them: divided by two to this power.
int direction_exponent(const TraceRay& ray) { return std::ilogb(max_component(abs(ray.D))); }

/// @param visits  may be null
TraceHit trace_ray(const SceneContext& context, const TraceRay& ray, PrismVisits* visits)
{
  EmbreeContext embree;
  embree_context_init(embree, false);
  TraversalCounters counters;
  embree.displacement = &counters;
  embree.visits = visits;
  TraceHit result;
  const int exponent = direction_exponent(ray);
  const auto scaled = [exponent](float v, int by) { return std::ldexp(v, by * exponent); };
  const Vec3f D{scaled(ray.D.x, -1), scaled(ray.D.y, -1), scaled(ray.D.z, -1)};
  const float t_max = scaled(ray.t_max, 1);
  float t_min = scaled(ray.t_min, 1);
  while (true) {
    RTCRayHit query;
    query.ray.org_x = ray.O.x;
    query.ray.org_y = ray.O.y;
    query.ray.org_z = ray.O.z;
    query.ray.dir_x = D.x;
    query.ray.dir_y = D.y;
    query.ray.dir_z = D.z;
    query.ray.tnear = t_min;
    query.ray.tfar = t_max;
    query.ray.time = kTraceTime;
    query.ray.mask = kRayBounce;
    query.ray.id = 0;
    query.ray.flags = 0;
    query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    context.accel->intersect(embree, query);
    if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) break;
    const unsigned object = met_object(query);
    if (object >= context.globals.num_instances) {
      t_min = t_min_behind(query.ray.tfar);
      continue;
    }
    const InstanceView instance = context.motion.instance_at(context.instances[object], kTraceTime);
    DisplacedPoint point{query.hit.primID, query.hit.u, query.hit.v};
    const bool displaced = (instance.flags & kDisplaced) != 0;
    if (displaced) {
      point = context.displacements.resolve(object, instance, point.triangle,
                                            {query.hit.u, query.hit.v, query.hit.Ng_x, kTraceTime});
    }
    const MeshView mesh =
        context.motion.mesh_at(instance, context.meshes[static_cast<std::size_t>(instance.mesh_index)], kTraceTime);
    const SurfaceHit surface = displaced ? surface_hit_displaced(mesh, instance, point.triangle, point.u, point.v,
                                                                 {point.P, point.Ng, point.Ns, point.leave, point.lift})
                                         : surface_hit_of_ray(mesh, instance, query);
    result.hit = true;
    result.t = scaled(query.ray.tfar, -1);
    result.P = surface.P;
    result.Ng = surface.Ng;
    result.O_front = surface_hit_origin(surface, surface.P, true);
    result.O_back = surface_hit_origin(surface, surface.P, false);
    result.u = point.u;
    result.v = point.v;
    result.instance_index = static_cast<std::int32_t>(object);
    const int mesh_index = context.scene.instances[object].mesh_index;
    const int copy_of = context.scene.meshes[static_cast<std::size_t>(mesh_index)].copy_of;
    result.mesh_index = copy_of >= 0 ? copy_of : mesh_index;
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
  out.t_unit = std::ldexp(1.0, -direction_exponent(ray));
  return out;
}

PathReplay trace_path(const Scene& scene, const RenderOptions& options, const PixelSample& at)
{
  const SceneContext context = render_context(scene, options);
  const StageTable& stages = stage_table_select();
  const FilmWindow window = render_window(options);
  RELIEF_ASSERT(at.x >= window.x0 && at.x < window.x0 + window.width);
  RELIEF_ASSERT(at.y >= window.y0 && at.y < window.y0 + window.height);
  // Layers beside the beauty do not change a path.
  Film film(window.width, window.height, aov_bit(Aov::kBeauty));
  FilterTable filter;
  pixel_filter_table_make(options.settings.filter, filter);
  KernelGlobals g = render_globals(context, options, filter);
  g.film = film.accumulator();

  const std::atomic<bool> stop{false};
  PhotonChoice choice = photon_choice_make(context, options, g, stop);
  const bool caustics = choice.photons;
  std::optional<PhotonPass> photons;
  if (caustics) {
    photons.emplace(context, options.settings, std::move(choice.sources));
    tbb::enumerable_thread_specific<Wavefront> workers([&] { return Wavefront(context.columns(caustics, false)); });
    for (std::uint32_t pass = 0; pass <= at.sample_index; ++pass) {
      photons->next(
          g, 0, stages, [&]() -> Wavefront& { return workers.local(); }, stop, [] {});
    }
  }

  PathReplay replay;
  replay.warnings = context.displacements.warnings();
  Wavefront wavefront(context.columns(caustics, false));
  wavefront.recorder = &replay.rays;
  const Media media(context);
  if (media.exist()) wavefront.media = &media;
  // The whole tile, as in the render: forks of its paths share the room of its batch.
  const int x = at.x - window.x0, y = at.y - window.y0;
  const Batch batch = tile_batch(film, film.tile_at(x, y), at.sample_index, 1);
  const FlushDenormals flush;
  wavefront.run(g, *context.accel, stages, context.surface_kernels(caustics), batch);
  const auto pixel = static_cast<std::uint32_t>(y * window.width + x);
  std::erase_if(replay.rays, [&](const RecordedRay& ray) { return ray.pixel != pixel; });
  replay.radiance = wavefront.first_radiance(pixel);
  return replay;
}

}  // namespace relief
