#include "integrator/render.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdio>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "integrator/camera_medium.h"
#include "integrator/checkpoint.h"
#include "integrator/error_history.h"
#include "integrator/flush_denormals.h"
#include "integrator/media.h"
#include "integrator/photon_benefit.h"
#include "integrator/photon_pass.h"
#include "integrator/scene_context.h"
#include "integrator/stages.h"
#include "integrator/wavefront.h"
#include "kernel/bsdf/closure_kinds.h"
#include "scene/cryptomatte.h"
#include "scene/memory.h"

namespace relief {

namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

std::uint32_t samples_wanted(const RenderOptions& options)
{
  return options.num_samples > 0 ? options.num_samples : static_cast<std::uint32_t>(options.settings.samples);
}

/// Samples of the next pass. Passes are as large as a batch holds, but at the start, where the first picture and the
/// first measure of speed are wanted soon, and towards a time limit, which is kept by asking for less. Whatever was asked for
/// before, they come to multiples of kMostPassSamples, after which noise is judged.
/// @param is_watched  the picture is shown between passes: they begin with one sample, and slow ones are smaller
/// @param most        samples after which a checkpoint may be due
std::uint32_t pass_samples(std::uint32_t done,
                           std::uint32_t wanted,
                           double seconds,
                           double time_limit,
                           bool is_watched,
                           std::uint32_t most)
{
  std::uint32_t samples = std::min({wanted - done, kMostPassSamples - done % kMostPassSamples, most});
  const double per_sample = done > 0 ? seconds / done : 0.0;
  if (is_watched) {
    constexpr double kLongestSeconds = 4;
    constexpr std::uint32_t kLeastSamples = 4;  // fewer would leave batches too empty
    samples = std::min(samples, std::max(done, 1u));
    if (per_sample * kMostPassSamples > kLongestSeconds) {
      samples = std::min(samples, std::max(kLeastSamples, static_cast<std::uint32_t>(kLongestSeconds / per_sample)));
    }
  }
  if (time_limit > 0) {
    samples = std::min(samples, std::max(done, 1u));
    const double fitting = per_sample > 0 ? (time_limit - seconds) / per_sample : 1.0;
    // In doubles: a day has room for more samples of a small picture than 32 bits can count.
    samples = static_cast<std::uint32_t>(std::min<double>(samples, std::max(1.0, fitting)));
  }
  return samples;
}

/// Samples after which pixels are judged for the first time: Cycles' numbers.
std::uint32_t least_samples(const RenderSettings& settings)
{
  constexpr int kLeast = 4;
  if (settings.min_samples > 0) return static_cast<std::uint32_t>(std::max(settings.min_samples, kLeast));
  const double automatic = std::ceil(16.0 / std::pow(static_cast<double>(settings.noise_threshold), 0.3));
  return static_cast<std::uint32_t>(std::clamp(automatic, double{kLeast}, double{kLargestSettingInt}));
}

/// Samples between two times at which noise is judged.
constexpr std::uint32_t kJudgingStep = 16;

/// Whether pixels are judged after a number of samples.
bool is_judged_after(const RenderSettings& settings, std::uint32_t samples)
{
  return settings.noise_threshold > 0 && samples % kJudgingStep == 0 && samples > least_samples(settings) + 1;
}

/// When pixels are judged once some samples are done.
NoiseJudging judging_after(const RenderSettings& settings, std::uint32_t done, std::uint32_t wanted)
{
  const std::uint32_t before = std::max(done, least_samples(settings) + 1);
  return {before - before % kJudgingStep + kJudgingStep, kJudgingStep, wanted};
}

/// @param sample  pixel of the window << 32 | sample
PixelSample pixel_sample(std::uint64_t sample, const FilmWindow& window)
{
  const std::uint64_t pixel = sample >> 32;
  const auto width = static_cast<std::uint64_t>(window.width);
  return {window.x0 + static_cast<int>(pixel % width), window.y0 + static_cast<int>(pixel / width),
          static_cast<std::uint32_t>(sample)};
}

/// Says when sampling has to end although a pass is under way: when it is interrupted, or when the time is up and no
/// tile of the pass gets done any more. A thread of its own, because those that sample may be in one long search.
class SamplingEnd {
 public:
  /// @param time_limit  seconds from now; 0: none
  SamplingEnd(const std::atomic<bool>& interrupted, double time_limit)
      : interrupted_(interrupted), start_(Clock::now()), time_limit_(time_limit), thread_([this] { watch(); })
  {
  }
  ~SamplingEnd()
  {
    {
      const std::lock_guard lock(mutex_);
      done_ = true;
    }
    wake_.notify_one();
    thread_.join();
  }
  SamplingEnd(const SamplingEnd&) = delete;
  SamplingEnd& operator=(const SamplingEnd&) = delete;

  const std::atomic<bool>& reached() const { return reached_; }
  /// Called by any thread that has finished a tile, or as much.
  void note_progress() { last_progress_ = seconds_since(start_); }

 private:
  void watch()
  {
    // A signal is answered within the one, a pass that no longer moves ended after the other.
    constexpr auto kInterval = std::chrono::milliseconds(50);
    constexpr double kPatience = 0.5;
    std::unique_lock lock(mutex_);
    while (!wake_.wait_for(lock, kInterval, [this] { return done_; })) {
      const double now = seconds_since(start_);
      const bool is_stuck = time_limit_ > 0 && now >= time_limit_ && now - last_progress_ >= kPatience;
      if (interrupted_ || is_stuck) reached_ = true;
    }
  }

  const std::atomic<bool>& interrupted_;
  const Clock::time_point start_;
  const double time_limit_;
  std::atomic<double> last_progress_{0};  ///< seconds from the start
  std::atomic<bool> reached_{false};
  std::mutex mutex_;
  std::condition_variable wake_;
  bool done_ = false;
  std::thread thread_;  ///< the last member: it uses all others
};

/// @param part  of the picture, 0…1
std::string empty_part_warning(double part)
{
  char percent[16];
  std::snprintf(percent, sizeof percent, "%.2g", 100 * part);
  return "the time limit ended the first pass: " + std::string(percent) +
         " % of the picture has no sample and is black";
}

}  // namespace

FilmWindow render_window(const RenderOptions& options)
{
  const bool is_whole = options.crop_x1 <= options.crop_x0 || options.crop_y1 <= options.crop_y0;
  if (is_whole) return {0, 0, options.settings.width, options.settings.height};
  return {options.crop_x0, options.crop_y0, options.crop_x1 - options.crop_x0, options.crop_y1 - options.crop_y0};
}

namespace {

/// How a render's context is made.
ContextOptions context_options(const RenderOptions& options)
{
  DisplacementOptions displacement = options.displacement;
  displacement.dicing_bytes = memory_limit().bytes / 8;
  displacement.num_rays = expected_rays(options.settings);
  displacement.camera = options.camera;
  displacement.picture_height = options.settings.height;
  const bool light_sampling_alone = options.light_technique == LightTechnique::kLightSampling;
  return {displacement, light_sampling_alone ? EnvironmentDensity::kRadiance : EnvironmentDensity::kExcess,
          options.settings.caustics.mode, options.trees, options.settings.caustics.kinds};
}

}  // namespace

void pixel_filter_table_make(PixelFilter filter, FilterTable& table)
{
  filter_table_make(filter == PixelFilter::kGaussian ? gaussian : blackman_harris, table);
}

SceneContext render_context(const Scene& scene, const RenderOptions& options)
{
  return context_make(scene, context_options(options));
}

KernelGlobals render_globals(const SceneContext& context, const RenderOptions& options, const FilterTable& filter)
{
  const RenderSettings& settings = options.settings;
  KernelGlobals g = context.globals;
  g.camera = options.camera;
  g.camera_forward = normalize(-options.camera.world_from_camera.z);
  g.camera_motion = context.motion.view(options.camera_motion_index);
  g.graph_scene.camera = options.camera;
  g.graph_scene.camera_from_world = inverse(options.camera.world_from_camera);
  // A path counts in bytes; between mirrors that take nothing only this ends it.
  constexpr int kMostBounces = 200;
  g.limits = {std::min(settings.max_bounces, kMostBounces),
              settings.diffuse_bounces,
              settings.glossy_bounces,
              settings.transmission_bounces,
              settings.transparent_bounces,
              settings.volume_bounces};
  g.clamp_direct = settings.clamp_direct;
  g.clamp_indirect = settings.clamp_indirect;
  g.filter_glossy = settings.filter_glossy;
  g.light_technique = options.light_technique;
  g.filter = settings.filter == PixelFilter::kBox ? nullptr : &filter;
  g.filter_width = settings.filter_width;
  g.seed = settings.seed;
  g.mist = settings.mist;
  g.occlusion_distance = settings.occlusion_distance;
  const auto planned = static_cast<std::uint32_t>(settings.samples);
  g.log2_stream =
      sample_log2_stream(settings.noise_threshold > 0 ? std::min(least_samples(settings), planned) : planned);
  g.full_width = settings.width;
  g.full_height = settings.height;
  const FilmWindow window = render_window(options);
  g.crop_x = window.x0;
  g.crop_y = window.y0;
  return g;
}

Batch tile_batch(const Film& film, int tile, std::uint32_t first_sample, std::uint32_t num_samples)
{
  Batch batch;
  film.tile_rect(tile, &batch.x0, &batch.y0, &batch.width, &batch.height);
  batch.first_sample = first_sample;
  batch.num_samples = num_samples;
  return batch;
}

namespace {

std::uint64_t rays_of(const Counters& c) { return c.camera_rays + c.bounce_rays + c.shadow_rays; }

/// Whether something may be a hole in the picture.
bool has_holdouts(const Scene& scene)
{
  const auto is_holdout = [](const SurfaceClosureSpec& closure) { return closure.kind == ClosureKind::holdout; };
  return std::any_of(scene.instances.begin(), scene.instances.end(),
                     [](const Instance& instance) { return (instance.flags & kHoldout) != 0; }) ||
         std::any_of(scene.graphs.begin(), scene.graphs.end(), [&](const GraphProgram& graph) {
           return std::any_of(graph.closures.begin(), graph.closures.end(), is_holdout);
         });
}

/// How fast work was done lately: what a render begins with is slower or faster than what follows.
class RecentSpeed {
 public:
  void note(double seconds, double work)
  {
    if (seconds < 2 * later_.seconds) return;
    earlier_ = later_;
    later_ = {seconds, work};
  }
  /// Work a second since a time between a quarter and half of all ago; 0: there was none.
  double get(double seconds, double work) const
  {
    const double passed = seconds - earlier_.seconds;
    return passed > 0 ? std::max(work - earlier_.work, 0.0) / passed : 0;
  }

 private:
  struct Moment {
    double seconds = 0, work = 0;
  };
  Moment earlier_, later_;
};

/// Tells how far a render is, from whichever thread, a few times a second.
class ProgressReporter {
 public:
  ProgressReporter(const RenderOptions& options,
                   const std::function<void(const RenderProgress&)>& progress,
                   double num_pixels,
                   Clock::time_point start)
      : options_(options), progress_(progress), num_pixels_(num_pixels), start_(start), wanted_(samples_wanted(options))
  {
    // Most pictures with a noise threshold end long before the most samples that there may be: a guess, until noise has been seen.
    const std::uint32_t most = samples_wanted(options);
    if (options.settings.noise_threshold > 0) {
      wanted_ = std::min<double>(most, 2.0 * judging_after(options.settings, 0, most).next);
    }
  }
  bool is_watched() const { return static_cast<bool>(progress_); }
  void add(std::uint64_t samples, std::uint64_t rays)
  {
    samples_ += samples;
    rays_ += rays;
  }
  void set_photon_share(double share) { photon_share_ = share; }
  /// @param wanted  samples that the mean pixel will have had at the end
  void set_wanted(double wanted) { wanted_ = wanted; }

  /// @param now      however short ago the last report was
  /// @param photons  null: there is no photon pass
  void report(bool now, const PhotonPass* photons)
  {
    if (!progress_) return;
    const std::unique_lock lock(mutex_, std::try_to_lock);
    if (!lock.owns_lock() || (!now && seconds_since(last_) < 0.2)) return;
    last_ = Clock::now();
    RenderProgress p;
    p.seconds = seconds_since(start_);
    p.samples_per_pixel = static_cast<double>(samples_.load()) / num_pixels_;
    double work = p.samples_per_pixel;
    if (photons != nullptr) {
      p.photons = photons->photons();
      work += photon_share_ * (photons->passes() - p.samples_per_pixel);
    }
    p.fraction = work / wanted_;
    const double speed = speed_.get(p.seconds, work);
    speed_.note(p.seconds, work);
    p.seconds_left = speed > 0 ? std::max(wanted_ - work, 0.0) / speed : 0;
    if (options_.time_limit_seconds > 0) {
      p.fraction = std::max(p.fraction, p.seconds / options_.time_limit_seconds);
      const double most_left = std::max(options_.time_limit_seconds - p.seconds, 0.0);
      p.seconds_left = speed > 0 ? std::min(p.seconds_left, most_left) : most_left;
    }
    p.fraction = std::clamp(p.fraction, last_fraction_, 1.0);
    last_fraction_ = p.fraction;
    p.rays_per_second = p.seconds > 0 ? static_cast<double>(rays_.load()) / p.seconds : 0;
    progress_(p);
  }

 private:
  const RenderOptions& options_;
  const std::function<void(const RenderProgress&)>& progress_;
  double num_pixels_;
  Clock::time_point start_, last_ = Clock::now();
  std::atomic<std::uint64_t> samples_{0}, rays_{0};
  std::mutex mutex_;
  double wanted_, last_fraction_ = 0;
  RecentSpeed speed_;
  /// Part of the time that photons take. Until the first pass has been timed, the middle of the 0.26 to 0.73 that they take on
  /// the scenes of benchmarks/caustics.
  double photon_share_ = 0.5;
};

/// When previews are shown: they get a hundredth of the time, and a little more for the first ones, which change the most.
class PreviewSchedule {
 public:
  bool is_due(double seconds) const
  {
    constexpr double kShare = 0.01, kFirstSeconds = 0.2;
    return seconds >= next_ && spent_ <= kFirstSeconds + kShare * seconds;
  }
  void note(double before, double after)
  {
    constexpr double kInterval = 0.5;
    spent_ += after - before;
    next_ = after + kInterval;
  }

 private:
  double spent_ = 0, next_ = 0;
};

void fill_film(Statistics& stats, const Film& film, const RenderSettings& settings)
{
  stats.seed = settings.seed;
  stats.width = settings.width;
  stats.height = settings.height;
  stats.samples_per_pixel = film.mean_samples();
  const ImageError error = film.estimate_error();
  stats.error_rmse = error.rmse * static_cast<double>(settings.film_exposure);
  stats.error_relmse = error.relmse;
  stats.film_bytes = film.bytes();
}

/// What all workers have done.
void fill_work(Statistics& stats, const Workers& workers, std::size_t worker_bytes, const FilmWindow& window)
{
  stats.threads = tbb::this_task_arena::max_concurrency();
  stats.path_state_bytes = workers.size() * worker_bytes;
  RenderState work;
  state_add_work(work, workers);
  stats.counters = work.counters;
  stats.displacement.most_steps = work.most_displacement_steps;
  stats.stages.clear();
  for (std::size_t s = 0; s < kStageNames.size(); ++s) stats.stages.push_back({kStageNames[s], work.stage_seconds[s]});
  if (work.first_nonfinite != kNoSample) stats.first_nonfinite = pixel_sample(work.first_nonfinite, window);
}

/// What of the context was there before.
void fill_kept(KeptStatistics& stats, const KeptContext& kept, const SceneContext& context)
{
  stats.preparation = kept.is_kept();
  if (kept.is_kept()) {
    stats.bytes += context.accel->bytes() + context.lights.bytes() + context.displacements.bytes();
    stats.seconds += kept.seconds();
    return;
  }
  const HeightFields::Tally& fields = context.displacements.kept();
  const KeptMeshes::Tally& displaced = context.displacements.kept_meshes();
  const KeptTrees::Tally& trees = context.accel->kept();
  stats.height_fields += fields.count;
  stats.meshes += displaced.count + trees.count;
  stats.bytes += fields.bytes + displaced.bytes + trees.bytes;
  stats.seconds += fields.seconds + displaced.seconds + trees.seconds;
}

}  // namespace

RenderedImage render(const Scene& scene,
                     const RenderOptions& options,
                     const std::atomic<bool>& stop,
                     const std::function<void(const RenderProgress&)>& progress,
                     Statistics& stats)
{
  KeptContext nothing;
  return render(scene, options, stop, progress, nothing, stats);
}

RenderedImage render(const Scene& scene,
                     const RenderOptions& options,
                     const std::atomic<bool>& stop,
                     const std::function<void(const RenderProgress&)>& progress,
                     KeptContext& kept,
                     Statistics& stats)
{
  const Clock::time_point build_start = Clock::now();
  const RenderSettings& settings = options.settings;
  const SceneContext& context = kept.get(scene, context_options(options));
  for (std::string& text : context.displacements.warnings()) stats.warnings.push_back(std::move(text));
  const StageTable& stages = stage_table_select();

  const FilmWindow window = render_window(options);
  Film film(window.width, window.height, options.aov_mask, settings.cryptomatte_levels,
            !scene.environment.visible_to_camera || has_holdouts(scene), settings.noise_threshold > 0);

  FilterTable filter;
  pixel_filter_table_make(settings.filter, filter);
  KernelGlobals g = render_globals(context, options, filter);
  g.film = film.accumulator();
  const CryptomatteIds ids = cryptomatte_ids(scene, options.aov_mask);
  for (std::size_t i = 0; i < kNumCryptomattes; ++i) g.cryptomatte_ids[i] = ids[i].data();
  const bool counts_samples = g.film.layout.samples >= 0;
  stats.build_seconds = seconds_since(build_start);
  if (options.prepared) options.prepared();

  const double earlier_seconds = options.saved != nullptr ? options.saved->state.seconds : 0.0;
  const Clock::time_point start =
      Clock::now() - std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(earlier_seconds));
  SamplingEnd end(stop,
                  options.time_limit_seconds > 0 ? std::max(1e-3, options.time_limit_seconds - earlier_seconds) : 0.0);
  PhotonChoice choice = photon_choice_make(context, options, g, end.reached());
  const bool caustics = choice.photons;
  std::optional<PhotonPass> photons;
  if (caustics) {
    photons.emplace(context, settings, std::move(choice.sources));
  }
  const std::vector<std::uint8_t>& surface_kernels = context.surface_kernels(caustics);
  const WavefrontColumns columns = context.columns(caustics);
  const CameraMedium camera_medium(context);
  const Media media(context);
  for (std::string& text : media.problems()) stats.warnings.push_back(std::move(text));
  for (const std::string& text : context.varying_media.problems()) stats.warnings.push_back(text);
  for (std::string& text : camera_medium.overlaps()) stats.warnings.push_back(std::move(text));
  Workers workers([&] {
    Wavefront worker(columns);
    worker.stop = &end.reached();
    if (camera_medium.exists()) worker.camera_medium = &camera_medium;
    if (media.exist()) worker.media = &media;
    return worker;
  });
  // What a tile may be given up in the middle of.
  const bool has_long_searches = context.displacements.size() > 0 || !scene.graphs.empty();
  const std::uint32_t wanted = samples_wanted(options);
  ProgressReporter reporter(options, progress, static_cast<double>(film.width()) * film.height(), start);
  const auto report = [&](bool now) { reporter.report(now, photons ? &*photons : nullptr); };

  PreviewSchedule previews;
  const auto preview = [&] {
    const double before = seconds_since(start);
    if (!options.preview || !previews.is_due(before)) return;
    options.preview(film.beauty(window.x0, window.y0, settings.width, settings.height, settings.film_exposure).view,
                    film.mean_samples());
    previews.note(before, seconds_since(start));
  };

  ErrorHistory errors(film, options, window);

  std::vector<int> active(static_cast<std::size_t>(film.num_tiles()));
  for (int tile = 0; tile < film.num_tiles(); ++tile) active[static_cast<std::size_t>(tile)] = tile;

  // What has photons has as many of these as there are maps.
  std::array<KernelGlobals, PhotonPass::kMaps> by_map{g, g};
  const auto my_worker = [&]() -> Wavefront& { return workers.local(); };
  const auto note_photons = [&] {
    end.note_progress();
    report(false);
  };
  const auto active_part = [&] {
    double pixels = 0;
    for (std::uint32_t p = 0; p < film.num_pixels(); ++p) pixels += film_pixel_rests(by_map.front().film, p) ? 0 : 1;
    return pixels / static_cast<double>(film.num_pixels());
  };

  const bool is_watched = options.preview || options.keeps_errors;
  stats.stop_reason = "samples";
  stats.isa = stages.isa;
  std::uint32_t done = 0, samples = 0;
  if (options.saved != nullptr && state_restore(*options.saved, film, workers.local(), wanted)) {
    const RenderState& saved = options.saved->state;
    for (KernelGlobals& globals : by_map) globals.film = film.accumulator();
    active = saved.active;
    done = saved.done_samples;
    samples = saved.pass_samples;
    if (photons) photons->restore(saved.photons, std::max(options.first_sample, 1u) - 1);
    reporter.add(static_cast<std::uint64_t>(film.mean_samples() * static_cast<double>(film.num_pixels())),
                 rays_of(saved.counters));
  } else {
    if (options.saved != nullptr) {
      stats.warnings.emplace_back("what was rendered before is not of this picture: begun anew");
    }
    if (photons && options.first_sample > 0) {
      // The first pass sets the radius of all.
      photons->next(by_map.front(), 0, stages, my_worker, end.reached(), note_photons);
      photons->skip_to(options.first_sample);
    }
  }
  PhotonPassState photons_before;
  const auto state = [&] {
    RenderState now;
    now.done_samples = done;
    now.pass_samples = samples;
    now.active = active;
    now.tile_samples = film.samples();
    now.photons = photons_before;
    now.seconds = seconds_since(start);
    state_add_work(now, workers);
    return now;
  };
  CheckpointSchedule checkpoints(options.checkpoint ? options.checkpoint_seconds : 0.0);
  const auto checkpoint = [&] {
    stats.render_seconds = seconds_since(start);
    fill_film(stats, film, settings);
    const RenderedImage beauty =
        film.beauty(window.x0, window.y0, settings.width, settings.height, settings.film_exposure);
    options.checkpoint(state(), film.sums(), beauty.view);
  };
  // A checkpoint has to wait for tiles that are under way, so they must not take longer than what may be lost. Before anything is
  // measured pictures of few tiles, which wait for all of them, begin as small as can be. Further layers are added to where a
  // path meets what they tell: the last bits of their sums depend on which samples are under way together.
  constexpr auto bit = [](Aov aov) { return 1u << static_cast<int>(aov); };
  constexpr std::uint32_t kSumsByPath =
      bit(Aov::kBeauty) | bit(Aov::kSampleCount) | bit(Aov::kVariance) | bit(Aov::kHalf);
  const bool cuts_passes = checkpoints.is_on() && (options.aov_mask & ~kSumsByPath) == 0;
  const auto most_samples = [&]() -> std::uint32_t {
    if (!cuts_passes) return kMostPassSamples;
    constexpr double kFewTiles = 4;
    const double tiles_a_thread =
        static_cast<double>(active.size()) / static_cast<double>(tbb::this_task_arena::max_concurrency());
    if (done == 0) return tiles_a_thread <= kFewTiles ? 1 : kMostPassSamples;
    const double tile_seconds = seconds_since(start) / done / std::max(tiles_a_thread, 1.0);
    return static_cast<std::uint32_t>(
        std::clamp(options.checkpoint_seconds / tile_seconds, 1.0, static_cast<double>(kMostPassSamples)));
  };
  std::uint32_t looked_at = 0;
  const auto look_ahead = [&] {
    // Often enough for the time left, seldom enough to cost nothing. Of fewer samples than four nothing is known.
    constexpr std::uint32_t kLeastSamples = 4;
    if (settings.noise_threshold <= 0 || !reporter.is_watched() ||
        done < std::max(kLeastSamples, looked_at + looked_at / 2))
      return;
    looked_at = done;
    const NoiseRule rule{settings.noise_threshold, settings.noise_maths, settings.film_exposure};
    reporter.set_wanted(film.mean_samples() + film.samples_to_come(rule, judging_after(settings, done, wanted), done));
  };
  std::function<void(double)> tell_photons = options.traced_photons;
  while (done < wanted && !active.empty()) {
    // A pass that was under way goes on as it was begun.
    if (samples == 0) {
      // Noise is judged after multiples of kMostPassSamples.
      samples = caustics ? std::min({photon_turn_samples(active_part()), wanted - done,
                                     kMostPassSamples - done % kMostPassSamples})
                         : pass_samples(done, wanted, seconds_since(start), options.time_limit_seconds, is_watched,
                                        most_samples());
    }
    if (photons) {
      photons_before = photons->state();
      photons->next_turn(by_map, samples, active_part(), stages, my_worker, end.reached(), note_photons);
      if (tell_photons && !end.reached()) std::exchange(tell_photons, {})(seconds_since(start));
    }
    const auto is_ended = [&] { return stop.load() || end.reached().load(); };
    // A checkpoint leaves tiles that wait; usually there is none, and all is done in the first turn. Each turn does one at least.
    for (std::vector<int> waiting = active; !is_ended();) {
      if (checkpoints.is_due() && film.mean_samples() > 0) checkpoints.run(checkpoint);
      tbb::parallel_for(
          std::size_t{0}, waiting.size(),
          [&](std::size_t i) {
            if (film.tile_samples(waiting[i]) != done || is_ended() || (i > 0 && checkpoints.is_due())) return;
            const FlushDenormals flush;
            Wavefront& worker = workers.local();
            const std::uint64_t rays_before = rays_of(worker.counters);
            const std::uint64_t paths_before = worker.counters.camera_rays;
            const std::vector<float> sums = has_long_searches ? film.tile_sums(waiting[i]) : std::vector<float>();
            // Photons are of one sample or of every other, and forks need room: then a batch has one sample of each pixel.
            const std::uint32_t batch_samples = caustics ? 1 : samples;
            for (std::uint32_t s = 0; s < samples; s += batch_samples) {
              const std::uint32_t first = options.first_sample + (counts_samples ? 0 : done + s);
              const KernelGlobals& globals = by_map[caustics && samples > 1 ? (done + s) % PhotonPass::kMaps : 0];
              const Batch batch = tile_batch(film, waiting[i], first, batch_samples);
              if (!worker.run(globals, *context.accel, stages, surface_kernels, batch)) {
                film.put_back_tile_sums(waiting[i], sums);
                return;
              }
            }
            end.note_progress();
            film.add_tile_samples(waiting[i], samples);
            reporter.add(worker.counters.camera_rays - paths_before, rays_of(worker.counters) - rays_before);
            report(false);
          },
          tbb::simple_partitioner());
      std::erase_if(waiting, [&](int tile) { return film.tile_samples(tile) != done; });
      if (waiting.empty()) break;
    }
    if (is_ended()) {
      stats.stop_reason = stop.load() ? "interrupted" : "time_limit";
      if (!stop.load() && film.empty_part() > 0) stats.warnings.push_back(empty_part_warning(film.empty_part()));
      break;
    }
    done += std::exchange(samples, 0);
    if (options.keeps_errors && errors.is_due()) errors.add(seconds_since(start));
    if (photons) reporter.set_photon_share(photons->seconds() / seconds_since(start));
    if (done < wanted && is_judged_after(settings, done)) {
      active = film.judge({settings.noise_threshold, settings.noise_maths, settings.film_exposure}, done);
      if (active.empty()) stats.stop_reason = "noise_threshold";
    }
    look_ahead();
    if (options.time_limit_seconds > 0 && seconds_since(start) >= options.time_limit_seconds && done < wanted) {
      stats.stop_reason = "time_limit";
      break;
    }
    if (done < wanted && !active.empty()) preview();
  }
  if (active.empty()) reporter.set_wanted(film.mean_samples());
  report(true);

  stats.render_seconds = seconds_since(start);
  stats.caustics.reason = choice.reason;
  stats.caustics.error_ratio = choice.error_ratio;
  stats.caustics.cost_ratio = choice.cost_ratio;
  if (photons) photons->fill(stats.caustics);
  context.fill(stats);
  fill_kept(stats.kept, kept, context);
  fill_film(stats, film, settings);
  if (options.keeps_errors) stats.errors = std::move(errors).finish(stats);
  fill_work(stats, workers, Wavefront::bytes(columns), window);
  std::optional<SavedRender> saved;
  if (options.checkpoint && stats.stop_reason == "interrupted" && stats.samples_per_pixel > 0) {
    saved = {state(), window.width, window.height, {film.sums().begin(), film.sums().end()}};
  }
  RenderedImage image =
      std::move(film).resolve(window.x0, window.y0, settings.width, settings.height, settings.film_exposure);
  image.saved = std::move(saved);
  return image;
}

}  // namespace relief
