#include "benchmarks/displacement/study.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>
#include <tbb/global_control.h>

#include "displacement/rmip.h"
#include "integrator/stages.h"

namespace relief {

namespace {

using Contenders = std::vector<std::unique_ptr<Contender>>;

ContenderSpec traversal_spec(std::string name, DisplacementMethod method, int rmip_resolution = 0)
{
  ContenderSpec spec{std::move(name), method};
  spec.rmip_options.resolution = rmip_resolution;
  return spec;
}

ContenderSpec tessellation_spec(std::string name,
                                DisplacementMethod method,
                                std::uint64_t budget_bytes,
                                const TessellationBuild& build = {})
{
  return {std::move(name), method, {}, build, budget_bytes};
}

/// The paper's three sizes of an RMIP: 64, as large as a mipmap, and 1024. Smaller maps have smaller ones.
struct RmipSizes {
  int low, equal, high;
};

RmipSizes rmip_sizes(const BenchScene& scene)
{
  const int equal = rmip_linear_resolution(scene.map_size());
  return {std::clamp(equal / 4, 1, 64), equal, std::min(4 * equal, 1024)};
}

Contenders make_all(const BenchSurface& surface, const std::vector<ContenderSpec>& specs)
{
  Contenders contenders;
  for (const ContenderSpec& spec : specs) contenders.push_back(std::make_unique<Contender>(surface, spec));
  return contenders;
}

/// All methods, RMIP in its three sizes.
std::vector<ContenderSpec> table_specs(const BenchScene& scene, std::uint64_t tessellation_bytes)
{
  const RmipSizes sizes = rmip_sizes(scene);
  std::vector<ContenderSpec> specs;
  for (const DisplacementMethod method : kDisplacementMethods) {
    const std::string name(displacement_method_label(method));
    const std::optional<TessellationKind> kind = displacement_method(method).tessellation;
    // A grid takes a fifth of the memory of its triangles.
    const std::uint64_t grid_bytes = tessellation_bytes / 4;
    if (kind) {
      specs.push_back(tessellation_spec(
          name, method, *kind == TessellationKind::kGrids ? grid_bytes : tessellation_bytes - grid_bytes));
    } else {
      specs.push_back(traversal_spec(name, method, sizes.equal));
    }
    if (method == DisplacementMethod::tfdm) {
      specs.push_back(traversal_spec("tfdm-affine", method));
      specs.back().rmip_options.bounds = SpaceBounds::kAffine;
    }
    if (method == DisplacementMethod::rmip) {
      specs.push_back(traversal_spec("rmip-affine", method, sizes.equal));
      specs.back().rmip_options.bounds = SpaceBounds::kAffine;
      specs.push_back(traversal_spec("rmip-low", method, sizes.low));
      specs.push_back(traversal_spec("rmip-high", method, sizes.high));
    }
  }
  return specs;
}

/// Colours from dark blue over green to yellow, which brightens evenly.
std::array<std::uint8_t, 3> heat_color(double t)
{
  constexpr double kStops[][3] = {{68, 1, 84}, {59, 82, 139}, {33, 145, 140}, {94, 201, 98}, {253, 231, 37}};
  const double at = 4 * std::clamp(t, 0.0, 1.0);
  const auto stop = static_cast<std::size_t>(std::min(at, 3.999));
  std::array<std::uint8_t, 3> color{};
  for (std::size_t c = 0; c < 3; ++c) {
    const double mixed = kStops[stop][c] + (at - static_cast<double>(stop)) * (kStops[stop + 1][c] - kStops[stop][c]);
    color[c] = static_cast<std::uint8_t>(std::lround(mixed));
  }
  return color;
}

/// Fig. 9: bounds and texels of every primary ray, on a logarithmic scale.
BenchPicture steps_picture(const Contender& contender, const BenchRays& rays, BenchResolution resolution)
{
  constexpr double kMostSteps = 1024;
  const std::vector<BenchRay>& primary = rays.of(BenchRayKind::kPrimary);
  std::vector<std::uint32_t> steps(primary.size());
  contender.count_steps(primary, steps.data());
  BenchPicture picture{resolution.width, resolution.height, {}, {}};
  double sum = 0, most = 0;
  for (const std::uint32_t count : steps) {
    sum += count;
    most = std::max(most, static_cast<double>(count));
    const std::array<std::uint8_t, 3> color = heat_color(std::log1p(count) / std::log1p(kMostSteps));
    picture.rgb.insert(picture.rgb.end(), color.begin(), color.end());
  }
  picture.caption = fmt::format("{}: {:.1f} steps a ray, at most {:.0f}; colours: 0 to {:.0f}, logarithmic",
                                contender.spec().name, sum / static_cast<double>(steps.size()), most, kMostSteps);
  return picture;
}

MethodResult method_result(const Contender& contender)
{
  MethodResult result;
  result.name = contender.spec().name;
  result.rate = contender.rate();
  result.num_micro_triangles = contender.num_micro_triangles();
  result.table_bytes = contender.table_bytes();
  result.triangle_bytes = contender.triangle_bytes();
  result.bvh_bytes = contender.tree_bytes();
  result.build_seconds = contender.build_seconds();
  result.rescale_seconds = contender.rescale_seconds();
  return result;
}

/// The study and what it is asked for.
struct Study {
  const BenchOptions& options;
  BenchResults& results;

  void say(const std::string& line) const
  {
    if (options.progress) options.progress(line);
  }

  BenchScene make_scene(const BenchSceneSpec& spec, BenchSceneChange change = {}) const
  {
    if (options.own != nullptr) return options.own->make(change);
    change.map *= options.map_scale;
    return bench_scene_make(spec, change);
  }

  void add_table(const BenchSceneSpec& spec) const;
  void add_marching(const BenchSceneSpec& spec) const;
  void add_sweeps(const BenchSceneSpec& spec) const;
  void add_inversion(const BenchSceneSpec& spec) const;
  void add_tessellation(const BenchSceneSpec& spec) const;
  void add_costs(const BenchSceneSpec& spec) const;
  void add_frames(const BenchSceneSpec& spec) const;
};

void Study::add_table(const BenchSceneSpec& spec) const
{
  say(fmt::format("{}: preparing", spec.name));
  const BenchScene scene = make_scene(spec);
  const BenchSurface surface(scene);
  const Contenders contenders = make_all(surface, table_specs(scene, options.tessellation_bytes));
  const BenchRays rays = bench_rays_make(scene, *contenders.front(), options.resolution, options.rays);

  SceneResult result;
  result.name = spec.name;
  result.like = spec.like;
  result.paper = spec.paper;
  result.num_triangles = scene.triangles.size();
  result.map_width = scene.height_map.width;
  result.map_height = scene.height_map.height;
  result.map_bytes = scene.height_map.bytes();
  result.tiles_u = scene.tiles_u;
  result.tiles_v = scene.tiles_v;
  result.tolerance = scene.texel_metres;
  for (const auto& contender : contenders) result.methods.push_back(method_result(*contender));
  for (const BenchRayKind kind : {BenchRayKind::kPrimary, BenchRayKind::kBounce, BenchRayKind::kShadow}) {
    const auto k = static_cast<std::size_t>(kind);
    say(fmt::format("{}: {} rays", spec.name, kBenchRayKindNames[k]));
    result.num_rays[k] = rays.of(kind).size();
    const std::vector<Measurement> measured =
        bench_measure(tracers_of(contenders), kind, rays.of(kind), options.rounds, result.tolerance);
    for (std::size_t m = 0; m < measured.size(); ++m) result.methods[m].of_kind[k] = measured[m];
  }
  // Rays of a file make no picture.
  if (options.rays.empty()) result.pictures.push_back(shaded_picture(rays, options.resolution, result.name));
  for (const auto& contender : contenders) {
    if (!options.rays.empty()) break;
    const std::string& name = contender->spec().name;
    if (name == kPublishedMethod || name == "rmip" || name == kExactMethod) {
      result.pictures.push_back(steps_picture(*contender, rays, options.resolution));
    }
  }
  results.scenes.push_back(std::move(result));
}

void Study::add_marching(const BenchSceneSpec& spec) const
{
  say(fmt::format("{}: marching scales", spec.name));
  const BenchScene scene = make_scene(spec);
  const BenchSurface surface(scene);
  const RmipSizes sizes = rmip_sizes(scene);
  const Contenders contenders =
      make_all(surface, {traversal_spec(std::string(kExactMethod), DisplacementMethod::chord),
                         traversal_spec(std::string(kPublishedMethod), DisplacementMethod::tfdm),
                         traversal_spec(fmt::format("rmip {}²", sizes.low), DisplacementMethod::rmip, sizes.low),
                         traversal_spec(fmt::format("rmip {}²", sizes.equal), DisplacementMethod::rmip, sizes.equal),
                         traversal_spec(fmt::format("rmip {}²", sizes.high), DisplacementMethod::rmip, sizes.high),
                         traversal_spec("rmip-minmax", DisplacementMethod::rmip_minmax)});
  const BenchRays rays = bench_rays_make(scene, *contenders.front(), options.resolution, options.rays);
  Sweep sweep;
  sweep.title = fmt::format("{}: time of primary rays", spec.name);
  sweep.x_label = "marching scale, texels";
  sweep.y_label = "ns a ray";
  sweep.log_y = true;
  for (const auto& contender : contenders) sweep.lines.push_back({contender->spec().name, {}, {}});
  Sweep counts = sweep;
  counts.title = fmt::format("{}: work of primary rays", spec.name);
  counts.y_label = "bounds and texels a ray";
  for (int marching_scale = 1; marching_scale <= 256; marching_scale *= 2) {
    for (const auto& contender : contenders) {
      RmipOptions rmip_options;
      rmip_options.marching_scale = marching_scale;
      contender->set_rmip_options(rmip_options);
    }
    const std::vector<Measurement> measured =
        bench_measure(tracers_of(contenders), BenchRayKind::kPrimary, rays.of(BenchRayKind::kPrimary), options.rounds,
                      scene.texel_metres);
    for (std::size_t m = 0; m < measured.size(); ++m) {
      sweep.lines[m].x.push_back(marching_scale);
      sweep.lines[m].y.push_back(measured[m].nanoseconds);
      counts.lines[m].x.push_back(marching_scale);
      counts.lines[m].y.push_back(measured[m].bounds + measured[m].texels);
    }
  }
  results.marching.push_back(std::move(sweep));
  results.marching.push_back(std::move(counts));
}

void Study::add_sweeps(const BenchSceneSpec& spec) const
{
  const auto sweep_over = [&](const char* what, const auto& change_of, const std::vector<double>& factors) {
    Sweep sweep;
    sweep.title = fmt::format("{}: speed over TFDM by {}, primary rays", spec.name, what);
    sweep.x_label = fmt::format("factor of the {}", what);
    sweep.y_label = "times as fast";
    sweep.lines = {{std::string(kExactMethod), {}, {}}, {"rmip", {}, {}}, {"tfdm", {}, {}}};
    for (const double factor : factors) {
      say(fmt::format("{}: {} × {}", spec.name, what, factor));
      const BenchScene scene = make_scene(spec, change_of(factor));
      const BenchSurface surface(scene);
      const Contenders contenders =
          make_all(surface, {traversal_spec(std::string(kExactMethod), DisplacementMethod::chord),
                             traversal_spec("rmip", DisplacementMethod::rmip),
                             traversal_spec(std::string(kPublishedMethod), DisplacementMethod::tfdm)});
      const BenchRays rays = bench_rays_make(scene, *contenders.front(), options.resolution, options.rays);
      const std::vector<Measurement> measured =
          bench_measure(tracers_of(contenders), BenchRayKind::kPrimary, rays.of(BenchRayKind::kPrimary), options.rounds,
                        scene.texel_metres);
      for (std::size_t m = 0; m < measured.size(); ++m) {
        sweep.lines[m].x.push_back(factor);
        sweep.lines[m].y.push_back(measured.back().nanoseconds / measured[m].nanoseconds);
      }
    }
    results.sweeps.push_back(std::move(sweep));
  };
  sweep_over("displacement", [](double f) { return BenchSceneChange{1, f, 1}; }, {0.5, 1, 2, 4});
  sweep_over("tiles", [](double f) { return BenchSceneChange{1, 1, f}; }, {0.5, 1, 2, 4, 8});
}

void Study::add_inversion(const BenchSceneSpec& spec) const
{
  say(fmt::format("{}: inversion", spec.name));
  const BenchScene scene = make_scene(spec);
  const BenchSurface surface(scene);
  const RmipSizes sizes = rmip_sizes(scene);
  std::vector<ContenderSpec> specs;
  for (const int resolution : {sizes.low, sizes.equal, sizes.high}) {
    specs.push_back(traversal_spec(fmt::format("{}², with", resolution), DisplacementMethod::rmip, resolution));
    specs.push_back(specs.back());
    specs.back().name = fmt::format("{}², without", resolution);
    specs.back().rmip_options.reduce_by_inversion = false;
  }
  ContenderSpec variant = traversal_spec("split of the ray", DisplacementMethod::rmip, sizes.equal);
  variant.rmip_options.split = RmipSplit::kRay;
  specs.push_back(variant);
  variant = traversal_spec("two triangles a cell", DisplacementMethod::rmip, sizes.equal);
  variant.rmip_options.leaf = RmipLeaf::kTriangles;
  specs.push_back(variant);
  const Contenders contenders = make_all(surface, specs);
  const BenchRays rays = bench_rays_make(scene, *contenders.front(), options.resolution, options.rays);
  const auto measured = [&](BenchRayKind kind) {
    return bench_measure(tracers_of(contenders), kind, rays.of(kind), options.rounds, scene.texel_metres);
  };
  const std::vector<Measurement> primary = measured(BenchRayKind::kPrimary), bounce = measured(BenchRayKind::kBounce);
  for (std::size_t m = 0; m < contenders.size(); ++m) {
    results.inversion.push_back({std::string(spec.name), contenders[m]->spec().name, 1e3 / primary[m].nanoseconds,
                                 1e3 / bounce[m].nanoseconds, contenders[m]->build_seconds(), contenders[m]->bytes(),
                                 primary[m]});
  }
}

void Study::add_tessellation(const BenchSceneSpec& spec) const
{
  say(fmt::format("{}: tessellations", spec.name));
  // All variants are in memory at once, so that they can take turns: smaller maps make room.
  const BenchScene scene = make_scene(spec, {0.5, 1, 1});
  const BenchSurface surface(scene);
  const std::uint64_t share = options.tessellation_bytes / 5;
  constexpr DisplacementMethod kTriangles = DisplacementMethod::tessellate,
                               kGrids = DisplacementMethod::tessellate_grid;
  const Contenders contenders = make_all(
      surface, {tessellation_spec("triangles, medium", kTriangles, share, {RTC_BUILD_QUALITY_MEDIUM, false}),
                tessellation_spec("triangles, high", kTriangles, share, {RTC_BUILD_QUALITY_HIGH, false}),
                tessellation_spec("triangles, medium, compact", kTriangles, share, {RTC_BUILD_QUALITY_MEDIUM, true}),
                tessellation_spec("triangles, high, compact", kTriangles, share, {RTC_BUILD_QUALITY_HIGH, true}),
                tessellation_spec("grids", kGrids, share),
                traversal_spec(std::string(kExactMethod), DisplacementMethod::chord)});
  const BenchRays rays = bench_rays_make(scene, *contenders.back(), options.resolution);
  const auto measured = [&](BenchRayKind kind) {
    return bench_measure(tracers_of(contenders), kind, rays.of(kind), options.rounds, scene.texel_metres);
  };
  const std::vector<Measurement> primary = measured(BenchRayKind::kPrimary), bounce = measured(BenchRayKind::kBounce);
  for (std::size_t m = 0; m < contenders.size(); ++m) {
    results.tessellation.push_back({std::string(spec.name), contenders[m]->spec().name, 1e3 / primary[m].nanoseconds,
                                    1e3 / bounce[m].nanoseconds, contenders[m]->build_seconds(), contenders[m]->bytes(),
                                    primary[m]});
  }
}

void Study::add_costs(const BenchSceneSpec& spec) const
{
  for (const double factor : {1.0 / 16, 1.0 / 8, 1.0 / 4, 1.0 / 2}) {
    say(fmt::format("{}: costs, map × {}", spec.name, factor));
    const BenchScene scene = make_scene(spec, {factor, 1, 1});
    const BenchSurface surface(scene);
    std::vector<ContenderSpec> specs;
    for (const DisplacementMethod method : kDisplacementMethods) {
      const DisplacementMethodEntry& entry = displacement_method(method);
      const std::string name(displacement_method_label(method));
      if (entry.cost) specs.push_back(tessellation_spec(name, method, options.tessellation_bytes / 2));
    }
    const Contenders contenders = make_all(surface, specs);
    const BenchRays rays = bench_rays_make(scene, *contenders.front(), options.resolution, options.rays);
    std::vector<double> nanoseconds(contenders.size());
    for (const BenchRayKind kind : {BenchRayKind::kPrimary, BenchRayKind::kBounce, BenchRayKind::kShadow}) {
      const std::vector<Measurement> measured =
          bench_measure(tracers_of(contenders), kind, rays.of(kind), options.rounds, scene.texel_metres);
      for (std::size_t m = 0; m < measured.size(); ++m) nanoseconds[m] += measured[m].nanoseconds / kNumBenchRayKinds;
    }
    const auto threads =
        static_cast<double>(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism));
    for (std::size_t m = 0; m < contenders.size(); ++m) {
      const std::uint64_t count = contenders[m]->num_micro_triangles();
      const double build =
          count > 0 ? 1e9 * contenders[m]->build_seconds() * threads / static_cast<double>(count) : 0.0;
      results.costs.push_back({std::string(spec.name), specs[m].method, count, nanoseconds[m], build});
    }
  }
}

void Study::add_frames(const BenchSceneSpec& spec) const
{
  say(fmt::format("{}: frames", spec.name));
  const BenchScene scene = make_scene(spec);
  for (FrameResult& frame : bench_frames(scene, options.resolution, options.rounds, options.tessellation_bytes)) {
    results.frames.push_back(std::move(frame));
  }
}

std::vector<const BenchSceneSpec*> chosen_scenes(const std::vector<std::string>& names)
{
  std::vector<const BenchSceneSpec*> chosen;
  std::string known;
  for (const BenchSceneSpec& spec : bench_scene_specs()) {
    if (names.empty() || std::find(names.begin(), names.end(), spec.name) != names.end()) chosen.push_back(&spec);
    known += (known.empty() ? "" : ", ") + std::string(spec.name);
  }
  for (const std::string& name : names) {
    const auto is_it = [&](const BenchSceneSpec* spec) { return spec->name == name; };
    if (std::none_of(chosen.begin(), chosen.end(), is_it)) {
      throw std::invalid_argument(fmt::format("expected scenes among {}, found '{}'", known, name));
    }
  }
  return chosen;
}

}  // namespace

std::vector<FittedCost> fitted_costs(const std::vector<CostSample>& samples)
{
  std::vector<FittedCost> fits;
  for (const DisplacementMethod method : kDisplacementMethods) {
    double count = 0, x = 0, y = 0, xx = 0, xy = 0, build = 0;
    for (const CostSample& sample : samples) {
      if (sample.method != method) continue;
      const double doublings =
          sample.num_micro_triangles > 0 ? std::log2(static_cast<double>(sample.num_micro_triangles) / (1 << 20)) : 0.0;
      count += 1;
      x += doublings;
      y += sample.ray;
      xx += doublings * doublings;
      xy += doublings * sample.ray;
      build += sample.build;
    }
    if (count == 0) continue;
    MethodCost cost;
    const double spread = xx - x * x / count;
    if (spread > 0) cost.ray_doubling = (xy - x * y / count) / spread;
    cost.ray = (y - cost.ray_doubling * x) / count;
    cost.build = build / count;
    fits.push_back({method, cost});
  }
  return fits;
}

BenchResults bench_displacement_run(const BenchOptions& options)
{
  BenchResults results;
  results.isa = traversal_table_select().isa;
  results.is_own = options.own != nullptr;
  results.map_scale = results.is_own ? 1 : options.map_scale;
  results.resolution = options.resolution;
  results.rounds = options.rounds;
  const Study study{options, results};
  const std::vector<const BenchSceneSpec*> scenes =
      options.own != nullptr ? std::vector{&options.own->spec()} : chosen_scenes(options.scenes);
  for (const BenchSceneSpec* spec : scenes) {
    // The paper's plots have these scenes; of others, at the same cost each, there are plots where scenes are named.
    const bool is_named = options.own != nullptr || !options.scenes.empty();
    const bool for_sweeps = spec->name == "sphere" || spec->name == "roof";
    if (options.parts.table) study.add_table(*spec);
    if (options.parts.marching && (is_named || spec->name == "armor" || spec->name == "ninja-head"))
      study.add_marching(*spec);
    if (options.parts.sweeps && (is_named || for_sweeps)) study.add_sweeps(*spec);
    if (options.parts.inversion) study.add_inversion(*spec);
    if (options.parts.tessellation && spec->name == "roof") study.add_tessellation(*spec);
    if (options.parts.costs && (for_sweeps || spec->name == "glass")) study.add_costs(*spec);
    if (options.parts.frames) study.add_frames(*spec);
  }
  // Of scenes of its own, so that neither a named one nor a mesh and map has it.
  if (options.parts.vectors && options.own == nullptr && options.scenes.empty())
    results.vectors = bench_vector_run(options.resolution, options.rounds, options.vector_shrink, options.progress);
  return results;
}

}  // namespace relief
