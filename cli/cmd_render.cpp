#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>

#include <sys/resource.h>
#include <unistd.h>

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/task_arena.h>
#include <nlohmann/json.hpp>

#include "cli/arguments.h"
#include "cli/commands.h"
#include "cli/fingerprint.h"
#include "cli/scene_setup.h"
#include "exporters/atomic_file.h"
#include "exporters/errors.h"
#include "exporters/exr.h"
#include "exporters/image_metrics.h"
#include "exporters/png_ocio.h"
#include "exporters/stats_json.h"
#include "integrator/render.h"
#include "scene/load.h"

namespace relief {

namespace {

struct RenderArguments {
  std::string scene, output, png, resolution, frames, camera, crop, view, aovs, stats, reference, filter;
  std::string progress = "bar", compression = "zip";
  int samples = 0, threads = 0, max_bounces = -1;
  double time_limit = 0, noise_threshold = -1, exposure = std::nan("");
  std::optional<std::uint64_t> seed;
  bool resume = false, strict = false, float_color = false;
  double texture_memory_gib = 4;
};

std::atomic<bool> g_stop{false};

void on_signal(int)
{
  // A second signal ends the program at once.
  if (g_stop.exchange(true)) std::_Exit(130);
}

std::uint64_t peak_memory_bytes()
{
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024u;
}

/// Writes progress as a bar on a terminal or as one JSON object a line.
class ProgressPrinter {
 public:
  explicit ProgressPrinter(const std::string& kind)
      : json_(kind == "json"), bar_(kind == "bar" && isatty(STDERR_FILENO) != 0)
  {
  }

  std::function<void(const RenderProgress&)> callback(int frame)
  {
    if (!json_ && !bar_) return {};
    return [this, frame](const RenderProgress& p) { print(frame, p); };
  }

  void event(const nlohmann::json& object) const
  {
    if (!json_) return;
    fmt::print("{}\n", object.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
    std::fflush(stdout);
  }

  void clear_bar() const
  {
    if (bar_) fmt::print(stderr, "\r\033[K");
  }

 private:
  void print(int frame, const RenderProgress& p) const
  {
    if (json_) {
      event({{"event", "progress"},
             {"frame", frame},
             {"fraction", p.fraction},
             {"samples", p.samples_per_pixel},
             {"seconds", p.seconds},
             {"seconds_left", p.seconds_left},
             {"rays_per_second", p.rays_per_second}});
      return;
    }
    constexpr int kWidth = 30;
    const int done = static_cast<int>(p.fraction * kWidth);
    fmt::print(stderr, "\r[{:#<{}}{: <{}}] {:5.1f}%  {:.0f} spp  {:.0f} s left  {:.2f} Mrays/s \033[K", "", done, "",
               kWidth - done, 100 * p.fraction, p.samples_per_pixel, p.seconds_left, p.rays_per_second * 1e-6);
    std::fflush(stderr);
  }

  bool json_, bar_;
};

RenderOptions options_for(const Scene& scene, const RenderArguments& arguments)
{
  RenderOptions options;
  RenderSettings& settings = options.settings;
  settings = scene.render;
  if (!arguments.resolution.empty()) parse_resolution(arguments.resolution, &settings.width, &settings.height);
  if (arguments.samples > 0) settings.samples = arguments.samples;
  if (arguments.noise_threshold >= 0) settings.noise_threshold = static_cast<float>(arguments.noise_threshold);
  if (arguments.max_bounces >= 0) {
    settings.max_bounces = arguments.max_bounces;
    settings.diffuse_bounces = std::min(settings.diffuse_bounces, arguments.max_bounces);
    settings.glossy_bounces = std::min(settings.glossy_bounces, arguments.max_bounces);
    settings.transmission_bounces = std::min(settings.transmission_bounces, arguments.max_bounces);
  }
  if (arguments.seed) settings.seed = *arguments.seed;
  if (!arguments.view.empty()) settings.view = arguments.view;
  if (!std::isnan(arguments.exposure)) settings.exposure = static_cast<float>(arguments.exposure);
  if (!arguments.filter.empty()) {
    settings.filter = arguments.filter == "box" ? PixelFilter::kBox : PixelFilter::kBlackmanHarris;
    settings.filter_width = arguments.filter == "box" ? 1.0f : 1.5f;
  }
  options.camera = camera_for_image(scene, arguments.camera, settings.width, settings.height);
  if (!arguments.crop.empty()) {
    const PixelRect crop = parse_crop(arguments.crop);
    if (crop.x1 > settings.width || crop.y1 > settings.height) {
      throw CLI::ValidationError("--crop", fmt::format("expected a window inside the image of {}x{}, found '{}'",
                                                       settings.width, settings.height, arguments.crop));
    }
    options.crop_x0 = crop.x0;
    options.crop_y0 = crop.y0;
    options.crop_x1 = crop.x1;
    options.crop_y1 = crop.y1;
  }
  options.time_limit_seconds = arguments.time_limit;
  options.aov_mask = parse_aovs(arguments.aovs);
  return options;
}

/// Root mean square errors against a reference picture, of the window both have.
void print_reference_error(const std::string& reference, const std::filesystem::path& rendered, double seconds)
{
  const Picture a = exr_load(rendered);
  const Picture b = exr_load(reference);
  const ImageErrors errors = image_errors(picture_layer(a, ""), picture_layer(b, ""));
  fmt::print("against {}: RMSE {:.6g}, relMSE {:.6g} after {:.2f} s\n", reference, errors.rmse, errors.relmse, seconds);
}

/// One frame, from loading to files.
/// @return false if it was interrupted
bool render_frame(const RenderArguments& arguments,
                  const std::string& command,
                  std::optional<int> frame,
                  ProgressPrinter& progress)
{
  const std::filesystem::path output =
      frame ? frame_path(arguments.output, *frame) : std::filesystem::path(arguments.output);
  const auto load_start = std::chrono::steady_clock::now();
  LoadOptions load;
  load.has_frame = frame.has_value();
  load.frame = frame.value_or(0);
  load.texture_budget_bytes = static_cast<std::size_t>(arguments.texture_memory_gib * (1u << 30));
  const Scene scene = scene_load(arguments.scene, load);

  Statistics stats;
  stats.load_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - load_start).count();
  stats.scene = arguments.scene;
  stats.version = RELIEF_VERSION;
  stats.frame = frame.value_or(0);
  stats.warnings = scene.warnings;
  if (arguments.strict && !stats.warnings.empty()) {
    throw SceneError(arguments.scene, "", "no warnings (--strict)", stats.warnings.front());
  }
  for (const std::string& warning : stats.warnings) fmt::print(stderr, "relief: warning: {}\n", warning);

  const RenderOptions options = options_for(scene, arguments);
  const std::string fingerprint = render_fingerprint(scene, options);
  if (arguments.resume && is_whole_render(output, fingerprint)) {
    fmt::print(stderr, "{}: already rendered\n", output.string());
    progress.event({{"event", "skipped"}, {"frame", stats.frame}, {"output", output.string()}});
    return true;
  }
  // Open the output's folder and the colour configuration before hours of work, not after.
  {
    const AtomicFile probe(output);
  }
  std::optional<ColorView> view;
  if (!arguments.png.empty()) view.emplace(options.settings.view);

  const RenderedImage image = render(scene, options, g_stop, progress.callback(stats.frame), stats);
  progress.clear_bar();
  stats.peak_memory_bytes = peak_memory_bytes();
  if (view) stats.view = view->description();

  Attributes attributes = exr_attributes(stats, command);
  if (!g_stop) attributes["relief:fingerprint"] = fingerprint;
  ExrOptions exr;
  exr.float_color = arguments.float_color;
  for (std::size_t i = 0; i < kExrCompressionNames.size(); ++i) {
    if (kExrCompressionNames[i] == arguments.compression) exr.compression = static_cast<ExrCompression>(i);
  }
  exr_write(output, image.view, attributes, exr);
  if (!arguments.png.empty()) {
    PngOptions png;
    png.view = options.settings.view;
    png.exposure = options.settings.exposure;
    png_write(frame ? frame_path(arguments.png, *frame) : std::filesystem::path(arguments.png), image.view, png);
  }
  if (!arguments.stats.empty()) {
    atomic_write(frame ? frame_path(arguments.stats, *frame) : std::filesystem::path(arguments.stats),
                 stats_json(stats));
  }
  fmt::print(stderr, "{}: {}x{}, {:.6g} samples a pixel in {:.2f} s, estimated RMSE {:.3g}{}\n", output.string(),
             image.view.width, image.view.height, stats.samples_per_pixel, stats.render_seconds, stats.error_rmse,
             view ? ", " + view->description() : "");
  progress.event({{"event", "done"},
                  {"frame", stats.frame},
                  {"output", output.string()},
                  {"seconds", stats.render_seconds},
                  {"samples", stats.samples_per_pixel},
                  {"error_rmse", stats.error_rmse},
                  {"stop_reason", stats.stop_reason}});
  if (!arguments.reference.empty()) print_reference_error(arguments.reference, output, stats.render_seconds);
  return !g_stop;
}

int render_all(const RenderArguments& arguments, const std::string& command)
{
  // Check what can be checked before anything is loaded.
  if (!arguments.resolution.empty()) {
    int width = 0;
    int height = 0;
    parse_resolution(arguments.resolution, &width, &height);
  }
  if (!arguments.crop.empty()) parse_crop(arguments.crop);
  parse_aovs(arguments.aovs);
  std::vector<std::optional<int>> frames;
  if (arguments.frames.empty()) {
    frames.emplace_back();
  } else {
    for (const int frame : parse_frames(arguments.frames)) frames.emplace_back(frame);
  }

  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
  const int threads = arguments.threads > 0 ? arguments.threads : tbb::info::default_concurrency();
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
  exr_use_threads(threads > 1 ? threads : 0);
  tbb::task_arena arena(threads);
  ProgressPrinter progress(arguments.progress);
  for (const std::optional<int> frame : frames) {
    bool finished = false;
    arena.execute([&] { finished = render_frame(arguments, command, frame, progress); });
    if (!finished) return 130;
  }
  return 0;
}

}  // namespace

void cmd_render_register(CLI::App& app, Run& run, const std::string& command_line)
{
  auto arguments = std::make_shared<RenderArguments>();
  CLI::App* command = app.add_subcommand("render", "Renders a scene to OpenEXR and PNG");
  command->add_option("scene", arguments->scene, "Scene file (.gltf, .glb)")->required();
  command->add_option("-o,--output", arguments->output, "OpenEXR to write; with --frames, #### stands for the number")
      ->required();
  command->add_option("--png", arguments->png, "PNG to write, through a colour view");
  command->add_option("--resolution", arguments->resolution, "WIDTHxHEIGHT in pixels (default: the scene's)");
  command->add_option("--spp", arguments->samples, "Samples a pixel (default: the scene's)")
      ->check(CLI::Range(1, 1 << 24));
  command->add_option("--time-limit", arguments->time_limit, "Stop sampling a frame after this many seconds")
      ->check(CLI::PositiveNumber);
  command
      ->add_option("--noise-threshold", arguments->noise_threshold,
                   "Stop a tile at this estimated error relative to its mean (0: off)")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--seed", arguments->seed, "Seed of the random numbers (default: the scene's)");
  command->add_option("--threads", arguments->threads, "Threads (default: all processors)")->check(CLI::Range(1, 4096));
  command->add_option("--frames", arguments->frames, "Frames, such as 1-10,20,30-60x2 (default: the rest pose)");
  command->add_flag("--resume", arguments->resume,
                    "Skip frames whose output is whole and of the same scene and settings");
  command->add_flag("--strict", arguments->strict, "Turn warnings into errors");
  command->add_option("--camera", arguments->camera, "Name of the camera (default: the first)");
  command->add_option("--crop", arguments->crop, "X0,Y0,X1,Y1: render this window of the image only");
  command->add_option("--max-bounces", arguments->max_bounces, "Scattering events after the first hit")
      ->check(CLI::Range(0, 200));
  command->add_option("--filter", arguments->filter, "Pixel filter: box (1 px) or blackman-harris (1.5 px)")
      ->check(CLI::IsMember({"box", "blackman-harris"}));
  command->add_option("--view", arguments->view, "OpenColorIO view of the PNG");
  command->add_option("--exposure", arguments->exposure, "Exposure of the PNG in stops");
  command->add_option("--aov", arguments->aovs, "Layers to keep: names separated by commas, or all")
      ->default_str("beauty,samples,variance,half");
  arguments->aovs = "beauty,samples,variance,half";
  command->add_option("--compression", arguments->compression, "Of the OpenEXR")
      ->check(CLI::IsMember(std::vector<std::string>(kExrCompressionNames.begin(), kExrCompressionNames.end())))
      ->capture_default_str();
  command->add_flag("--float", arguments->float_color, "Store colours as 32-bit floats instead of halves");
  command->add_option("--reference", arguments->reference, "OpenEXR to measure the error against");
  command->add_option("--stats", arguments->stats, "JSON file of statistics to write");
  command->add_option("--progress", arguments->progress, "bar (on a terminal), json (on standard output) or none")
      ->check(CLI::IsMember({"bar", "json", "none"}))
      ->capture_default_str();
  command
      ->add_option("--texture-memory", arguments->texture_memory_gib,
                   "GiB of textures to keep in memory; more are read through a tile cache")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->callback([&run, command_line, arguments] {
    run = [command_line, arguments] { return render_all(*arguments, command_line); };
  });
}

}  // namespace relief
