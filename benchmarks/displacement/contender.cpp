#include "benchmarks/displacement/contender.h"

#include <cmath>

#include "integrator/stages.h"

namespace relief {

double tessellation_rate_within(const DisplacedMeshView& mesh,
                                TessellationKind kind,
                                const TessellationBuild& build,
                                std::uint64_t budget_bytes)
{
  double rate = 1;
  while (budget_bytes > 0) {
    const TessellationLayout layout = tessellation_layout_make(mesh, kind, rate);
    const auto ratio = static_cast<double>(budget_bytes) / static_cast<double>(tessellation_peak_bytes(layout, build));
    // One segment an edge is as coarse as it gets.
    if (ratio >= 1 || layout.num_micro_triangles <= 6 * std::uint64_t{mesh.num_triangles}) break;
    // Memory goes with the square of the rate, nearly.
    rate *= std::min(0.99, std::sqrt(ratio));
  }
  return rate;
}

BenchSurface::BenchSurface(const BenchScene& s) : scene(s)
{
  const BenchStopwatch field_time;
  field = HeightField(s.map());
  field_seconds = field_time.seconds();
  const BenchStopwatch mesh_time;
  mesh = DisplacedMesh(s.mesh(), field.view(), {TextureRef{}, s.scale, s.midlevel});
  mesh_seconds = mesh_time.seconds();
}

Contender::Contender(const BenchSurface& surface, const ContenderSpec& spec) : surface_(surface), spec_(spec)
{
  const BenchStopwatch time;
  double map_seconds = surface_.field_seconds;
  if (displacement_method(spec_.method).tessellation) {
    build_tessellation();
  } else {
    build_tables();
    map_seconds += time.seconds();
  }
  const RTCDevice device = start();
  const RTCScene tree = tessellation_scene_make(
      device, tessellation_ != nullptr ? spec_.build : TessellationBuild{RTC_BUILD_QUALITY_HIGH, false});
  commit(tree,
         tessellation_ != nullptr ? tessellation_->geometry_make(device)
                                  : displaced_geometry_make(device, geometry_, traversal_table_select()),
         spec_.name);
  build_seconds_ = time.seconds() + surface_.field_seconds + surface_.mesh_seconds;
  rescale_seconds_ = build_seconds_ - map_seconds;
}

void Contender::build_tessellation()
{
  const DisplacedMeshView mesh = surface_.mesh.view();
  const TessellationKind kind = *displacement_method(spec_.method).tessellation;
  rate_ = tessellation_rate_within(mesh, kind, spec_.build, spec_.budget_bytes);
  tessellation_ = std::make_unique<Tessellation>(mesh, tessellation_layout_make(mesh, kind, rate_));
  triangle_bytes_ = tessellation_->bytes();
}

void Contender::build_tables()
{
  geometry_.mesh = surface_.mesh.view();
  geometry_.levels[0].field = &surface_.field.view();
  geometry_.method = spec_.method;
  geometry_.rmip_options = spec_.rmip_options;
  triangle_bytes_ = surface_.mesh.bytes();
  table_bytes_ = surface_.field.bytes();
  const DisplacementMethodEntry& method = displacement_method(spec_.method);
  if (method.table_make == nullptr) return;
  table_ = method.table_make(surface_.field.view(), spec_.rmip_options);
  geometry_.levels[0].table = table_.view;
  table_bytes_ = table_.bytes;
}

std::uint64_t Contender::num_micro_triangles() const
{
  return tessellation_ != nullptr ? tessellation_->layout().num_micro_triangles : 0;
}

MicroHit Contender::point(const RTCHit& hit) const
{
  if (tessellation_ != nullptr) return tessellation_->hit(hit.primID, hit.u, hit.v);
  const SurfacePoint point = surface_point(geometry_.mesh, geometry_.mesh.triangles[hit.primID], hit.u, hit.v);
  return {hit.primID, hit.u, hit.v, point.P, point.Ng};
}

void Contender::count_steps(std::span<const BenchRay> rays, std::uint32_t* steps) const
{
  EmbreeContext context;
  embree_context_init(context, true);
  for (const BenchRay& ray : rays) {
    TraversalCounters counters;
    context.displacement = &counters;
    RTCRayHit query = embree_ray_hit(ray);
    embree_intersect1(scene(), context, query);
    *steps++ = static_cast<std::uint32_t>(counters.bounds + counters.texels);
  }
}

}  // namespace relief
