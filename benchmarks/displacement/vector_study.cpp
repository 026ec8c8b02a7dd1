#include "benchmarks/displacement/vector_study.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <memory>

#include <fmt/format.h>

#include "benchmarks/displacement/vector_scenes.h"
#include "displacement/point_tiles.h"
#include "integrator/stages.h"
#include "integrator/triangle_pairs.h"

namespace relief {

namespace {

/// Of all threads: what else the machine does is left out.
double processor_seconds()
{
  timespec now;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

class VectorTracer : public BenchTracer {
 public:
  explicit VectorTracer(std::string name) : name_(std::move(name)) {}
  const std::string& name() const { return name_; }
  double first_seconds() const { return first_seconds_; }
  virtual std::size_t bytes() const = 0;
  virtual std::size_t peak_bytes() const = 0;

 protected:
  double first_seconds_ = 0;

 private:
  std::string name_;
};

/// Tiles, with a cache of some size.
class TileTracer : public VectorTracer {
 public:
  TileTracer(const VectorScene& scene, std::size_t cache_bytes)
      : VectorTracer(fmt::format("tiles, {} MiB", cache_bytes >> 20)), cache_(cache_bytes)
  {
    const double start_seconds = processor_seconds();
    const MeshView mesh = scene.base().mesh();
    tiles_ = std::make_unique<PointTiles>(mesh, point_mover_make(scene.moves()), lattices_make(mesh, scene.cells()),
                                          false, cache_, 0);
    geometry_.tiles = tiles_.get();
    const RTCDevice device = start();
    commit(tessellation_scene_make(device, {RTC_BUILD_QUALITY_HIGH, false}),
           displaced_geometry_make(device, geometry_, traversal_table_select()), name());
    first_seconds_ = processor_seconds() - start_seconds;
  }
  std::size_t bytes() const override { return tiles_->bytes() + cache_.bytes() + tree_bytes(); }
  std::size_t peak_bytes() const override
  {
    return tiles_->bytes() + std::max(cache_.bytes() + tree_bytes(), tree_peak_bytes());
  }

 private:
  MicroHit point(const RTCHit& hit) const override
  {
    const DisplacedPoint at = tiles_->resolve(InstanceView{}, hit.primID, {hit.u, hit.v, hit.Ng_x});
    return {at.triangle, at.u, at.v, to_double(at.P), to_double(at.Ng)};
  }

  PointTileCache cache_;
  std::unique_ptr<PointTiles> tiles_;
  DisplacedGeometry geometry_;
};

/// All triangles in one tree, each by itself or two in a quadrilateral.
class MeshTracer : public VectorTracer {
 public:
  MeshTracer(const VectorScene& scene, bool in_pairs) : VectorTracer(in_pairs ? "quadrilaterals" : "triangles")
  {
    const double start_seconds = processor_seconds();
    const MeshView base = scene.base().mesh();
    const std::vector<LatticeTriangle> parts = lattices_make(base, scene.cells());
    mesh_ = divided_mesh_make(base, scene.moves(), parts, false, {});
    view_ = mesh_.view(base);
    const RTCDevice device = start();
    const RTCGeometry geometry = rtcNewGeometry(device, in_pairs ? RTC_GEOMETRY_TYPE_QUAD : RTC_GEOMETRY_TYPE_TRIANGLE);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, view_.P, 0, sizeof(Vec3f),
                               view_.num_vertices);
    if (in_pairs) {
      pairs_ = triangle_pairs_make(vertices(), triangles());
      const std::size_t count = pairs_.size();
      auto* const corners = static_cast<std::uint32_t*>(rtcSetNewGeometryBuffer(
          geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT4, 4 * sizeof(std::uint32_t), count));
      for (std::size_t k = 0; k < count; ++k) pair_corners(pairs_[k], triangles(), corners + 4 * k);
    } else {
      rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, view_.triangles, 0,
                                 sizeof(TriangleIndices), view_.num_triangles);
    }
    commit(tessellation_scene_make(device, {RTC_BUILD_QUALITY_MEDIUM, false}), geometry, name());
    first_seconds_ = processor_seconds() - start_seconds;
  }
  std::size_t num_triangles() const { return view_.num_triangles; }
  std::size_t bytes() const override { return mesh_bytes() + tree_bytes(); }
  std::size_t peak_bytes() const override { return mesh_bytes() + tree_peak_bytes(); }

 private:
  std::span<const Vec3f> vertices() const { return {view_.P, view_.num_vertices}; }
  std::span<const TriangleIndices> triangles() const { return {view_.triangles, view_.num_triangles}; }
  std::size_t mesh_bytes() const { return mesh_.bytes() + pairs_.capacity() * sizeof(pairs_[0]); }
  MicroHit point(const RTCHit& hit) const override
  {
    const TrianglePlace place =
        pairs_.empty() ? TrianglePlace{hit.primID, hit.u, hit.v} : pair_place(pairs_[hit.primID], hit.u, hit.v);
    const TriangleIndices& t = view_.triangles[place.triangle];
    const Vec3d P0 = to_double(view_.P[t.v0]), e1 = to_double(view_.P[t.v1]) - P0, e2 = to_double(view_.P[t.v2]) - P0;
    const auto u = static_cast<double>(place.u), v = static_cast<double>(place.v);
    const Vec3d N = cross(e1, e2);
    return {place.triangle, u, v, P0 + u * e1 + v * e2, N * (1 / std::max(length(N), 1e-300))};
  }

  MovedMesh mesh_;
  MeshView view_;
  std::vector<TrianglePair> pairs_;  ///< empty: every triangle is by itself
};

VectorResult measured(const VectorScene& scene, BenchResolution resolution, int rounds)
{
  std::vector<std::unique_ptr<VectorTracer>> tracers;
  // Exact, so the others are compared with it.
  for (const std::size_t mebibytes : {256, 64, 16})
    tracers.push_back(std::make_unique<TileTracer>(scene, mebibytes << 20));
  auto triangles = std::make_unique<MeshTracer>(scene, false);
  VectorResult result;
  result.num_base_triangles = scene.base().triangles.size();
  result.num_triangles = triangles->num_triangles();
  result.tolerance = 0.01 * scene.base().texel_metres;
  tracers.push_back(std::move(triangles));
  tracers.push_back(std::make_unique<MeshTracer>(scene, true));
  for (const auto& tracer : tracers) {
    result.methods.emplace_back();
    result.methods.back().name = tracer->name();
    result.methods.back().first_seconds = tracer->first_seconds();
  }
  const BenchRays rays = bench_rays_make(scene.base(), *tracers.front(), resolution);
  result.picture = shaded_picture(rays, resolution, {});
  for (const BenchRayKind kind : {BenchRayKind::kPrimary, BenchRayKind::kBounce, BenchRayKind::kShadow}) {
    const auto k = static_cast<std::size_t>(kind);
    result.num_rays[k] = rays.of(kind).size();
    const std::vector<Measurement> of_kind =
        bench_measure(tracers_of(tracers), kind, rays.of(kind), rounds, result.tolerance);
    for (std::size_t m = 0; m < of_kind.size(); ++m) result.methods[m].of_kind[k] = of_kind[m];
  }
  for (std::size_t m = 0; m < tracers.size(); ++m) {
    result.methods[m].bytes = tracers[m]->bytes();
    result.methods[m].peak_bytes = tracers[m]->peak_bytes();
  }
  return result;
}

}  // namespace

std::vector<VectorResult> bench_vector_run(BenchResolution resolution,
                                           int rounds,
                                           std::int32_t shrink,
                                           const std::function<void(const std::string&)>& progress)
{
  std::vector<VectorResult> results;
  for (const VectorSceneSpec& spec : vector_scene_specs()) {
    if (progress) progress(fmt::format("{}: vectors", spec.base.name));
    const VectorScene scene(spec, std::max(spec.cells / shrink, 1));
    results.push_back(measured(scene, resolution, rounds));
    results.back().name = results.back().picture.caption = spec.base.name;
  }
  return results;
}

}  // namespace relief
