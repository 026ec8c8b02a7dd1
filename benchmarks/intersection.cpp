// What Embree can do with the rays of a render, and what the renderer makes of it.
//
//   relief_bench_intersection SCENE [--resolution WxH] [--rounds N] [--json FILE]
//
// The rays of one sample a pixel are recorded from the renderer and then traced again out of a plain array, one thread,
// one rtcIntersect1 or rtcOccluded1 a ray: the raw rate. Beside it stand the renderer's own stages on the same scene, one
// thread too. Rounds alternate between both, so that whatever else the machine does hits both alike.
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "exporters/atomic_file.h"
#include "integrator/flush_denormals.h"
#include "integrator/scene_context.h"
#include "integrator/trace.h"
#include "scene/load.h"

namespace relief {

namespace {

using Clock = std::chrono::steady_clock;
enum class RayKind : std::size_t { kCamera, kBounce, kShadow };
constexpr std::array kKindNames = {"camera", "bounce", "shadow"};
constexpr std::array kKindMasks = {kRayCamera, kRayBounce, kRayShadow};
/// Samples of a batch of the renderer, as in render(): tiles of 16 × 16 pixels fill one.
constexpr std::uint32_t kBatchSamples = kBatchPaths / (kTileSize * kTileSize);

struct Rounds {
  std::vector<double> seconds;
  double best() const { return *std::min_element(seconds.begin(), seconds.end()); }
  double median() const
  {
    std::vector<double> sorted = seconds;
    std::sort(sorted.begin(), sorted.end());
    return sorted[sorted.size() / 2];
  }
};

/// Everything both sides need of one scene.
struct Bench {
  Bench(const Scene& scene, RenderOptions chosen)
      : context(scene),
        // No filter: a surface that lets light through in part stops a shadow ray here.
        accel(scene, context.lights.lights, context.lights.area_lights, context.displacements, context, nullptr),
        options(std::move(chosen)),
        film(options.settings.width, options.settings.height, options.aov_mask)
  {
    pixel_filter_table_make(options.settings.filter, filter);
    globals = render_globals(context, options, filter);
    globals.film = film.accumulator();
  }

  Batch batch(int tile, std::uint32_t num_samples) const
  {
    Batch result;
    film.tile_rect(tile, &result.x0, &result.y0, &result.width, &result.height);
    result.num_samples = num_samples;
    return result;
  }

  SceneContext context;
  Accel accel;
  RenderOptions options;
  Film film;
  FilterTable filter;
  KernelGlobals globals;
};

using RayLists = std::array<std::vector<RecordedRay>, 3>;

/// Rays of the first sample of every pixel, by kind, in the order in which the renderer traced them.
RayLists record_rays(const Bench& bench)
{
  RayLists lists;
  Wavefront wavefront({});
  std::vector<RecordedRay> rays;
  wavefront.recorder = &rays;
  for (int tile = 0; tile < bench.film.num_tiles(); ++tile) {
    rays.clear();
    const Batch batch = bench.batch(tile, 1);
    wavefront.run(bench.globals, *bench.context.accel, stage_table_select(), bench.context.surface_kernel, batch);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const bool is_camera = i < static_cast<std::size_t>(batch.width * batch.height);
      const RayKind kind = rays[i].shadow ? RayKind::kShadow : is_camera ? RayKind::kCamera : RayKind::kBounce;
      lists[static_cast<std::size_t>(kind)].push_back(rays[i]);
    }
  }
  return lists;
}

void fill(RTCRay& to, const RecordedRay& ray, std::uint32_t mask)
{
  to.org_x = ray.O.x;
  to.org_y = ray.O.y;
  to.org_z = ray.O.z;
  to.dir_x = ray.D.x;
  to.dir_y = ray.D.y;
  to.dir_z = ray.D.z;
  to.tnear = ray.t_min;
  to.tfar = ray.t_max;
  to.time = 0;
  to.mask = mask;
  to.id = to.flags = 0;
}

/// Traces all rays of one kind. @return seconds
double trace_raw(const Accel& accel, const std::vector<RecordedRay>& rays, RayKind kind, std::uint64_t* num_hits)
{
  const std::uint32_t mask = kKindMasks[static_cast<std::size_t>(kind)];
  EmbreeContext context;
  embree_context_init(context, kind == RayKind::kCamera);
  const Clock::time_point start = Clock::now();
  for (const RecordedRay& ray : rays) {
    RTCRayHit query;
    fill(query.ray, ray, mask);
    if (kind == RayKind::kShadow) {
      accel.occluded(context, query.ray);
      *num_hits += query.ray.tfar < 0 ? 1 : 0;
      continue;
    }
    query.hit.geomID = query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    accel.intersect(context, query);
    *num_hits += query.hit.geomID != RTC_INVALID_GEOMETRY_ID ? 1 : 0;
  }
  return std::chrono::duration<double>(Clock::now() - start).count();
}

struct Measured {
  std::array<Rounds, 3> raw;
  std::array<Rounds, kNumStages> stages;
  Rounds frame;
  Counters counters;  ///< of one round of the renderer
};

Measured measure(Bench& bench, const RayLists& lists, int num_rounds)
{
  Measured result;
  std::uint64_t num_hits = 0;
  for (int round = 0; round < num_rounds; ++round) {
    for (std::size_t kind = 0; kind < lists.size(); ++kind) {
      result.raw[kind].seconds.push_back(trace_raw(bench.accel, lists[kind], static_cast<RayKind>(kind), &num_hits));
    }
    Wavefront wavefront({});
    const Clock::time_point start = Clock::now();
    for (int tile = 0; tile < bench.film.num_tiles(); ++tile) {
      wavefront.run(bench.globals, *bench.context.accel, stage_table_select(), bench.context.surface_kernel,
                    bench.batch(tile, kBatchSamples));
    }
    result.frame.seconds.push_back(std::chrono::duration<double>(Clock::now() - start).count());
    for (std::size_t s = 0; s < result.stages.size(); ++s) result.stages[s].seconds.push_back(wavefront.seconds[s]);
    result.counters = wavefront.counters;
  }
  fmt::print("{} rays of {} hit something\n", num_hits / static_cast<std::uint64_t>(num_rounds),
             lists[0].size() + lists[1].size() + lists[2].size());
  return result;
}

double mega_rate(double count, double seconds) { return seconds > 0 ? count / seconds * 1e-6 : 0; }

nlohmann::json report(const Measured& measured, const RayLists& lists)
{
  nlohmann::json json;
  fmt::print("\nEmbree alone, one thread     rays   Mrays/s best   median\n");
  double raw_seconds = 0, num_raw = 0;
  for (std::size_t k = 0; k < lists.size(); ++k) {
    const auto count = static_cast<double>(lists[k].size());
    const double best = mega_rate(count, measured.raw[k].best()), median = mega_rate(count, measured.raw[k].median());
    fmt::print("  {:<20}{:>11}{:>15.2f}{:>9.2f}\n", kKindNames[k], lists[k].size(), best, median);
    json["raw"][kKindNames[k]] = {{"rays", count}, {"mrays_per_second_best", best}, {"mrays_per_second", median}};
    raw_seconds += measured.raw[k].median();
    num_raw += count;
  }
  const Counters& c = measured.counters;
  const auto num_closest = static_cast<double>(c.camera_rays + c.bounce_rays),
             num_shadow = static_cast<double>(c.shadow_rays);
  const auto stage = [&](Stage s) { return measured.stages[static_cast<std::size_t>(s)].median(); };
  const double closest = stage(Stage::kIntersectClosest), shadow = stage(Stage::kIntersectShadow);
  const double frame = measured.frame.median();
  fmt::print("\nrelief, one thread, {} samples a pixel\n", kBatchSamples);
  fmt::print(
      "  closest hits, all kinds {:>7.2f} Mrays/s, shadows {:.2f} Mrays/s, all together {:.2f} Mrays/s of frame time\n",
      mega_rate(num_closest, closest), mega_rate(num_shadow, shadow), mega_rate(num_closest + num_shadow, frame));
  fmt::print("  in its intersection stages {:.1f} % of Embree alone on the mix of kinds\n",
             100 * mega_rate(num_closest + num_shadow, closest + shadow) / mega_rate(num_raw, raw_seconds));
  json["relief"] = {
      {"closest_mrays_per_second", mega_rate(num_closest, closest)},
      {"shadow_mrays_per_second", mega_rate(num_shadow, shadow)},
      {"frame_seconds", frame},
      {"intersection_share", (closest + shadow) / frame},
      {"fraction_of_raw", mega_rate(num_closest + num_shadow, closest + shadow) / mega_rate(num_raw, raw_seconds)}};
  fmt::print("  share of frame time:");
  for (std::size_t s = 0; s < measured.stages.size(); ++s) {
    const double share = measured.stages[s].median() / frame;
    fmt::print(" {} {:.1f} %{}", kStageNames[s], 100 * share, s + 1 < measured.stages.size() ? "," : "\n");
    json["relief"]["stage_share"][kStageNames[s]] = share;
  }
  return json;
}

}  // namespace

}  // namespace relief

int main(int argc, char** argv)
{
  using namespace relief;
  std::string file, resolution, json_path;
  int num_rounds = 5;
  CLI::App app("Embree's raw rate on a render's rays, beside the renderer's stages");
  app.add_option("scene", file, "Scene file (.gltf, .glb)")->required();
  app.add_option("--resolution", resolution, "WxH (default: the scene's)");
  app.add_option("--rounds", num_rounds, "Repetitions of each measurement")->check(CLI::Range(1, 100));
  app.add_option("--json", json_path, "Write the numbers here");
  CLI11_PARSE(app, argc, argv);
  try {
    const FlushDenormals flush;
    const Scene scene = scene_load(file);
    RenderOptions options;
    options.settings = scene.render;
    if (!resolution.empty() &&
        std::sscanf(resolution.c_str(), "%dx%d", &options.settings.width, &options.settings.height) != 2) {
      fmt::print(stderr, "relief_bench_intersection: --resolution: expected WxH\n");
      return 2;
    }
    options.camera = scene.cameras.front().camera;
    options.camera.half_width = options.camera.half_height * static_cast<float>(options.settings.width) /
                                static_cast<float>(options.settings.height);
    Bench bench(scene, options);
    const RayLists lists = record_rays(bench);
    nlohmann::json json = report(measure(bench, lists, num_rounds), lists);
    json["scene"] = file;
    json["isa"] = stage_table_select().isa;
    if (!json_path.empty()) atomic_write(json_path, json.dump(2) + "\n");
  } catch (const std::exception& error) {
    fmt::print(stderr, "relief_bench_intersection: {}\n", error.what());
    return 1;
  }
  return 0;
}
