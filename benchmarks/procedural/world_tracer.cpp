#include "benchmarks/procedural/world_tracer.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <stdexcept>

#include "integrator/computed_heights.h"
#include "integrator/stages.h"
#include "kernel/shape/surface_hit.h"

namespace relief {

namespace {

bool count_bytes(void* user, ssize_t bytes, bool)
{
  static_cast<std::atomic<std::ptrdiff_t>*>(user)->fetch_add(bytes, std::memory_order_release);
  return true;
}

/// Sides that are as long as this have one cell, whatever their size in the picture. (As counts are powers of two, cells are up
/// to half as long.)
CellsAlong no_finer(CellsAlong cells, double least_metres)
{
  return [cells = std::move(cells), least_metres](Vec3f a, Vec3f b) {
    return std::min(cells(a, b), length(to_double(a) - to_double(b)) / least_metres);
  };
}

}  // namespace

WorldTracer::WorldTracer(const World& world, const WorldCells& cells, int height, std::size_t cache_bytes)
    : world_(world), cache_(cache_bytes)
{
  const auto start = std::chrono::steady_clock::now();
  input_.meshes.push_back(world.scene.meshes[0].view());
  input_.instances.push_back({0, 0, -1, {}});
  DisplacementOptions options;
  options.camera = world.scene.cameras[0].camera;
  options.picture_height = height;
  computed_heights_add(world.scene, options, &input_);
  const ComputedHeights& heights = input_.heights[0];
  const DisplacementSettings& settings = world.scene.displacements[0];
  const CellsAlong by_size = cells.least_metres > 0 ? no_finer(heights.cells, cells.least_metres) : heights.cells;
  field_ = std::make_unique<ProceduralField>(
      heights.source, cells.n > 0 ? lattices_make(input_.meshes[0], cells.n) : lattices_make(input_.meshes[0], by_size),
      settings.midlevel, cache_);
  mesh_ = std::make_unique<DisplacedMesh>(
      input_.meshes[0], *field_,
      DisplacementMapping{.height = {}, .scale = settings.scale, .midlevel = settings.midlevel});
  geometry_.mesh = mesh_->view();
  geometry_.procedural = field_.get();
  build_tree();
  prepare_seconds_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void WorldTracer::build_tree()
{
  std::atomic<std::ptrdiff_t> bytes{0};
  device_ = rtcNewDevice(nullptr);
  if (device_ == nullptr) throw std::runtime_error("Embree cannot start on this machine");
  rtcSetDeviceMemoryMonitorFunction(device_, count_bytes, &bytes);
  scene_ = tessellation_scene_make(device_, TessellationBuild{RTC_BUILD_QUALITY_HIGH, false});
  RTCGeometry geometry = displaced_geometry_make(device_, geometry_, traversal_table_select());
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene_, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene_);
  rtcSetDeviceMemoryMonitorFunction(device_, nullptr, nullptr);
  tree_bytes_ = static_cast<std::size_t>(bytes.load());
  geometry_.scene = scene_;
  if (rtcGetDeviceError(device_) != RTC_ERROR_NONE) {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
    throw std::runtime_error("Embree failed to build a world's tree");
  }
}

WorldTracer::~WorldTracer()
{
  rtcReleaseScene(scene_);
  rtcReleaseDevice(device_);
}

std::uint64_t WorldTracer::trace(BenchRayKind kind, std::span<const BenchRay> rays, BenchHit* hits) const
{
  EmbreeContext context;
  embree_context_init(context, kind == BenchRayKind::kPrimary);
  std::uint64_t num_hits = 0;
  // What a renderer goes on with is made for every hit; the sum keeps it from being optimized away.
  double sum = 0;
  for (const BenchRay& ray : rays) {
    BenchHit& out = *hits++;
    out = {};
    if (kind == BenchRayKind::kShadow) {
      RTCRay query = embree_ray(ray);
      embree_occluded1(scene_, context, query);
      if (query.tfar < 0) out.t = 0;
    } else {
      RTCRayHit query = embree_ray_hit(ray);
      embree_intersect1(scene_, context, query);
      if (query.hit.geomID != RTC_INVALID_GEOMETRY_ID) {
        out.t = query.ray.tfar;
        const SurfacePoint at = displaced_surface_point(
            geometry_, query.hit.primID, displaced_hit_decode({query.hit.u, query.hit.v, query.hit.Ng_x}));
        sum += at.P.x + at.Ng.x;
      }
    }
    num_hits += out.t < kInfinity ? 1 : 0;
  }
  const volatile double kept = sum;
  static_cast<void>(kept);
  return num_hits;
}

WorldHit WorldTracer::intersect(const BenchRay& ray) const
{
  EmbreeContext context;
  embree_context_init(context, false);
  RTCRayHit query = embree_ray_hit(ray);
  embree_intersect1(scene_, context, query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
  const InstanceView placement;
  const DisplacedPoint point =
      displaced_resolve(geometry_, placement, 0.0f, query.hit.primID, {query.hit.u, query.hit.v, query.hit.Ng_x});
  const LatticeTriangle& part = field_->triangles()[point.triangle];
  const Vec2f weights = part.base_weights(point.u, point.v);
  const SurfaceHit surface = surface_hit_displaced(input_.meshes[0], placement, part.base, weights.x, weights.y,
                                                   {point.P, point.Ng, point.Ns, point.leave});
  const bool is_front = dot(surface.Ng, ray.D) <= 0;
  return {true, surface_hit_origin(surface, surface.P, is_front), is_front ? surface.Ng : -surface.Ng};
}

double WorldTracer::num_micro_triangles() const
{
  double sum = 0;
  for (const LatticeTriangle& t : field_->triangles()) sum += static_cast<double>(t.n) * t.n;
  return sum;
}

double WorldTracer::most_cells_a_side() const
{
  double most = 0;
  for (const LatticeTriangle& t : field_->triangles()) {
    for (int k = 0; k < 3; ++k) {
      const Vec2f d = t.corner[(k + 1) % 3] - t.corner[k];
      const float part = std::max({std::abs(d.x), std::abs(d.y), std::abs(d.x + d.y)});
      most = std::max(most, t.side_n[k] / static_cast<double>(part));
    }
  }
  return most;
}

}  // namespace relief
