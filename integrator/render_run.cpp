#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <numeric>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "integrator/checkpoint.h"
#include "integrator/error_history.h"
#include "integrator/flush_denormals.h"
#include "integrator/kept_context.h"
#include "integrator/media.h"
#include "integrator/pass_plan.h"
#include "integrator/photon_benefit.h"
#include "integrator/photon_pass.h"
#include "integrator/render.h"
#include "integrator/render_progress.h"
#include "integrator/sampling_end.h"
#include "integrator/scene_context.h"
#include "integrator/stages.h"
#include "integrator/wavefront.h"
#include "kernel/bsdf/closure_kinds.h"
#include "scene/cryptomatte.h"

namespace relief {

namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// @param sample  pixel of the window << 32 | sample
PixelSample pixel_sample(std::uint64_t sample, const FilmWindow& window)
{
  const std::uint64_t pixel = sample >> 32;
  const auto width = static_cast<std::uint64_t>(window.width);
  return {window.x0 + static_cast<int>(pixel % width), window.y0 + static_cast<int>(pixel / width),
          static_cast<std::uint32_t>(sample)};
}

/// @param part  of the picture, 0…1
std::string empty_part_warning(double part)
{
  char percent[16];
  std::snprintf(percent, sizeof percent, "%.2g", 100 * part);
  return "the time limit ended the first pass: " + std::string(percent) +
         " % of the picture has no sample and is black";
}

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

/// One render: what it needs, the passes, and what comes of them.
class RenderRun {
 public:
  /// Builds all that sampling needs.
  RenderRun(const Scene& scene,
            const RenderOptions& options,
            const std::atomic<bool>& stop,
            const std::function<void(const RenderProgress&)>& progress,
            KeptContext& kept,
            Statistics& stats);

  /// Goes on from what was saved, or starts the photons where samples were left out.
  void begin();
  /// Samples one pass, of all tiles whose noise is not low enough.
  /// @return false: it was the last
  bool pass();
  RenderedImage finish();

 private:
  double seconds() const { return seconds_since(start_); }
  bool is_ended() const { return stop_.load() || end_.reached().load(); }
  void report(bool now) { reporter_.report(now, photons_ ? &*photons_ : nullptr); }
  Clock::time_point note_built();
  KernelGlobals make_globals();
  std::function<Wavefront&()> any_worker();
  std::function<void()> photon_report();
  double active_part() const;
  std::uint32_t next_pass_samples() const;
  std::uint32_t most_samples() const;
  void trace_photons();
  bool sample_waiting();
  void sample_tile(int tile);
  void judge_noise();
  void look_ahead();
  void preview();
  RenderedImage beauty() const;
  RenderState state() const;
  void checkpoint();

  const Clock::time_point build_start_ = Clock::now();
  const Scene& scene_;
  const RenderOptions& options_;
  const RenderSettings& settings_ = options_.settings;
  const std::atomic<bool>& stop_;
  KeptContext& kept_;
  Statistics& stats_;
  const SceneContext& context_;
  const StageTable& stages_ = stage_table_select();
  const FilmWindow window_ = render_window(options_);
  Film film_;
  FilterTable filter_;
  const CryptomatteIds ids_;
  KernelGlobals globals_;
  const Clock::time_point start_;  ///< of sampling; as if what was saved had been sampled just before
  SamplingEnd end_;
  PhotonChoice choice_;
  std::optional<PhotonPass> photons_;
  const WavefrontColumns columns_ =
      context_.columns(choice_.photons, globals_.film.layout.light_by_event, context_.has_catchers);
  const CatchersAlone catchers_{context_.lights_of_footage.data(), &context_.surface_kernels(false)};
  const Media media_{context_};
  Workers workers_;
  const std::uint32_t wanted_ = samples_wanted(options_);
  ProgressReporter reporter_;
  PreviewSchedule previews_;
  ErrorHistory errors_{film_, options_, window_};
  CheckpointSchedule checkpoints_;
  /// What has photons has as many of these as there are maps.
  std::array<KernelGlobals, PhotonPass::kMaps> by_map_{globals_, globals_};
  std::vector<int> active_;         ///< tiles whose noise is not low enough
  std::uint32_t done_ = 0;          ///< samples of active tiles
  std::uint32_t samples_ = 0;       ///< of the pass under way; 0: none is
  std::uint32_t looked_at_ = 0;     ///< samples when noise was looked at last
  PhotonPassState photons_before_;  ///< the pass under way
  bool has_told_photons_ = false;
};

/// Seconds of sampling that were saved.
double earlier_seconds(const RenderOptions& options)
{
  return options.saved != nullptr ? options.saved->state.seconds : 0.0;
}

/// Of those that are left to sample; 0: there is no limit.
double seconds_to_sample(const RenderOptions& options)
{
  if (!(options.time_limit_seconds > 0)) return 0.0;
  return std::max(1e-3, options.time_limit_seconds - earlier_seconds(options));
}

/// Whether samples may be covered by something else than a surface.
bool has_media(const Scene& scene) { return !scene.media.empty() || scene.environment.medium.has_value(); }

Film film_make(const Scene& scene, const RenderOptions& options, bool has_catchers)
{
  const RenderSettings& settings = options.settings;
  const FilmWindow window = render_window(options);
  const bool is_panoramic = options.camera.projection == Projection::kPanoramic;
  return {
      window.width,
      window.height,
      options.aov_mask,
      settings.cryptomatte_levels,
      !scene.environment.visible_to_camera || has_holdouts(scene) || has_media(scene) || is_panoramic || has_catchers,
      settings.noise_threshold > 0,
      has_catchers,
      static_cast<int>(scene.light_groups.size())};
}

RenderRun::RenderRun(const Scene& scene,
                     const RenderOptions& options,
                     const std::atomic<bool>& stop,
                     const std::function<void(const RenderProgress&)>& progress,
                     KeptContext& kept,
                     Statistics& stats)
    : scene_(scene),
      options_(options),
      stop_(stop),
      kept_(kept),
      stats_(stats),
      context_(kept.get(scene, render_context_options(options))),
      film_(film_make(scene, options, context_.has_catchers)),
      ids_(cryptomatte_ids(scene, options.aov_mask)),
      globals_(make_globals()),
      start_(note_built()),
      end_(stop, seconds_to_sample(options)),
      choice_(photon_choice_make(context_, options, globals_, end_.reached())),
      workers_([this] {
        Wavefront worker(columns_);
        worker.stop = &end_.reached();
        if (media_.exist()) worker.media = &media_;
        if (columns_.catchers) worker.catchers = &catchers_;
        return worker;
      }),
      reporter_(options, progress, static_cast<double>(film_.width()) * film_.height(), start_),
      checkpoints_(options.checkpoint ? options.checkpoint_seconds : 0.0),
      active_(static_cast<std::size_t>(film_.num_tiles()))
{
  if (choice_.photons) photons_.emplace(context_, settings_, std::move(choice_.sources));
  for (std::string& text : media_.problems()) stats_.warnings.push_back(std::move(text));
  for (const std::string& text : context_.varying_media.problems()) stats_.warnings.push_back(text);
  std::iota(active_.begin(), active_.end(), 0);
}

KernelGlobals RenderRun::make_globals()
{
  pixel_filter_table_make(settings_.filter, filter_);
  KernelGlobals g = render_globals(context_, options_, filter_);
  g.film = film_.accumulator();
  for (std::size_t i = 0; i < kNumCryptomattes; ++i) g.cryptomatte_ids[i] = ids_[i].data();
  return g;
}

/// @return  when sampling starts
Clock::time_point RenderRun::note_built()
{
  for (std::string& text : context_.displacements.warnings()) stats_.warnings.push_back(std::move(text));
  stats_.build_seconds = seconds_since(build_start_);
  if (options_.prepared) options_.prepared();
  return Clock::now() -
         std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(earlier_seconds(options_)));
}

std::function<Wavefront&()> RenderRun::any_worker()
{
  return [this]() -> Wavefront& { return workers_.local(); };
}

std::function<void()> RenderRun::photon_report()
{
  return [this] {
    end_.note_progress();
    report(false);
  };
}

/// Part of the pixels whose noise is not low enough.
double RenderRun::active_part() const
{
  double pixels = 0;
  for (std::uint32_t p = 0; p < film_.num_pixels(); ++p) pixels += film_pixel_rests(by_map_.front().film, p) ? 0 : 1;
  return pixels / static_cast<double>(film_.num_pixels());
}

void RenderRun::begin()
{
  stats_.stop_reason = "samples";
  stats_.isa = stages_.isa;
  if (options_.saved != nullptr && state_restore(*options_.saved, film_, workers_.local(), wanted_)) {
    const RenderState& saved = options_.saved->state;
    for (KernelGlobals& globals : by_map_) globals.film = film_.accumulator();
    active_ = saved.active;
    done_ = saved.done_samples;
    samples_ = saved.pass_samples;
    if (photons_) photons_->restore(saved.photons, std::max(options_.first_sample, 1u) - 1);
    reporter_.add(static_cast<std::uint64_t>(film_.mean_samples() * static_cast<double>(film_.num_pixels())),
                  rays_of(saved.counters));
    return;
  }
  if (options_.saved != nullptr) {
    stats_.warnings.emplace_back("what was rendered before is not of this picture: begun anew");
  }
  if (photons_ && options_.first_sample > 0) {
    // The first pass sets the radius of all.
    photons_->next(by_map_.front(), 0, stages_, any_worker(), end_.reached(), photon_report());
    photons_->skip_to(options_.first_sample);
  }
}

RenderState RenderRun::state() const
{
  RenderState now;
  now.done_samples = done_;
  now.pass_samples = samples_;
  now.active = active_;
  now.tile_samples = film_.samples();
  now.photons = photons_before_;
  now.seconds = seconds();
  state_add_work(now, workers_);
  return now;
}

RenderedImage RenderRun::beauty() const
{
  return film_.beauty(window_.x0, window_.y0, settings_.width, settings_.height, settings_.film_exposure);
}

void RenderRun::checkpoint()
{
  stats_.render_seconds = seconds();
  fill_film(stats_, film_, settings_);
  const RenderedImage so_far = beauty();
  options_.checkpoint(state(), film_.sums(), so_far.view);
}

/// A checkpoint has to wait for tiles that are under way, so they must not take longer than what may be lost. Before anything is
/// measured pictures of few tiles, which wait for all of them, begin as small as can be. Further layers are added to where a
/// path meets what they tell: the last bits of their sums depend on which samples are under way together.
std::uint32_t RenderRun::most_samples() const
{
  constexpr AovMask kSumsByPath =
      aov_bit(Aov::kBeauty) | aov_bit(Aov::kSampleCount) | aov_bit(Aov::kVariance) | aov_bit(Aov::kHalf);
  if (!checkpoints_.is_on() || (options_.aov_mask & ~kSumsByPath) != 0) return kMostPassSamples;
  constexpr double kFewTiles = 4;
  const double tiles_a_thread =
      static_cast<double>(active_.size()) / static_cast<double>(tbb::this_task_arena::max_concurrency());
  if (done_ == 0) return tiles_a_thread <= kFewTiles ? 1 : kMostPassSamples;
  const double tile_seconds = seconds() / done_ / std::max(tiles_a_thread, 1.0);
  return static_cast<std::uint32_t>(
      std::clamp(options_.checkpoint_seconds / tile_seconds, 1.0, static_cast<double>(kMostPassSamples)));
}

/// Noise is judged after multiples of kMostPassSamples.
std::uint32_t RenderRun::next_pass_samples() const
{
  if (photons_) {
    return std::min({photon_turn_samples(active_part()), wanted_ - done_, kMostPassSamples - done_ % kMostPassSamples});
  }
  const bool is_watched = options_.preview || options_.keeps_errors;
  return pass_samples(done_, wanted_, seconds(), options_.time_limit_seconds, is_watched, most_samples());
}

void RenderRun::trace_photons()
{
  photons_before_ = photons_->state();
  photons_->next_turn(by_map_, samples_, active_part(), stages_, any_worker(), end_.reached(), photon_report());
  if (!options_.traced_photons || has_told_photons_ || end_.reached()) return;
  has_told_photons_ = true;
  options_.traced_photons(seconds());
}

/// Gives a tile its samples of the pass, unless sampling ends meanwhile.
void RenderRun::sample_tile(int tile)
{
  const FlushDenormals flush;
  Wavefront& worker = workers_.local();
  const std::uint64_t rays_before = rays_of(worker.counters);
  const std::uint64_t paths_before = worker.counters.camera_rays;
  // What a tile may be given up in the middle of.
  const bool has_long_searches = context_.displacements.size() > 0 || !scene_.graphs.empty();
  const std::vector<float> sums = has_long_searches ? film_.tile_sums(tile) : std::vector<float>();
  const bool counts_samples = globals_.film.layout.samples >= 0;
  // Photons are of one sample or of every other, and forks need room: then a batch has one sample of each pixel.
  const std::uint32_t batch_samples = photons_ ? 1 : samples_;
  for (std::uint32_t s = 0; s < samples_; s += batch_samples) {
    const std::uint32_t first = options_.first_sample + (counts_samples ? 0 : done_ + s);
    const KernelGlobals& globals = by_map_[photons_ && samples_ > 1 ? (done_ + s) % PhotonPass::kMaps : 0];
    const Batch batch = tile_batch(film_, tile, first, batch_samples);
    if (!worker.run(globals, *context_.accel, stages_, context_.surface_kernels(choice_.photons), batch)) {
      film_.put_back_tile_sums(tile, sums);
      return;
    }
  }
  end_.note_progress();
  film_.add_tile_samples(tile, samples_);
  reporter_.add(worker.counters.camera_rays - paths_before, rays_of(worker.counters) - rays_before);
  report(false);
}

/// Samples all active tiles. A checkpoint leaves tiles that wait; usually there is none, and all is done in the first turn. Each turn
/// does one at least.
/// @return false: sampling has ended meanwhile
bool RenderRun::sample_waiting()
{
  for (std::vector<int> waiting = active_; !is_ended();) {
    if (checkpoints_.is_due() && film_.mean_samples() > 0) checkpoints_.run([this] { checkpoint(); });
    tbb::parallel_for(
        std::size_t{0}, waiting.size(),
        [&](std::size_t i) {
          if (film_.tile_samples(waiting[i]) != done_ || is_ended() || (i > 0 && checkpoints_.is_due())) return;
          sample_tile(waiting[i]);
        },
        tbb::simple_partitioner());
    std::erase_if(waiting, [&](int tile) { return film_.tile_samples(tile) != done_; });
    if (waiting.empty()) break;
  }
  return !is_ended();
}

void RenderRun::judge_noise()
{
  if (done_ >= wanted_ || !is_judged_after(settings_, done_)) return;
  active_ = film_.judge({settings_.noise_threshold, settings_.noise_maths, settings_.film_exposure}, done_);
  if (active_.empty()) stats_.stop_reason = "noise_threshold";
}

/// Tells the reporter how many samples noise will ask for. Often enough for the time left, seldom enough to cost nothing.
void RenderRun::look_ahead()
{
  // Of fewer samples nothing is known.
  constexpr std::uint32_t kLeastSamples = 4;
  if (settings_.noise_threshold <= 0 || !reporter_.is_watched() ||
      done_ < std::max(kLeastSamples, looked_at_ + looked_at_ / 2)) {
    return;
  }
  looked_at_ = done_;
  const NoiseRule rule{settings_.noise_threshold, settings_.noise_maths, settings_.film_exposure};
  reporter_.set_wanted(film_.mean_samples() +
                       film_.samples_to_come(rule, judging_after(settings_, done_, wanted_), done_));
}

void RenderRun::preview()
{
  const double before = seconds();
  if (!options_.preview || !previews_.is_due(before)) return;
  options_.preview(beauty().view, film_.mean_samples());
  previews_.note(before, seconds());
}

bool RenderRun::pass()
{
  if (done_ >= wanted_ || active_.empty()) return false;
  // A pass that was under way goes on as it was begun.
  if (samples_ == 0) samples_ = next_pass_samples();
  if (photons_) trace_photons();
  if (!sample_waiting()) {
    stats_.stop_reason = stop_.load() ? "interrupted" : "time_limit";
    if (!stop_.load() && film_.empty_part() > 0) stats_.warnings.push_back(empty_part_warning(film_.empty_part()));
    return false;
  }
  done_ += std::exchange(samples_, 0);
  if (options_.keeps_errors && errors_.is_due()) errors_.add(seconds());
  if (photons_) reporter_.set_photon_share(photons_->seconds() / seconds());
  judge_noise();
  look_ahead();
  if (options_.time_limit_seconds > 0 && seconds() >= options_.time_limit_seconds && done_ < wanted_) {
    stats_.stop_reason = "time_limit";
    return false;
  }
  if (done_ < wanted_ && !active_.empty()) preview();
  return true;
}

RenderedImage RenderRun::finish()
{
  if (active_.empty()) reporter_.set_wanted(film_.mean_samples());
  report(true);
  stats_.render_seconds = seconds();
  stats_.caustics.reason = choice_.reason;
  stats_.caustics.error_ratio = choice_.error_ratio;
  stats_.caustics.cost_ratio = choice_.cost_ratio;
  if (photons_) photons_->fill(stats_.caustics);
  context_.fill(stats_);
  fill_kept(stats_.kept, kept_, context_);
  fill_film(stats_, film_, settings_);
  if (options_.keeps_errors) stats_.errors = std::move(errors_).finish(stats_);
  fill_work(stats_, workers_, Wavefront::bytes(columns_), window_);
  std::optional<SavedRender> saved;
  if (options_.checkpoint && stats_.stop_reason == "interrupted" && stats_.samples_per_pixel > 0) {
    saved = {state(), window_.width, window_.height, {film_.sums().begin(), film_.sums().end()}};
  }
  RenderedImage image =
      std::move(film_).resolve(window_.x0, window_.y0, settings_.width, settings_.height, settings_.film_exposure);
  image.view.light_groups = scene_.light_groups.data();
  image.saved = std::move(saved);
  return image;
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
  RenderRun run(scene, options, stop, progress, kept, stats);
  run.begin();
  while (run.pass()) {
  }
  return run.finish();
}

}  // namespace relief
