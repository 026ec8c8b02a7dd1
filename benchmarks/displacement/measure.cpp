#include "benchmarks/displacement/measure.h"

#include <algorithm>
#include <cmath>
#include <ctime>

#include "exporters/png_ocio.h"
#include "integrator/flush_denormals.h"
#include "kernel/sample/warp.h"
#include "kernel/shape/surface_hit.h"

namespace relief {

namespace {

/// Seconds of processor time of this thread.
double processor_seconds()
{
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Two numbers in [0, 1) of the R2 sequence.
/// @source Roberts 2018, "The Unreasonable Effectiveness of Quasirandom Sequences"
Vec2f quasi_random(std::size_t index)
{
  const auto fraction = [](double x) { return static_cast<float>(std::min(x - std::floor(x), 1 - 0x1p-24)); };
  const auto i = static_cast<double>(index);
  return {fraction(0.5 + i * 0.7548776662466927), fraction(0.5 + i * 0.5698402909980532)};
}

/// Rays in the order of their pixels, row by row.
std::vector<BenchRay> primary_rays(const BenchSceneSpec& spec, BenchResolution resolution)
{
  const BenchCamera camera = bench_camera(spec);
  std::vector<BenchRay> rays;
  for (int y = 0; y < resolution.height; ++y) {
    for (int x = 0; x < resolution.width; ++x) {
      const float sx = (2 * (static_cast<float>(x) + 0.5f) - static_cast<float>(resolution.width)) /
                       static_cast<float>(resolution.height);
      const float sy = 1 - 2 * (static_cast<float>(y) + 0.5f) / static_cast<float>(resolution.height);
      rays.push_back(
          {camera.eye, normalize(camera.forward + camera.half_height * (sx * camera.right + sy * camera.up))});
    }
  }
  return rays;
}

bool differs(const BenchHit& a, const BenchHit& b, double tolerance)
{
  const bool hit_a = a.t < kInfinity, hit_b = b.t < kInfinity;
  if (hit_a != hit_b) return true;
  return hit_a && std::abs(static_cast<double>(a.t) - static_cast<double>(b.t)) > tolerance;
}

}  // namespace

BenchCamera bench_camera(const BenchSceneSpec& spec)
{
  BenchCamera camera;
  camera.eye = {static_cast<float>(spec.eye[0]), static_cast<float>(spec.eye[1]), static_cast<float>(spec.eye[2])};
  const Vec3f look_at{static_cast<float>(spec.look_at[0]), static_cast<float>(spec.look_at[1]),
                      static_cast<float>(spec.look_at[2])};
  camera.forward = normalize(look_at - camera.eye);
  camera.right = normalize(cross(camera.forward, {0, 1, 0}));
  camera.up = cross(camera.right, camera.forward);
  camera.half_height = static_cast<float>(std::tan(spec.field_of_view * 3.141592653589793 / 360));
  return camera;
}

BenchRays bench_rays_make(const BenchScene& scene,
                          const BenchTracer& exact,
                          BenchResolution resolution,
                          const std::vector<BenchRay>& given)
{
  BenchRays rays;
  rays.of_kind[0] = given.empty() ? primary_rays(*scene.spec, resolution) : given;
  for (const BenchRay& ray : rays.of_kind[0]) {
    const std::optional<MicroHit> hit = exact.intersect(ray);
    rays.shading.push_back(0);
    if (!hit) continue;
    Vec3f Ng = to_float(hit->Ng);
    if (dot(Ng, ray.D) > 0) Ng = -Ng;
    rays.shading.back() = std::max(0.1f, dot(Ng, kBenchSun));
    const Vec3f P = to_float(hit->P);
    const auto off = static_cast<float>(0.25 * scene.texel_metres);
    const Vec3f O = offset_ray_origin(P, max(gamma_bound(5) * abs(P), 0.5f * Vec3f{off, off, off}), Ng);
    const std::size_t index = rays.of_kind[1].size();
    const Vec3f local = warp_cosine_hemisphere(quasi_random(index));
    const Frame frame = frame_from_normal(Ng);
    rays.of_kind[1].push_back({O, normalize(local.x * frame.s + local.y * frame.t + local.z * frame.n)});
    if (dot(Ng, kBenchSun) > 0) rays.of_kind[2].push_back({O, kBenchSun});
  }
  return rays;
}

BenchPicture shaded_picture(const BenchRays& rays, BenchResolution resolution, std::string caption)
{
  BenchPicture picture{resolution.width, resolution.height, std::move(caption), {}};
  for (const float cosine : rays.shading) {
    const float value = cosine > 0 ? 0.8f * cosine : 0.02f;
    const auto code = static_cast<std::uint8_t>(std::lround(255 * srgb_from_linear(value)));
    picture.rgb.insert(picture.rgb.end(), 3, code);
  }
  return picture;
}

std::vector<Measurement> bench_measure(std::span<const BenchTracer* const> tracers,
                                       BenchRayKind kind,
                                       const std::vector<BenchRay>& rays,
                                       int rounds,
                                       double tolerance)
{
  constexpr std::size_t kNumChunks = 12;
  const FlushDenormals flush;
  const std::size_t num_methods = tracers.size();
  std::vector<Measurement> results(num_methods);
  if (rays.empty()) return results;
  const auto count = static_cast<double>(rays.size());

  std::vector<BenchHit> expected(rays.size()), found(rays.size());
  for (std::size_t m = 0; m < num_methods; ++m) {
    TraversalCounters counters;
    tracers[m]->trace(kind, rays, m == 0 ? expected.data() : found.data(), counters);
    Measurement& result = results[m];
    result.bounds = static_cast<double>(counters.bounds) / count;
    result.texels = static_cast<double>(counters.texels) / count;
    result.inversions = static_cast<double>(counters.inversions) / count;
    result.prisms = static_cast<double>(counters.prisms) / count;
    std::size_t num_hits = 0, num_different = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const BenchHit& hit = m == 0 ? expected[i] : found[i];
      num_hits += hit.t < kInfinity ? 1 : 0;
      num_different += differs(expected[i], hit, tolerance) ? 1 : 0;
    }
    result.hit_share = static_cast<double>(num_hits) / count;
    result.disagreement = static_cast<double>(num_different) / count;
  }

  std::vector<double> fastest(num_methods * kNumChunks, HUGE_VAL);
  for (int round = 0; round < rounds; ++round) {
    for (std::size_t chunk = 0; chunk < kNumChunks; ++chunk) {
      const std::size_t first = rays.size() * chunk / kNumChunks, end = rays.size() * (chunk + 1) / kNumChunks;
      for (std::size_t turn = 0; turn < num_methods; ++turn) {
        const std::size_t m = (turn + static_cast<std::size_t>(round)) % num_methods;
        TraversalCounters counters;
        const double start = processor_seconds();
        tracers[m]->trace(kind, std::span(rays).subspan(first, end - first), found.data(), counters);
        double& best = fastest[m * kNumChunks + chunk];
        best = std::min(best, processor_seconds() - start);
      }
    }
  }
  for (std::size_t m = 0; m < num_methods && rounds > 0; ++m) {
    double sum = 0;
    for (std::size_t chunk = 0; chunk < kNumChunks; ++chunk) sum += fastest[m * kNumChunks + chunk];
    results[m].nanoseconds = 1e9 * sum / count;
  }
  return results;
}

}  // namespace relief
