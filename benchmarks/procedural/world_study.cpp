#include "benchmarks/procedural/world_study.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <ctime>
#include <fstream>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "benchmarks/displacement/measure.h"
#include "benchmarks/procedural/world_tracer.h"
#include "integrator/flush_denormals.h"
#include "kernel/sample/warp.h"

namespace relief {

namespace {

/// Heights that are kept: as many as in a render that is not told otherwise.
std::size_t cache_bytes() { return DisplacementOptions{}.computed_bytes; }

double processor_seconds()
{
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// A number of the process's status, bytes; 0 where the system has none.
std::uint64_t status_bytes(const char* name)
{
  std::ifstream status("/proc/self/status");
  std::string line;
  while (std::getline(status, line)) {
    if (line.rfind(name, 0) == 0) return std::strtoull(line.c_str() + std::strlen(name), nullptr, 10) << 10;
  }
  return 0;
}

/// Most memory that the process has from here on, beyond what it has now.
class PeakMemory {
 public:
  PeakMemory()
  {
    // The kernel forgets the highest so far.
    std::ofstream("/proc/self/clear_refs") << "5";
    before_ = status_bytes("VmRSS:");
  }
  std::uint64_t bytes() const
  {
    const std::uint64_t peak = status_bytes("VmHWM:");
    return peak > before_ ? peak - before_ : 0;
  }

 private:
  std::uint64_t before_ = 0;
};

/// Rays of the part of a picture that is traced.
std::vector<BenchRay> primary_rays(const Camera& camera, const WorldResult& size)
{
  const Affine3& m = camera.world_from_camera;
  const float half_width = camera.half_height * static_cast<float>(size.width) / static_cast<float>(size.height);
  const auto at = [](int pixel, int traced, int whole) {
    return (2 * (static_cast<float>(pixel) + 0.5f) - static_cast<float>(traced)) / static_cast<float>(whole);
  };
  std::vector<BenchRay> rays;
  for (int y = 0; y < size.traced_height; ++y) {
    for (int x = 0; x < size.traced_width; ++x) {
      const float sx = at(x, size.traced_width, size.width), sy = -at(y, size.traced_height, size.height);
      rays.push_back({m.p, normalize(transform_vector(m, {sx * half_width, sy * camera.half_height, -1}))});
    }
  }
  return rays;
}

/// Two numbers in [0, 1) of the R2 sequence.
/// @source Roberts 2018, "The Unreasonable Effectiveness of Quasirandom Sequences"
Vec2f quasi_random(std::size_t index)
{
  const auto fraction = [](double x) { return static_cast<float>(std::min(x - std::floor(x), 1 - 0x1p-24)); };
  const auto i = static_cast<double>(index);
  return {fraction(0.5 + i * 0.7548776662466927), fraction(0.5 + i * 0.5698402909980532)};
}

/// Rays of a picture: one a pixel, and from each hit one bounce and one shadow ray.
struct PictureRays {
  std::array<std::vector<BenchRay>, 3> of_kind;
  std::vector<std::size_t> pixel;  ///< of each bounce and shadow ray
};

void add_secondary_rays(const WorldTracer& tracer, const std::vector<BenchHit>& hits, PictureRays* rays)
{
  for (std::size_t i = 0; i < hits.size(); ++i) {
    if (!(hits[i].t < kInfinity)) continue;
    const WorldHit hit = tracer.intersect(rays->of_kind[0][i]);
    const Vec3f local = warp_cosine_hemisphere(quasi_random(rays->pixel.size()));
    const Frame frame = frame_from_normal(hit.Ng);
    rays->of_kind[1].push_back({hit.O, normalize(local.x * frame.s + local.y * frame.t + local.z * frame.n)});
    rays->of_kind[2].push_back({hit.O, dot(hit.Ng, kBenchSun) > 0 ? kBenchSun : hit.Ng});
    rays->pixel.push_back(i);
  }
}

/// Sun and sky on the first hits, at half the size.
void shade(const WorldTracer& tracer, const PictureRays& rays, int width, int height, WorldStudy* study)
{
  std::vector<Vec3f> color(rays.of_kind[0].size(), Vec3f{0.55f, 0.68f, 0.85f});
  std::vector<BenchHit> shadows(rays.of_kind[2].size()), bounces(rays.of_kind[1].size());
  tracer.trace(BenchRayKind::kShadow, rays.of_kind[2], shadows.data());
  tracer.trace(BenchRayKind::kBounce, rays.of_kind[1], bounces.data());
  for (std::size_t k = 0; k < rays.pixel.size(); ++k) {
    const Vec3f Ng = tracer.intersect(rays.of_kind[0][rays.pixel[k]]).Ng;
    const bool is_lit = !(shadows[k].t < kInfinity);
    const float sun = is_lit ? std::max(dot(Ng, kBenchSun), 0.0f) : 0.0f, sky = bounces[k].t < kInfinity ? 0.1f : 0.35f;
    color[rays.pixel[k]] = sun * Vec3f{0.5f, 0.45f, 0.38f} + sky * Vec3f{0.4f, 0.44f, 0.5f};
  }
  study->picture_width = width / 2;
  study->picture_height = height / 2;
  for (int y = 0; y < height / 2; ++y) {
    for (int x = 0; x < width / 2; ++x) {
      Vec3f sum{};
      for (int k = 0; k < 4; ++k) sum += color[static_cast<std::size_t>((2 * y + k / 2) * width + 2 * x + k % 2)];
      for (const float c : {sum.x, sum.y, sum.z})
        study->rgb.push_back(static_cast<std::uint8_t>(255 * std::sqrt(std::clamp(c / 4, 0.0f, 1.0f))));
    }
  }
}

/// Puts the camera above the ground, which has to be traced for it.
void place_camera(World* world)
{
  if (world->eye_height < 0) return;
  Camera& camera = world->scene.cameras[0].camera;
  const WorldTracer tracer(*world, {64, 0}, 1, cache_bytes());
  Vec3f top = camera.world_from_camera.p;
  top.y = 1e4f;
  BenchHit hit;
  const BenchRay down{top, {0, -1, 0}};
  if (tracer.trace(BenchRayKind::kPrimary, {&down, 1}, &hit) > 0)
    camera.world_from_camera.p.y = top.y - hit.t + world->eye_height;
}

void trace_round(const WorldTracer& tracer,
                 BenchRayKind kind,
                 const std::vector<BenchRay>& rays,
                 int round,
                 std::vector<BenchHit>* hits,
                 WorldRays* out)
{
  if (rays.empty()) return;
  hits->resize(rays.size());
  const std::uint64_t tiles = tracer.num_tiles_made();
  const double start = processor_seconds();
  const std::uint64_t num_hits = tracer.trace(kind, rays, hits->data());
  const double nanoseconds = 1e9 * (processor_seconds() - start) / static_cast<double>(rays.size());
  const std::uint64_t made = tracer.num_tiles_made() - tiles;
  if (round == 0) {
    out->count = rays.size();
    out->hit_share = static_cast<double>(num_hits) / static_cast<double>(rays.size());
    out->first_nanoseconds = out->nanoseconds = nanoseconds;
    out->first_tiles = made;
    return;
  }
  out->nanoseconds = round == 1 ? nanoseconds : std::min(out->nanoseconds, nanoseconds);
  out->repeated_tiles = made;
}

WorldResult measure(const World& world, const WorldSpec::Case& each, const WorldOptions& options, WorldStudy* study)
{
  const FlushDenormals flush;
  const double shrink = options.shrink * each.shrink;
  WorldResult out;
  out.cells = each.cells;
  out.room_bytes = cache_bytes() * static_cast<std::size_t>(each.room);
  out.width = static_cast<int>(world.spec->width / shrink);
  out.height = static_cast<int>(world.spec->height / shrink);
  // Of small pictures more, so that there are rays.
  const int crop = options.shrink > 1 ? std::max(each.crop / 4, 1) : each.crop;
  out.traced_width = out.width / crop;
  out.traced_height = out.height / crop;
  PictureRays rays;
  rays.of_kind[0] = primary_rays(world.scene.cameras[0].camera, out);
  std::vector<BenchHit> hits, others;
  const PeakMemory memory;
  const WorldTracer tracer(world, each.cells, out.height, out.room_bytes);
  trace_round(tracer, BenchRayKind::kPrimary, rays.of_kind[0], 0, &hits, out.rays.data());
  // Hits are completed for rays that leave them: what tiles that takes is not counted.
  add_secondary_rays(tracer, hits, &rays);
  for (int round = 0; round < options.rounds; ++round) {
    for (std::size_t kind = 0; kind < 3; ++kind) {
      if (round == 0 && kind == 0) continue;
      trace_round(tracer, static_cast<BenchRayKind>(kind), rays.of_kind[kind], round, &others, &out.rays[kind]);
    }
  }
  out.peak_bytes = memory.bytes();
  out.num_lattices = tracer.num_lattices();
  out.num_micro_triangles = tracer.num_micro_triangles();
  out.most_cells_a_side = tracer.most_cells_a_side();
  out.prepare_seconds = tracer.prepare_seconds();
  out.mesh_bytes = world.scene.meshes[0].bytes();
  out.prepared_bytes = tracer.prepared_bytes();
  out.height_bytes = tracer.height_bytes();
  if (study->rgb.empty()) shade(tracer, rays, out.width, out.height, study);
  return out;
}

}  // namespace

WorldStudy world_study(const WorldSpec& spec, const WorldOptions& options)
{
  World world = world_make(spec, options.mesh_divisor);
  place_camera(&world);
  WorldStudy study;
  study.spec = &spec;
  study.num_triangles = world.scene.meshes[0].triangles.size();
  for (const WorldSpec::Case& each : spec.cases) {
    study.results.push_back(measure(world, each, options, &study));
    const WorldResult& r = study.results.back();
    if (options.progress) options.progress(fmt::format("{}: N = {}, {} × {}", spec.name, r.cells.n, r.width, r.height));
  }
  return study;
}

}  // namespace relief
