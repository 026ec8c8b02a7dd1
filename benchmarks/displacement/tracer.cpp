#include "benchmarks/displacement/tracer.h"

#include <stdexcept>

namespace relief {

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

BenchTracer::~BenchTracer()
{
  if (scene_ != nullptr) rtcReleaseScene(scene_);
  if (device_ != nullptr) rtcReleaseDevice(device_);
}

bool BenchTracer::count(void* user, ssize_t bytes, bool)
{
  // Released, for the thread sanitizer cannot see Embree's threads hand over.
  auto* const tracer = static_cast<BenchTracer*>(user);
  const std::ptrdiff_t now = tracer->bytes_.fetch_add(bytes, std::memory_order_acq_rel) + bytes;
  std::ptrdiff_t most = tracer->most_bytes_.load(std::memory_order_relaxed);
  while (now > most && !tracer->most_bytes_.compare_exchange_weak(most, now, std::memory_order_release)) {
  }
  return true;
}

RTCDevice BenchTracer::start()
{
  device_ = rtcNewDevice(nullptr);
  if (device_ == nullptr) throw std::runtime_error("Embree cannot start on this machine");
  rtcSetDeviceMemoryMonitorFunction(device_, count, this);
  return device_;
}

void BenchTracer::commit(RTCScene scene, RTCGeometry geometry, const std::string& name)
{
  scene_ = scene;
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene_, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene_);
  rtcSetDeviceMemoryMonitorFunction(device_, nullptr, nullptr);
  tree_bytes_ = static_cast<std::size_t>(bytes_.load());
  tree_peak_bytes_ = static_cast<std::size_t>(most_bytes_.load());
  if (rtcGetDeviceError(device_) != RTC_ERROR_NONE)
    throw std::runtime_error("Embree failed to build the tree of '" + name + "'");
}

void BenchTracer::trace(BenchRayKind kind,
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
    const MicroHit at = point(query.hit);
    sum += at.P.x + at.Ng.x;
  }
  const volatile double kept = sum;
  static_cast<void>(kept);
}

std::optional<MicroHit> BenchTracer::intersect(const BenchRay& ray) const
{
  EmbreeContext context;
  embree_context_init(context, false);
  RTCRayHit query = embree_ray_hit(ray);
  embree_intersect1(scene_, context, query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
  return point(query.hit);
}

}  // namespace relief
