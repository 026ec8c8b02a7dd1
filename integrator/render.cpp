#include "integrator/render.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "integrator/flush_denormals.h"
#include "integrator/photon_pass.h"
#include "integrator/scene_context.h"
#include "integrator/stages.h"
#include "integrator/wavefront.h"

namespace relief {

namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// Samples of the next pass. Passes are as large as a batch holds, but at the start, where the first picture and the
/// first measure of speed are wanted soon, and towards a time limit, which is kept by asking for less.
std::uint32_t pass_samples(std::uint32_t done, std::uint32_t wanted, double seconds, double time_limit)
{
  constexpr std::uint32_t kMostSamples = kBatchPaths / (kTileSize * kTileSize);
  std::uint32_t samples = std::min(wanted - done, kMostSamples);
  if (time_limit > 0) {
    samples = std::min(samples, std::max(done, 1u));
    const double per_sample = done > 0 ? seconds / done : 0.0;
    const double fitting = per_sample > 0 ? (time_limit - seconds) / per_sample : 1.0;
    samples = std::min(samples, static_cast<std::uint32_t>(std::max(1.0, fitting)));
  }
  return samples;
}

/// A noise threshold is first looked at after this many samples: below, the estimate of the error is itself noise.
constexpr std::uint32_t kMinAdaptiveSamples = 16;

/// @param sample  pixel of the film << 32 | sample
std::string nonfinite_warning(std::uint64_t sample, int crop_x, int crop_y, int film_width)
{
  const std::uint64_t pixel = sample >> 32;
  const auto width = static_cast<std::uint64_t>(film_width);
  return "samples that were not finite count as black, first at pixel " +
         std::to_string(crop_x + static_cast<int>(pixel % width)) + "," +
         std::to_string(crop_y + static_cast<int>(pixel / width)) + " sample " + std::to_string(sample & 0xffffffffu) +
         " (see relief trace --pixel)";
}

bool is_whole(const RenderOptions& options)
{
  return options.crop_x1 <= options.crop_x0 || options.crop_y1 <= options.crop_y0;
}

}  // namespace

KernelGlobals render_globals(const SceneContext& context, const RenderOptions& options, const FilterTable& filter)
{
  const RenderSettings& settings = options.settings;
  KernelGlobals g = context.globals;
  g.camera = options.camera;
  g.camera_forward = normalize(-options.camera.world_from_camera.z);
  // A path counts in bytes; between mirrors that take nothing only this ends it.
  constexpr int kMostBounces = 200;
  g.limits = {std::min(settings.max_bounces, kMostBounces), settings.diffuse_bounces, settings.glossy_bounces,
              settings.transmission_bounces, settings.transparent_bounces};
  g.clamp_indirect = settings.clamp_indirect;
  g.light_technique = options.light_technique;
  g.filter = settings.filter == PixelFilter::kBox ? nullptr : &filter;
  g.filter_width = settings.filter_width;
  g.seed = settings.seed;
  g.log2_stream = sample_log2_stream(static_cast<std::uint32_t>(settings.samples));
  g.full_width = settings.width;
  g.full_height = settings.height;
  g.crop_x = is_whole(options) ? 0 : options.crop_x0;
  g.crop_y = is_whole(options) ? 0 : options.crop_y0;
  return g;
}

RenderedImage render(const Scene& scene,
                     const RenderOptions& options,
                     const std::atomic<bool>& stop,
                     const std::function<void(const RenderProgress&)>& progress,
                     Statistics& stats)
{
  const Clock::time_point build_start = Clock::now();
  const RenderSettings& settings = options.settings;
  DisplacementOptions displacement = options.displacement;
  displacement.num_rays = expected_rays(settings);
  const bool light_sampling_alone = options.light_technique == LightTechnique::kLightSampling;
  SceneContext context(scene, displacement,
                       light_sampling_alone ? EnvironmentDensity::kRadiance : EnvironmentDensity::kExcess,
                       settings.caustics);
  for (std::string& text : context.displacements.warnings()) stats.warnings.push_back(std::move(text));
  const StageTable& stages = stage_table_select();

  const bool whole = is_whole(options);
  const int crop_x = whole ? 0 : options.crop_x0;
  const int crop_y = whole ? 0 : options.crop_y0;
  Film film(whole ? settings.width : options.crop_x1 - crop_x, whole ? settings.height : options.crop_y1 - crop_y,
            options.aov_mask);

  FilterTable filter;
  blackman_harris_table_make(filter);
  KernelGlobals g = render_globals(context, options, filter);
  g.film = film.accumulator();
  const bool caustics = g.caustics.enabled;
  std::optional<PhotonPass> photons;
  if (caustics) photons.emplace(context, settings.caustics, static_cast<double>(settings.width) * settings.height);
  stats.build_seconds = seconds_since(build_start);

  const Clock::time_point start = Clock::now();
  tbb::enumerable_thread_specific<Wavefront> workers([caustics] { return Wavefront(caustics); });
  std::atomic<std::uint64_t> samples_done{0};
  std::atomic<std::uint64_t> rays_done{0};
  std::mutex progress_mutex;
  Clock::time_point last_report = start;
  double last_fraction = 0;
  // Part of the time that photons take. Until the first pass has been timed, the middle of the 0.26 to 0.73 that they take on
  // the scenes of benchmarks/caustics.
  double photon_share = 0.5;
  const double num_pixels = static_cast<double>(film.width()) * film.height();
  const auto wanted = static_cast<std::uint32_t>(settings.samples);

  const auto report = [&](bool now) {
    if (!progress) return;
    const std::unique_lock lock(progress_mutex, std::try_to_lock);
    if (!lock.owns_lock() || (!now && seconds_since(last_report) < 0.2)) return;
    last_report = Clock::now();
    RenderProgress p;
    p.seconds = seconds_since(start);
    p.samples_per_pixel = static_cast<double>(samples_done.load()) / num_pixels;
    p.fraction = p.samples_per_pixel / wanted;
    if (photons) {
      p.photons = photons->photons();
      p.fraction += photon_share * (photons->passes() - p.samples_per_pixel) / wanted;
    }
    if (options.time_limit_seconds > 0) p.fraction = std::max(p.fraction, p.seconds / options.time_limit_seconds);
    p.fraction = std::clamp(p.fraction, last_fraction, 1.0);
    last_fraction = p.fraction;
    p.seconds_left = p.fraction > 0 ? p.seconds / p.fraction - p.seconds : 0;
    p.rays_per_second = p.seconds > 0 ? static_cast<double>(rays_done.load()) / p.seconds : 0;
    progress(p);
  };

  std::vector<int> active(static_cast<std::size_t>(film.num_tiles()));
  for (int tile = 0; tile < film.num_tiles(); ++tile) active[static_cast<std::size_t>(tile)] = tile;

  stats.stop_reason = "samples";
  for (std::uint32_t done = 0; done < wanted && !active.empty();) {
    // Photons are of one sample: see PhotonPass::next.
    const std::uint32_t samples =
        caustics ? 1 : pass_samples(done, wanted, seconds_since(start), options.time_limit_seconds);
    if (photons) {
      photons->next(
          g, stages, [&]() -> Wavefront& { return workers.local(); }, stop, [&] { report(false); });
    }
    tbb::parallel_for(
        std::size_t{0}, active.size(),
        [&](std::size_t i) {
          if (stop.load(std::memory_order_relaxed)) return;
          const FlushDenormals flush;
          Wavefront& worker = workers.local();
          const std::uint64_t rays_before =
              worker.counters.camera_rays + worker.counters.bounce_rays + worker.counters.shadow_rays;
          Batch batch;
          film.tile_rect(active[i], &batch.x0, &batch.y0, &batch.width, &batch.height);
          batch.first_sample = done;
          batch.num_samples = samples;
          worker.run(g, *context.accel, stages, context.surface_kernel, batch);
          film.add_tile_samples(active[i], samples);
          samples_done += batch.num_paths();
          rays_done +=
              worker.counters.camera_rays + worker.counters.bounce_rays + worker.counters.shadow_rays - rays_before;
          report(false);
        },
        tbb::simple_partitioner());
    if (stop.load()) {
      stats.stop_reason = "interrupted";
      break;
    }
    done += samples;
    if (photons) photon_share = photons->seconds() / seconds_since(start);
    if (settings.noise_threshold > 0 && done >= kMinAdaptiveSamples) {
      // A tenth of the picture's mean: dark corners need not be cleaner than the eye can tell.
      const double floor = 0.1 * film.mean_luminance();
      std::erase_if(active, [&](int tile) { return film.tile_error(tile, floor) <= settings.noise_threshold; });
      if (active.empty() && done < wanted) stats.stop_reason = "noise_threshold";
    }
    if (options.time_limit_seconds > 0 && seconds_since(start) >= options.time_limit_seconds && done < wanted) {
      stats.stop_reason = "time_limit";
      break;
    }
  }
  report(true);

  stats.render_seconds = seconds_since(start);
  stats.isa = stages.isa;
  stats.seed = settings.seed;
  stats.width = settings.width;
  stats.height = settings.height;
  stats.threads = tbb::this_task_arena::max_concurrency();
  stats.samples_per_pixel = film.mean_samples();
  stats.caustics.reason = context.caustics_reason;
  if (photons) photons->fill(stats.caustics);
  const ImageError error = film.estimate_error();
  stats.error_rmse = error.rmse;
  stats.error_relmse = error.relmse;
  context.fill(stats);
  stats.film_bytes = film.bytes();
  stats.path_state_bytes = workers.size() * Wavefront::bytes(caustics);
  stats.stages.clear();
  for (const char* name : kStageNames) stats.stages.push_back({name, 0.0});
  std::uint64_t first_nonfinite = kNoSample;
  for (const Wavefront& worker : workers) {
    counters_add(stats.counters, worker.counters);
    stats.displacement.most_steps =
        std::max<std::uint64_t>(stats.displacement.most_steps, worker.most_displacement_steps);
    for (std::size_t s = 0; s < stats.stages.size(); ++s) stats.stages[s].seconds += worker.seconds[s];
    first_nonfinite = std::min(first_nonfinite, worker.first_nonfinite);
  }
  if (first_nonfinite != kNoSample) {
    stats.warnings.push_back(nonfinite_warning(first_nonfinite, crop_x, crop_y, film.width()));
  }
  return std::move(film).resolve(crop_x, crop_y, settings.width, settings.height);
}

}  // namespace relief
