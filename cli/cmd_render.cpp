#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <iterator>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/task_arena.h>
#include <nlohmann/json.hpp>

#include "cli/arguments.h"
#include "cli/commands.h"
#include "cli/darkness.h"
#include "cli/denoise_picture.h"
#include "cli/error_text.h"
#include "cli/exit_code.h"
#include "cli/fingerprint.h"
#include "cli/frame_files.h"
#include "cli/interrupt.h"
#include "cli/memory_option.h"
#include "cli/memory_use.h"
#include "cli/picture_options.h"
#include "cli/progress_printer.h"
#include "cli/render_session.h"
#include "cli/run_files.h"
#include "cli/scene_setup.h"
#include "cli/standard_streams.h"
#include "cli/value_hint.h"
#include "exporters/atomic_file.h"
#include "exporters/clipping.h"
#include "exporters/errors.h"
#include "exporters/exr.h"
#include "exporters/exr_state.h"
#include "exporters/image_metrics.h"
#include "exporters/output_lock.h"
#include "exporters/png_ocio.h"
#include "exporters/report/frame_report.h"
#include "exporters/sample_range.h"
#include "exporters/stats_json.h"
#include "integrator/render.h"
#include "integrator/scene_displacement.h"
#include "scene/load.h"
#include "scene/setting_values.h"

namespace relief {

namespace {

struct RenderArguments {
  std::string scene, output, png, stats, reference, preview, report, log;
  PictureOptions picture;
  FrameList frames;  ///< empty: the rest pose
  SamplePart part;
  int threads = 0;
  double time_limit = 0, noise_threshold = -1;
  std::optional<std::string> view, display;
  std::optional<double> exposure;
  AovMask aov_mask = 0;
  Denoiser denoiser = Denoiser::kNone;
  std::string compression = "zip", color_space = "rec709", progress = "bar";
  bool resume = false, strict = false, keep_going = false, float_color = false;
  std::optional<double> checkpoint;  ///< seconds; none: as --resume has it
  double grace = 0;                  ///< seconds
  double texture_memory_gib = 4;
  SceneSetup setup;
  std::vector<std::string> settings;       ///< see settings_given
  std::vector<std::string> path_settings;  ///< those that decide a path, as words of a command line
};

FramePaths paths_of_frame(const RenderArguments& arguments, std::optional<int> frame)
{
  const auto numbered = [&](const std::string& pattern) {
    // A device or a pipe takes one frame after the other; a file beside it, called after it, is nobody's wish.
    const bool has_number = frame && !pattern.empty() && !is_stream(output_destination(pattern));
    return has_number ? frame_path(pattern, *frame) : std::filesystem::path(pattern);
  };
  // One reference may serve all frames; it has a number only where it is asked for.
  const bool has_references =
      std::filesystem::path(arguments.reference).filename().string().find('#') != std::string::npos;
  return {numbered(arguments.output),
          numbered(arguments.png),
          numbered(arguments.stats),
          has_references ? numbered(arguments.reference) : std::filesystem::path(arguments.reference),
          numbered(arguments.preview),
          numbered(arguments.report)};
}

/// Options of a frame's outputs with their files.
std::vector<std::pair<const char*, std::filesystem::path>> outputs_of(const FramePaths& paths)
{
  return {{"--output", paths.exr},
          {"--png", paths.png},
          {"--stats", paths.stats},
          {"--preview", paths.preview},
          {"--report", paths.report}};
}

/// All that is known of a run's files before anything is read.
RunFiles files_of_run(const RenderArguments& arguments, const std::vector<std::optional<int>>& frames)
{
  RunFiles files;
  files.add_input("the scene", arguments.scene);
  files.add_input("the environment", arguments.setup.environment_file());
  files.add_input("the camera's file", arguments.picture.camera_from);
  files.add_output("--log", arguments.log);
  for (const std::optional<int> frame : frames) {
    const FramePaths paths = paths_of_frame(arguments, frame);
    for (const auto& [option, path] : outputs_of(paths)) files.add_output(option, path);
    files.add_input("the reference", paths.reference);
  }
  return files;
}

/// Layers that a report shows.
AovMask report_aovs(const Scene& scene)
{
  return aov_bit(Aov::kSampleCount) | aov_bit(Aov::kVariance) |
         (scene.displacements.empty() ? 0u : aov_bit(Aov::kDisplacementSteps));
}

RenderOptions options_for(const Scene& scene, const RenderArguments& arguments, const std::vector<SceneCamera>& cameras)
{
  RenderOptions options = render_options(scene, arguments.picture, cameras);
  RenderSettings& settings = options.settings;
  if (arguments.noise_threshold >= 0) settings.noise_threshold = static_cast<float>(arguments.noise_threshold);
  if (arguments.view) settings.view = *arguments.view;
  if (arguments.exposure) settings.exposure = static_cast<float>(*arguments.exposure);
  const auto [first, end] = part_samples(arguments.part, settings.samples);
  options.first_sample = first;
  options.num_samples = end - first;
  options.time_limit_seconds = arguments.time_limit;
  options.aov_mask = arguments.aov_mask | (arguments.denoiser == Denoiser::kNone ? 0 : denoiser_aovs());
  options.keeps_errors = !arguments.stats.empty() || !arguments.report.empty();
  if (!arguments.report.empty()) options.aov_mask |= report_aovs(scene);
  return options;
}

ExrCompression compression_of(const RenderArguments& arguments)
{
  const auto* found = std::find(kExrCompressionNames.begin(), kExrCompressionNames.end(), arguments.compression);
  return static_cast<ExrCompression>(found - kExrCompressionNames.begin());
}

ColorSpace color_space_of(const RenderArguments& arguments)
{
  const auto* found = std::find(kColorSpaceNames.begin(), kColorSpaceNames.end(), arguments.color_space);
  return static_cast<ColorSpace>(found - kColorSpaceNames.begin());
}

/// Settings that do nothing, more than meets the eye, or something else than they say.
std::vector<std::string> warnings_about(const RenderArguments& arguments, const Scene& scene)
{
  // Looked up although nothing shows it: what is misspelt is to be heard of before the frames are rendered.
  if (arguments.png.empty() && (arguments.view || arguments.display)) {
    ColorView unused(arguments.view.value_or(""), arguments.display.value_or(""));
  }
  std::vector<std::string> texts = displacement_warnings(scene, arguments.picture.displacement);
  if (arguments.png.empty() && arguments.view) texts.emplace_back("--view has no effect without --png");
  if (arguments.png.empty() && arguments.display) texts.emplace_back("--display has no effect without --png");
  if (arguments.png.empty() && arguments.exposure) texts.emplace_back("--exposure has no effect without --png");
  for (const std::string& layer : exr_damaged_layers(film_layout_make(arguments.aov_mask), compression_of(arguments))) {
    texts.push_back(fmt::format("--compression {}: it takes the data in the layer '{}' for colours and rounds them",
                                arguments.compression, layer));
  }
  return texts;
}

/// Reads the picture to compare with before the render, which must not fail over it afterwards.
/// @error InputError if it cannot be read or does not cover what is rendered
std::optional<Picture> reference_load(const std::filesystem::path& file, const RenderOptions& options)
{
  if (file.empty()) return {};
  Picture picture = exr_load(file);
  const RenderSettings& s = options.settings;
  const bool is_cropped = options.crop_x1 > 0;
  const int x1 = is_cropped ? options.crop_x1 : s.width;
  const int y1 = is_cropped ? options.crop_y1 : s.height;
  if (picture.full_width != s.width || picture.full_height != s.height || picture.crop_x > options.crop_x0 ||
      picture.crop_y > options.crop_y0 || picture.crop_x + picture.width < x1 || picture.crop_y + picture.height < y1) {
    throw InputError(
        file.string(),
        fmt::format("expected a picture of {}x{} with the pixels {},{},{},{}, found one of {}x{} with {},{},{},{}",
                    s.width, s.height, options.crop_x0, options.crop_y0, x1, y1, picture.full_width,
                    picture.full_height, picture.crop_x, picture.crop_y, picture.crop_x + picture.width,
                    picture.crop_y + picture.height));
  }
  if (picture_layer(picture, "").channels.size() < 3) {
    throw InputError(file.string(), "expected red, green and blue, found other channels");
  }
  return picture;
}

/// Red, green and blue of the reference in the window of a film.
ImageView reference_view(const Picture& reference, const FilmView& film)
{
  ImageView expected = picture_layer(reference, "");
  expected.channels.resize(3);
  expected.width = film.width;
  expected.height = film.height;
  for (ChannelView& channel : expected.channels) {
    channel.first +=
        (film.crop_x - reference.crop_x) * channel.pixel_stride + (film.crop_y - reference.crop_y) * channel.row_stride;
  }
  return expected;
}

/// @param rendered  R, G and B of the film's size
ImageErrors errors_against(const Picture& reference, const FilmView& film, ImageView rendered)
{
  rendered.channels.resize(3);
  return image_errors(rendered, reference_view(reference, film));
}

/// The page about a frame.
std::string report_html(const FramePaths& paths,
                        const FilmView& film,
                        const Statistics& stats,
                        const Attributes& attributes,
                        const std::optional<Picture>& reference)
{
  FrameReport report;
  report.name = paths.exr.string();
  report.beauty = film_layer(film, Aov::kBeauty);
  report.variance = film_layer(film, Aov::kVariance);
  report.samples = film_layer(film, Aov::kSampleCount);
  report.steps = film_layer(film, Aov::kDisplacementSteps);
  if (reference) report.reference = reference_view(*reference, film);
  report.crop_x = film.crop_x;
  report.crop_y = film.crop_y;
  report.attributes = attributes;
  report.statistics = stats_json(stats);
  return frame_report_html(report);
}

/// Says what to do about a picture that shows nothing, or little but darkness; empty: it shows something.
std::string emptiness_warning(const Scene& scene, const FilmView& film)
{
  const bool has_something = std::any_of(scene.instances.begin(), scene.instances.end(), [](const Instance& instance) {
    return (instance.flags & (kVisibleToCamera | kHoldout | kShadowCatcher)) == kVisibleToCamera;
  });
  const bool is_window = film.width != film.full_width || film.height != film.full_height;
  if (!has_something || is_window) return {};
  const ImageView beauty = film_layer(film, Aov::kBeauty);
  if (beauty.channels.empty()) return {};
  constexpr double kDark = 1.5e-4;  // half of the first code of a PNG that is not black
  const Darkness found = darkness_of(film);
  if (found.covered == 0) return "the camera sees nothing of the scene; --camera auto looks at all of it";
  if (found.brightest < kDark) return "no light reaches what the camera sees; --environment studio or sky lights it";
  const bool glows_only =
      scene.lights.empty() && scene.environment.texture_index < 0 && is_zero(scene.environment.color);
  if (glows_only && found.is_mostly_dim()) {
    return fmt::format(
        "what glows is all its light, and leaves {:.0f} % of what the camera sees as good as black; "
        "--environment studio or sky lights it",
        100 * found.dim / found.covered);
  }
  return {};
}

/// Says what to do about a PNG that is mostly white.
void hint_at_clipping(ProgressPrinter& progress,
                      const std::filesystem::path& file,
                      const FilmView& film,
                      const ColorView& view,
                      double exposure)
{
  constexpr double kMost = 0.5;
  const Clipping clipping = picture_clipping(film_layer(film, Aov::kBeauty), view, exposure);
  if (clipping.fraction <= kMost) return;
  progress.note(
      fmt::format("{}: {:.0f} % of what is seen is white: try --exposure {:.1f}, or --luminous-efficacy 683 if the "
                  "scene's lights are in candela and lux",
                  file.string(), 100 * clipping.fraction, clipping.exposure));
}

/// Tells people and programs how a frame came out.
void report_frame(ProgressPrinter& progress,
                  const FramePaths& paths,
                  const Statistics& stats,
                  const std::optional<DenoisedPicture>& denoised,
                  const std::optional<ImageErrors>& errors,
                  const std::optional<ImageErrors>& denoised_errors)
{
  const std::string estimate =
      std::isfinite(stats.error_rmse) ? fmt::format("estimated RMSE {:.3g}", stats.error_rmse) : "error unknown";
  progress.note(fmt::format("{}: {}x{}, {:.6g} samples a pixel in {:.2f} s, {}{}{}", paths.exr.string(), stats.width,
                            stats.height, stats.samples_per_pixel, stats.render_seconds, estimate,
                            stats.view.empty() ? "" : ", " + stats.view,
                            stats.stop_reason == "interrupted" ? " (interrupted)" : ""));
  if (denoised) progress.note(fmt::format("{}: {}", paths.exr.string(), denoised->report()));
  nlohmann::json done = {{"event", "done"},
                         {"frame", stats.frame},
                         {"output", paths.exr.string()},
                         {"seconds", stats.render_seconds},
                         {"samples", stats.samples_per_pixel},
                         {"error_rmse", stats.error_rmse},
                         {"stop_reason", stats.stop_reason}};
  if (errors) {
    done["reference_rmse"] = errors->rmse;
    done["reference_relmse"] = errors->relmse;
  }
  if (denoised) {
    done["denoise_seconds"] = denoised->seconds;
    done["denoised_rmse"] = denoised->result.rmse;
  }
  if (denoised_errors) {
    done["denoised_reference_rmse"] = denoised_errors->rmse;
    done["denoised_reference_relmse"] = denoised_errors->relmse;
  }
  progress.event(done);
  if (errors && !progress.is_json()) {
    print_line(fmt::format("against {}: RMSE {:.6g}, relMSE {:.6g} after {:.2f} s", paths.reference.string(),
                           errors->rmse, errors->relmse, stats.render_seconds));
    if (denoised_errors) {
      print_line(fmt::format("denoised, against it: RMSE {:.6g}, relMSE {:.6g} after {:.2f} s", denoised_errors->rmse,
                             denoised_errors->relmse, stats.render_seconds + denoised->seconds));
    }
  }
}

void report_skipped(ProgressPrinter& progress, const FramePaths& paths, int frame, const std::string& reason)
{
  progress.note(fmt::format("{}: {}", paths.exr.string(), reason));
  progress.event({{"event", "skipped"}, {"frame", frame}, {"output", paths.exr.string()}, {"reason", reason}});
}

/// Seconds between the checkpoints of a frame; 0: none.
double checkpoint_seconds(const RenderArguments& arguments, const FramePaths& paths)
{
  constexpr double kSeconds = 60;
  // Whoever reads a pipe waits for one picture.
  if (is_stream(output_destination(paths.exr))) return 0;
  return arguments.checkpoint.value_or(arguments.resume ? kSeconds : 0.0);
}

void report_resumed(ProgressPrinter& progress, const FramePaths& paths, int frame, const SavedRender& saved)
{
  const RenderState& state = saved.state;
  // Tiles do not tell: some of their pixels may have come to rest.
  const double samples = static_cast<double>(state.counters.camera_rays) /
                         (static_cast<double>(saved.width) * static_cast<double>(saved.height));
  progress.note(
      fmt::format("{}: goes on after {:.6g} samples a pixel and {:.2f} s", paths.exr.string(), samples, state.seconds));
  progress.event({{"event", "resumed"},
                  {"frame", frame},
                  {"output", paths.exr.string()},
                  {"samples", samples},
                  {"seconds", state.seconds}});
}

/// What an unfinished frame goes on from, if there is anything; a damaged state is warned about, and the frame begins anew.
std::optional<SavedRender> state_of(const FramePaths& paths,
                                    const std::string& fingerprint,
                                    Statistics& stats,
                                    ProgressPrinter& progress)
{
  try {
    return exr_state_load(paths.exr, fingerprint);
  } catch (const InputError& error) {
    stats.warnings.push_back(fmt::format("{}: the frame begins anew", error.what()));
    progress.warnings({stats.warnings.back()});
    return {};
  }
}

void report_failed(ProgressPrinter& progress, int frame, const std::string& name, const std::exception& error)
{
  progress.note(fmt::format("relief: frame {}: {}", name, error_text(error)));
  progress.event({{"event", "failed"}, {"frame", frame}, {"reason", error_text(error)}});
}

/// One frame, from loading to files.
class FrameRun {
 public:
  /// @param files  of the run; what the frame reads is added
  /// @param kept   of the frames before; null: there are no others
  FrameRun(const RenderArguments& arguments,
           const std::string& command,
           std::optional<int> frame,
           RunFiles& files,
           KeptFrames* kept,
           ProgressPrinter& progress)
      : arguments_(arguments), command_(command), frame_(frame), files_(files), kept_(kept), progress_(progress)
  {
  }

  /// @return false if it was interrupted
  bool run();

 private:
  std::string name() const { return paths_.exr.string(); }
  int number() const { return frame_.value_or(0); }
  void note_unwritten() const { progress_.note(name() + ": interrupted before the first sample, not written"); }
  bool claim();
  void load();
  void choose_options();
  void describe();
  void go_on_from_saved();
  void listen();
  RenderedImage sample();
  void denoise(const RenderedImage& image);
  void write(const RenderedImage& image, bool is_complete);

  const RenderArguments& arguments_;
  const std::string& command_;
  const std::optional<int> frame_;
  RunFiles& files_;
  KeptFrames* const kept_;
  ProgressPrinter& progress_;
  const FramePaths paths_ = paths_of_frame(arguments_, frame_);
  std::vector<std::unique_ptr<OutputLock>> locks_;
  std::exception_ptr unwritable_;  ///< why an output cannot be written
  /// Until sampling begins there is nothing to save.
  std::optional<KeepsForSaving> saving_;
  std::optional<Farewell> farewell_;
  Statistics stats_;
  std::shared_ptr<const Scene> scene_;
  RenderOptions options_;
  PngOptions png_;
  std::vector<FileStamp> files_read_;
  std::optional<ColorView> view_;
  std::string fingerprint_;
  std::optional<Picture> reference_;
  std::optional<FrameFiles> frame_files_;
  std::optional<SavedRender> saved_;
  KeptContext of_frame_;
  Attributes more_attributes_;
  std::optional<DenoisedPicture> denoised_;
  std::exception_ptr denoise_failure_;
};

/// Takes the outputs for this process.
/// @return false: another one makes them
bool FrameRun::claim()
{
  for (const auto& [option, path] : outputs_of(paths_)) {
    try {
      check_writable(path);
      locks_.push_back(std::make_unique<OutputLock>(path));
    } catch (const OutputError&) {
      // Where the frame is there already, nothing is to be written.
      if (!arguments_.resume) throw;
      if (!unwritable_) unwritable_ = std::current_exception();
      continue;
    }
    const std::string& holder = locks_.back()->holder();
    if (holder.empty()) continue;
    if (!arguments_.resume) throw OutputError(path.string(), "is being made by " + holder);
    report_skipped(progress_, paths_, number(), fmt::format("is being made by {}, left out", holder));
    return false;
  }
  return true;
}

void FrameRun::load()
{
  const auto start = std::chrono::steady_clock::now();
  LoadOptions load = arguments_.setup.load_options(frame_);
  load.camera = camera_choice(arguments_.picture);
  load.texture_budget_bytes = static_cast<std::size_t>(arguments_.texture_memory_gib * (1u << 30));
  scene_ = kept_ != nullptr ? kept_->load(arguments_.scene, load, &stats_.kept)
                            : std::make_shared<const Scene>(scene_load(arguments_.scene, load));
  files_.add_inputs("a file of the scene", scene_->files);
  stats_.load_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  stats_.scene = arguments_.scene;
  stats_.version = RELIEF_VERSION;
  stats_.frame = number();
  stats_.warnings = scene_->warnings;
  for (std::string& text : warnings_about(arguments_, *scene_)) stats_.warnings.push_back(std::move(text));
  progress_.phase(name(), "loaded", stats_.load_seconds);
  progress_.warnings(stats_.warnings);
  if (arguments_.strict) refuse_warnings(arguments_.scene, stats_.warnings);
}

/// Options of the render and of its pictures, and the fingerprint of all that decides them.
void FrameRun::choose_options()
{
  const PictureCameras cameras = picture_cameras(*scene_, arguments_.picture, frame_);
  files_.add_inputs("a file of the camera", cameras.files);
  options_ = options_for(*scene_, arguments_, cameras.cameras);
  if (kept_ != nullptr) kept_->join(&options_);
  png_ = PngOptions{options_.settings.view, options_.settings.exposure};
  png_.display = arguments_.display.value_or("");
  png_.alpha = arguments_.setup.background == "transparent";
  files_read_ = scene_->files;
  files_read_.insert(files_read_.end(), cameras.files.begin(), cameras.files.end());
  if (!paths_.png.empty()) {
    view_.emplace(png_.view, png_.display);
    stats_.view = view_->description();
    for (const std::string& file : view_->files()) files_read_.push_back(file_stamp(file));
    files_.add_inputs("a file of the colour view", files_read_);
  }
  fingerprint_ = render_fingerprint(arguments_.settings, options_.settings, frame_, files_read_);
}

/// Settings for the statistics, and the reference that errors are told by.
void FrameRun::describe()
{
  reference_ = reference_load(paths_.reference, options_);
  if (reference_) {
    options_.reference_error = [this](const FilmView& film) {
      const ImageErrors errors = errors_against(*reference_, film, film_layer(film, Aov::kBeauty));
      return ImageError{errors.rmse, errors.relmse};
    };
  }
  for (const SettingValue& setting : setting_values(options_.settings)) {
    stats_.settings.emplace_back(setting.info->name, setting_text(setting.value));
  }
  // Of the page about the frame, so that `relief report` makes the same.
  const AovMask report_mask = arguments_.report.empty() ? 0 : report_aovs(*scene_);
  frame_files_.emplace(files_, paths_, command_,
                       ExrOptions{compression_of(arguments_), arguments_.float_color, color_space_of(arguments_)},
                       arguments_.aov_mask | report_mask, exr_camera_attributes(options_.camera), progress_);
}

void FrameRun::go_on_from_saved()
{
  if (arguments_.resume) saved_ = state_of(paths_, fingerprint_, stats_, progress_);
  if (!saved_) return;
  options_.saved = &*saved_;
  report_resumed(progress_, paths_, stats_.frame, *saved_);
}

/// Lets the render tell how far it is.
void FrameRun::listen()
{
  options_.checkpoint_seconds = checkpoint_seconds(arguments_, paths_);
  if (options_.checkpoint_seconds > 0) {
    options_.checkpoint = [this](const RenderState& state, std::span<const float> sums, const FilmView& film) {
      frame_files_->write_checkpoint(state, sums, film, stats_, fingerprint_);
    };
  }
  if (!paths_.preview.empty()) {
    options_.preview = [this](const FilmView& film, double samples) {
      frame_files_->write_preview(stats_.frame, film, samples);
    };
  }
  options_.prepared = [this] {
    saving_.emplace();
    progress_.phase(name(), "built", stats_.build_seconds);
  };
  options_.traced_photons = [this](double seconds) {
    progress_.phase(name(), "photons of the first sample traced", seconds);
  };
}

/// Renders, and forgets what the pictures are made from, unless that is kept: they are written in its memory.
RenderedImage FrameRun::sample()
{
  const std::string title = frame_ ? fmt::format("frame {} ", *frame_) : std::string();
  KeptContext& context = kept_ != nullptr ? kept_->scene.context() : of_frame_;
  RenderedImage image =
      render(*scene_, options_, interrupt_flag(), progress_.callback(stats_.frame, name(), title), context, stats_);
  stats_.peak_memory_bytes = peak_memory_bytes();
  if (stats_.first_nonfinite) {
    stats_.warnings.push_back(
        "samples that were not finite count as black; the first one's rays: " +
        replay_command(arguments_.scene, arguments_.path_settings, frame_, *stats_.first_nonfinite));
  }
  more_attributes_ = exr_cryptomatte_attributes(*scene_, options_.aov_mask);
  if (arguments_.part.count > 1) {
    more_attributes_["relief:sample_ranges"] =
        sample_range_text({options_.first_sample, options_.first_sample + options_.num_samples,
                           static_cast<std::uint32_t>(options_.settings.samples)});
  }
  // Whoever sends requests shows the picture to somebody who works on the scene, and may be in the dark on purpose.
  if (stats_.samples_per_pixel >= 1 && !progress_.is_of_request()) {
    if (std::string text = emptiness_warning(*scene_, image.view); !text.empty()) {
      stats_.warnings.push_back(arguments_.scene + ": " + text);
    }
  }
  of_frame_.reset();
  scene_.reset();
  return image;
}

void FrameRun::denoise(const RenderedImage& image)
{
  if (arguments_.denoiser == Denoiser::kNone) return;
  try {
    denoised_ = denoise_picture(arguments_.denoiser, all_channels(image.view), name(), &interrupt_flag());
    if (std::isnan(denoised_->result.rmse)) {
      stats_.warnings.emplace_back("--denoise: pixels with less than two samples stay as they are");
    }
  } catch (const DenoiseStopped&) {
    stats_.stop_reason = "interrupted";
    progress_.note(fmt::format("{}: interrupted, not denoised", name()));
  } catch (...) {
    // What was rendered is saved all the same.
    denoise_failure_ = std::current_exception();
  }
}

/// @param is_complete  nothing is to be done again
void FrameRun::write(const RenderedImage& image, bool is_complete)
{
  progress_.warnings(stats_.warnings);
  const auto page = [&](const Attributes& attributes) {
    return report_html(paths_, image.view, stats_, attributes, reference_);
  };
  frame_files_->write(image, denoised_ ? &*denoised_ : nullptr, stats_, more_attributes_, png_, page, fingerprint_,
                      is_complete);
  if (denoise_failure_) {
    progress_.note(fmt::format("{}: saved, but not denoised", name()));
    std::rethrow_exception(denoise_failure_);
  }
  std::optional<ImageErrors> errors, denoised_errors;
  if (reference_) errors = errors_against(*reference_, image.view, film_layer(image.view, Aov::kBeauty));
  if (reference_ && denoised_) {
    denoised_errors = errors_against(*reference_, image.view, denoised_->beauty(image.view.height));
  }
  report_frame(progress_, paths_, stats_, denoised_, errors, denoised_errors);
  if (view_) hint_at_clipping(progress_, paths_.png, image.view, *view_, png_.exposure);
  if (arguments_.strict) refuse_warnings(arguments_.scene, stats_.warnings);
}

bool FrameRun::run()
{
  if (!claim()) return true;
  farewell_.emplace([this] { note_unwritten(); });
  load();
  choose_options();
  if (arguments_.resume && is_whole_render(paths_, fingerprint_)) {
    report_skipped(progress_, paths_, stats_.frame, "already rendered");
    return true;
  }
  if (unwritable_) std::rethrow_exception(unwritable_);
  describe();
  go_on_from_saved();
  listen();
  const RenderedImage image = sample();
  const auto is_whole = [this] { return stats_.stop_reason != "interrupted"; };
  if (stats_.samples_per_pixel <= 0) {
    if (is_whole()) throw OutputError(paths_.exr, "not written: the time limit came before the first sample");
    note_unwritten();
    return false;
  }
  // Textures may be read until here.
  const std::vector<std::string> changed = files_changed(files_read_);
  for (const std::string& file : changed) {
    stats_.warnings.push_back(file + ": changed after the render had begun: the picture may show either state");
  }
  denoise(image);
  write(image, is_whole() && changed.empty() && !denoise_failure_);
  return is_whole();
}

/// Frames in the order in which they are rendered; nothing stands for the rest pose.
std::vector<std::optional<int>> frames_of_run(const std::vector<int>& numbers)
{
  if (numbers.empty()) return {std::nullopt};
  return {numbers.begin(), numbers.end()};
}

/// Refuses files that would stand among the events.
/// @param frame  any of the run: streams have the same name for all
void refuse_standard_output(const RenderArguments& arguments, std::optional<int> frame)
{
  for (const auto& [option, path] : outputs_of(paths_of_frame(arguments, frame))) {
    if (path.empty() || !is_standard_output(path)) continue;
    throw CLI::ValidationError(
        option, fmt::format("expected a file, found '{}': events are printed to standard output", path.string()));
  }
}

/// @param session  null: this is the process's only run
int render_all(const RenderArguments& arguments, const std::string& command, RenderSession* session)
{
  const std::vector<std::optional<int>> frames = frames_of_run(frames_of(arguments.frames, arguments.scene));
  RunFiles files = files_of_run(arguments, frames);
  denoiser_require(arguments.denoiser);

  if (session == nullptr) {
    broken_pipes_ignore();
    if (arguments.grace > 0) interrupt_grace(arguments.grace);
  } else if (arguments.grace > 0) {
    throw CLI::ValidationError("--grace", "expected a run of its own, found a request to relief serve");
  }
  const int threads = arguments.threads > 0 ? arguments.threads : tbb::info::default_concurrency();
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
  exr_use_threads(threads > 1 ? threads : 0);
  tbb::task_arena arena(threads);
  ProgressPrinter progress(arguments.progress, session != nullptr ? session->request : nlohmann::json(), arguments.log);
  if (progress.is_json()) refuse_standard_output(arguments, frames.front());
  std::optional<KeptFrames> of_run;
  if (session == nullptr && frames.size() > 1) of_run.emplace();
  KeptFrames* const kept = session != nullptr ? session->kept.get() : of_run ? &*of_run : nullptr;
  std::vector<std::string> failed;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const std::optional<int> frame = frames[i];
    bool is_whole = false;
    try {
      arena.execute([&] { is_whole = FrameRun(arguments, command, frame, files, kept, progress).run(); });
    } catch (const std::exception& error) {
      // Wrong usage is wrong for every frame.
      if (!arguments.keep_going || dynamic_cast<const CLI::Error*>(&error) != nullptr) {
        progress.log_line("relief: " + error_text(error));
        throw;
      }
      failed.push_back(frame ? std::to_string(*frame) : "rest pose");
      report_failed(progress, frame.value_or(0), failed.back(), error);
      is_whole = true;
    }
    const bool is_last = i + 1 == frames.size();
    // One that was finished all the same, and the last, leaves nothing to be desired.
    if (!is_whole || (interrupt_is_announced() && !is_last)) return kInterrupted;
  }
  if (failed.empty()) return 0;
  throw std::runtime_error(
      fmt::format("{} of {} frames failed: {}", failed.size(), frames.size(), fmt::join(failed, ", ")));
}

}  // namespace

namespace {

/// Adds the command with its options, which go to `a`.
/// @return  the command, and those of its options that decide a path
std::pair<CLI::App*, std::vector<CLI::Option*>> add_render(CLI::App& app, RenderArguments& a)
{
  constexpr const char* kDefaultAovs = "beauty,samples,variance,half";
  a.aov_mask = parse_aovs(kDefaultAovs);
  CLI::App* command = app.add_subcommand("render", "Renders a scene to OpenEXR and PNG");
  const auto output = [](const char* option, const char* suffix) {
    return [=](const std::string& text) { return parse_output(option, text, suffix); };
  };
  names_file(command->add_option("scene", a.scene, "Scene to render"), kSceneSuffixes)->required();
  names_file(add_parsed(*command, "-o,--output", a.output, output("--output", ".exr"),
                        "OpenEXR to write; with --frames, #### stands for the number"),
             {".exr"})
      ->required();
  names_file(add_parsed(*command, "--png", a.png, output("--png", ".png"), "PNG to write, through a colour view"),
             {".png"});
  names_file(command->add_option("--stats", a.stats, "JSON file of statistics to write"), {".json"});
  names_file(add_parsed(*command, "--preview", a.preview, output("--preview", ".exr"),
                        "OpenEXR to write now and then while rendering"),
             {".exr"});
  names_file(
      add_parsed(*command, "--report", a.report, output("--report", ".html"), "HTML page to write about the frame"),
      {".html"});
  std::vector<CLI::Option*> path_options = add_picture_options(*command, a.picture);
  for (CLI::Option* option : add_ray_options(*command, a.picture)) path_options.push_back(option);
  for (CLI::Option* option : add_light_options(*command, a.setup)) path_options.push_back(option);
  command->add_option("--time-limit", a.time_limit, "Stop sampling a frame after this many seconds")
      ->check(number(0.001, 1e9));
  constexpr SettingInfo kThreshold = setting_info("noiseThreshold"), kExposure = setting_info("exposure");
  command->add_option("--noise-threshold", a.noise_threshold, setting_help(kThreshold))
      ->check(setting_check(kThreshold));
  command->add_option("--threads", a.threads, "Threads (default: all processors)")->check(whole_number(1, 4096));
  add_parsed(*command, "--frames", a.frames, parse_frames,
             "Frames, such as 1-10,20,30-60x2, or all of the scene (default: the rest pose)");
  add_parsed(*command, "--part", a.part, parse_part,
             "I/N: only the I-th of N parts of the samples, which relief merge joins");
  command->add_flag("--resume", a.resume,
                    "Skip frames whose files are whole and of the same scene and settings, go on with unfinished ones");
  command
      ->add_option(
          "--checkpoint", a.checkpoint,
          "Seconds after which an unfinished picture is saved to go on from; 0: never (default: 60 with --resume)")
      ->check(number(0, 1e9));
  command->add_flag("--keep-going", a.keep_going, "Render the frames after one that fails; exit code 1 at the end");
  command->add_option("--grace", a.grace, "Seconds from SIGTERM to the end of the program, whatever it is doing")
      ->check(number(0.1, 1e9));
  command->add_flag("--strict", a.strict, "Turn warnings into errors");
  command->add_option("--view", a.view, setting_help(setting_info("view")));
  command->add_option("--display", a.display, "OpenColorIO display of the PNG's view (default: the configuration's)");
  command->add_option("--exposure", a.exposure, setting_help(kExposure))->check(setting_check(kExposure));
  add_parsed(*command, "--aov", a.aov_mask, parse_aovs, "Layers to keep: names separated by commas, or all")
      ->check(listed_words(aov_words()))
      ->default_str(kDefaultAovs);
  add_denoiser(*command, a.denoiser, Denoiser::kNone);
  command->add_option("--compression", a.compression, "Of the OpenEXR")
      ->check(one_of({kExrCompressionNames.begin(), kExrCompressionNames.end()}))
      ->capture_default_str();
  command->add_option("--color-space", a.color_space, "Primaries of the OpenEXR's colours")
      ->check(one_of({kColorSpaceNames.begin(), kColorSpaceNames.end()}))
      ->capture_default_str();
  command->add_flag("--float", a.float_color, "Store colours as 32-bit floats instead of halves");
  names_file(
      command->add_option("--reference", a.reference, "OpenEXR to measure the error against; #### as for --output"),
      {".exr"});
  names_file(command->add_option("--log", a.log, "File that gets, below what it has, what the run says, with the time, and its progress"),
             {".log"});
  command->add_option("--progress", a.progress, "bar (on a terminal), json (on standard output) or none")
      ->check(one_of({"bar", "json", "none"}))
      ->capture_default_str();
  command
      ->add_option("--texture-memory", a.texture_memory_gib,
                   "GiB of textures to keep in memory; more are read through a tile cache")
      ->check(number(0, 1e6))
      ->capture_default_str();
  add_continue_without_textures(*command, a.setup);
  add_max_memory(*command);
  return {command, std::move(path_options)};
}

}  // namespace

RunFiles render_files(const std::vector<std::string>& words, const std::vector<int>& frames)
{
  CLI::App app;
  RenderArguments arguments;
  add_render(app, arguments);
  app.parse(std::vector<std::string>(words.rbegin(), words.rend()));
  RunFiles files = files_of_run(arguments, frames_of_run(frames));
  files.add_inputs("a file of the scene", scene_files(arguments.scene));
  const std::string& camera_from = arguments.picture.camera_from;
  if (!camera_from.empty()) files.add_inputs("a file of the camera", scene_files(camera_from));
  if (arguments.png.empty()) return files;
  try {
    const ColorView view(arguments.view.value_or(scene_settings(arguments.scene).view));
    for (const std::string& file : view.files()) files.add_input("a file of the colour view", file);
  } catch (const InputError&) {
    // Those who render may have another configuration.
  }
  return files;
}

void cmd_render_register(CLI::App& app, Run& run, const std::string& command_line, RenderSession* session)
{
  auto arguments = std::make_shared<RenderArguments>();
  const auto [command, path_options] = add_render(app, *arguments);
  command->callback([&run, command_line, session, arguments, command = command, path_options = path_options] {
    arguments->settings = settings_given(*command);
    arguments->path_settings = words_given(path_options);
    run = [command_line, session, arguments] { return render_all(*arguments, command_line, session); };
  });
}

}  // namespace relief
