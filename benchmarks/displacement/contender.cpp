#include "benchmarks/displacement/contender.h"

#include <atomic>
#include <chrono>
#include <cmath>
#include <stdexcept>

#include "integrator/stages.h"

namespace relief {

namespace {

class Stopwatch {
 public:
  double seconds() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
};

bool count_bytes(void* user, ssize_t bytes, bool)
{
  // Released, for the counter is on a stack, and the thread sanitizer cannot see Embree's threads hand over.
  static_cast<std::atomic<std::ptrdiff_t>*>(user)->fetch_add(bytes, std::memory_order_release);
  return true;
}

}  // namespace

RTCRay embree_ray(const BenchRay& ray)
{
  RTCRay out;
  out.org_x = ray.O.x;
  out.org_y = ray.O.y;
  out.org_z = ray.O.z;
  out.dir_x = ray.D.x;
  out.dir_y = ray.D.y;
  out.dir_z = ray.D.z;
  out.tnear = 0.0f;
  out.tfar = kInfinity;
  out.time = 0.0f;
  out.mask = ~0u;
  out.id = 0;
  out.flags = 0;
  return out;
}

RTCRayHit embree_ray_hit(const BenchRay& ray)
{
  RTCRayHit out;
  out.ray = embree_ray(ray);
  out.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  out.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  return out;
}

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
  const Stopwatch field_time;
  field = HeightField(s.map());
  field_seconds = field_time.seconds();
  const Stopwatch mesh_time;
  mesh = DisplacedMesh(s.mesh(), field.view(), {TextureRef{}, s.scale, s.midlevel});
  mesh_seconds = mesh_time.seconds();
}

Contender::Contender(const BenchSurface& surface, const ContenderSpec& spec) : surface_(surface), spec_(spec)
{
  const Stopwatch time;
  double map_seconds = surface_.field_seconds;
  std::atomic<std::ptrdiff_t> bytes{0};
  if (displacement_method(spec_.method).tessellation) {
    build_tessellation();
  } else {
    build_tables();
    map_seconds += time.seconds();
  }
  device_ = rtcNewDevice(nullptr);
  if (device_ == nullptr) throw std::runtime_error("Embree cannot start on this machine");
  rtcSetDeviceMemoryMonitorFunction(device_, count_bytes, &bytes);
  scene_ = tessellation_scene_make(
      device_, tessellation_ != nullptr ? spec_.build : TessellationBuild{RTC_BUILD_QUALITY_HIGH, false});
  RTCGeometry geometry = tessellation_ != nullptr
                             ? tessellation_->geometry_make(device_)
                             : displaced_geometry_make(device_, geometry_, traversal_table_select());
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene_, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene_);
  rtcSetDeviceMemoryMonitorFunction(device_, nullptr, nullptr);
  bvh_bytes_ = static_cast<std::size_t>(bytes.load());
  build_seconds_ = time.seconds() + surface_.field_seconds + surface_.mesh_seconds;
  rescale_seconds_ = build_seconds_ - map_seconds;
  if (rtcGetDeviceError(device_) != RTC_ERROR_NONE) {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
    throw std::runtime_error("Embree failed to build the tree of '" + spec_.name + "'");
  }
}

Contender::~Contender()
{
  rtcReleaseScene(scene_);
  rtcReleaseDevice(device_);
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

MicroHit Contender::point(std::uint32_t primitive, float u, float v) const
{
  if (tessellation_ != nullptr) return tessellation_->hit(primitive, u, v);
  const SurfacePoint point = surface_point(geometry_.mesh, geometry_.mesh.triangles[primitive], u, v);
  return {primitive, u, v, point.P, point.Ng};
}

void Contender::trace(BenchRayKind kind,
                      std::span<const BenchRay> rays,
                      BenchHit* hits,
                      TraversalCounters& counters) const
{
  EmbreeContext context;
  embree_context_init(context, kind == BenchRayKind::kPrimary);
  context.displacement = &counters;
  if (kind == BenchRayKind::kShadow) {
    for (const BenchRay& ray : rays) {
      RTCRay query = embree_ray(ray);
      embree_occluded1(scene_, context, query);
      (hits++)->t = query.tfar < 0 ? 0.0f : kInfinity;
    }
    return;
  }
  // What a renderer goes on with is made for every hit; the sum keeps it from being optimized away.
  double sum = 0;
  for (const BenchRay& ray : rays) {
    RTCRayHit query = embree_ray_hit(ray);
    embree_intersect1(scene_, context, query);
    const bool hit = query.hit.geomID != RTC_INVALID_GEOMETRY_ID;
    (hits++)->t = hit ? query.ray.tfar : kInfinity;
    if (!hit) continue;
    const MicroHit at = point(query.hit.primID, query.hit.u, query.hit.v);
    sum += at.P.x + at.Ng.x;
  }
  const volatile double kept = sum;
  static_cast<void>(kept);
}

void Contender::count_steps(std::span<const BenchRay> rays, std::uint32_t* steps) const
{
  EmbreeContext context;
  embree_context_init(context, true);
  for (const BenchRay& ray : rays) {
    TraversalCounters counters;
    context.displacement = &counters;
    RTCRayHit query = embree_ray_hit(ray);
    embree_intersect1(scene_, context, query);
    *steps++ = static_cast<std::uint32_t>(counters.bounds + counters.texels);
  }
}

std::optional<MicroHit> Contender::intersect(const BenchRay& ray) const
{
  EmbreeContext context;
  embree_context_init(context, false);
  RTCRayHit query = embree_ray_hit(ray);
  embree_intersect1(scene_, context, query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
  return point(query.hit.primID, query.hit.u, query.hit.v);
}

}  // namespace relief
