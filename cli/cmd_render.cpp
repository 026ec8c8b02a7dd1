#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <sys/resource.h>

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/task_arena.h>
#include <nlohmann/json.hpp>

#include "cli/arguments.h"
#include "cli/commands.h"
#include "cli/fingerprint.h"
#include "cli/interrupt.h"
#include "cli/progress_printer.h"
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

/// Exit code of a render that was stopped: what was rendered is saved.
constexpr int kInterrupted = 130;

struct RenderArguments {
  std::string scene, output, png, stats, reference, camera;
  Resolution resolution;
  PixelRect crop;
  std::vector<int> frames;  ///< empty: the rest pose
  int samples = 0, threads = 0, max_bounces = -1;
  double time_limit = 0, noise_threshold = -1;
  std::optional<std::uint64_t> seed;
  std::optional<std::string> view;
  std::optional<double> exposure;
  std::uint32_t aov_mask = 0;
  std::string filter, compression = "zip", progress = "bar";
  bool resume = false, strict = false, float_color = false;
  double texture_memory_gib = 4;
  DisplacementOptions displacement;
  std::optional<CausticsMode> caustics;
};

/// Files of one frame; empty: not asked for.
struct FramePaths {
  std::filesystem::path exr, png, stats, reference;
};

FramePaths paths_of_frame(const RenderArguments& arguments, std::optional<int> frame)
{
  const auto numbered = [&](const std::string& pattern) {
    return frame && !pattern.empty() ? frame_path(pattern, *frame) : std::filesystem::path(pattern);
  };
  // One reference may serve all frames; it has a number only where it is asked for.
  const bool has_references =
      std::filesystem::path(arguments.reference).filename().string().find('#') != std::string::npos;
  return {numbered(arguments.output), numbered(arguments.png), numbered(arguments.stats),
          has_references ? numbered(arguments.reference) : std::filesystem::path(arguments.reference)};
}

/// No file may be written twice or written over before it is read.
void check_files_differ(const RenderArguments& arguments)
{
  struct Named {
    const char* option;
    const std::string& file;
  };
  const Named all[] = {{"--output", arguments.output},
                       {"--png", arguments.png},
                       {"--stats", arguments.stats},
                       {"--reference", arguments.reference},
                       {"the scene", arguments.scene}};
  const auto is_same = [](const std::string& a, const std::string& b) {
    std::error_code ignored;
    return std::filesystem::weakly_canonical(a, ignored) == std::filesystem::weakly_canonical(b, ignored);
  };
  constexpr std::size_t kNumOutputs = 3;
  for (std::size_t i = 0; i < kNumOutputs; ++i) {
    for (std::size_t k = i + 1; k < std::size(all); ++k) {
      if (all[i].file.empty() || all[k].file.empty() || !is_same(all[i].file, all[k].file)) continue;
      throw CLI::ValidationError(
          all[i].option, fmt::format("expected a file that is not also {}, found '{}'", all[k].option, all[i].file));
    }
  }
}

std::uint64_t peak_memory_bytes()
{
  // Not what getrusage says, where Linux has it: there the size of the program that started this one counts too.
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    std::uint64_t kibibytes = 0;
    if (word == "VmHWM:" && status >> kibibytes) return kibibytes * 1024u;
  }
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024u;
}

/// Fails now if a file could not be written after hours of work. Pipes are left alone: their reader would see an end.
void check_writable(const std::filesystem::path& path)
{
  std::error_code ignored;
  const auto status = std::filesystem::status(path, ignored);
  const bool is_file = std::filesystem::is_regular_file(status) || std::filesystem::is_directory(status);
  if (path.empty() || (std::filesystem::exists(status) && !is_file)) return;
  const AtomicFile probe(path);
}

RenderOptions options_for(const Scene& scene, const RenderArguments& arguments)
{
  RenderOptions options;
  RenderSettings& settings = options.settings;
  settings = scene.render;
  if (arguments.resolution.width > 0) {
    settings.width = arguments.resolution.width;
    settings.height = arguments.resolution.height;
  }
  if (arguments.samples > 0) settings.samples = arguments.samples;
  if (arguments.noise_threshold >= 0) settings.noise_threshold = static_cast<float>(arguments.noise_threshold);
  if (arguments.max_bounces >= 0) {
    settings.max_bounces = arguments.max_bounces;
    settings.diffuse_bounces = std::min(settings.diffuse_bounces, arguments.max_bounces);
    settings.glossy_bounces = std::min(settings.glossy_bounces, arguments.max_bounces);
    settings.transmission_bounces = std::min(settings.transmission_bounces, arguments.max_bounces);
  }
  if (arguments.seed) settings.seed = *arguments.seed;
  if (arguments.view) settings.view = *arguments.view;
  if (arguments.exposure) settings.exposure = static_cast<float>(*arguments.exposure);
  if (!arguments.filter.empty()) {
    settings.filter = arguments.filter == "box" ? PixelFilter::kBox : PixelFilter::kBlackmanHarris;
    settings.filter_width = arguments.filter == "box" ? 1.0f : 1.5f;
  }
  if (arguments.caustics) settings.caustics.mode = *arguments.caustics;
  options.camera = camera_for_image(scene, arguments.camera, settings.width, settings.height);
  const PixelRect& crop = arguments.crop;
  if (crop.x1 > settings.width || crop.y1 > settings.height) {
    throw CLI::ValidationError(
        "--crop", fmt::format("expected a window inside the image of {}x{}, found '{},{},{},{}'", settings.width,
                              settings.height, crop.x0, crop.y0, crop.x1, crop.y1));
  }
  options.crop_x0 = crop.x0;
  options.crop_y0 = crop.y0;
  options.crop_x1 = crop.x1;
  options.crop_y1 = crop.y1;
  options.time_limit_seconds = arguments.time_limit;
  options.aov_mask = arguments.aov_mask;
  options.displacement = arguments.displacement;
  return options;
}

ExrCompression compression_of(const RenderArguments& arguments)
{
  const auto* found = std::find(kExrCompressionNames.begin(), kExrCompressionNames.end(), arguments.compression);
  return static_cast<ExrCompression>(found - kExrCompressionNames.begin());
}

/// Settings that do nothing, more than meets the eye, or something else than they say.
std::vector<std::string> warnings_about(const RenderArguments& arguments, const Scene& scene)
{
  std::vector<std::string> texts = displacement_warnings(scene, arguments.displacement);
  if (arguments.png.empty() && arguments.view) texts.emplace_back("--view has no effect without --png");
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

ImageErrors errors_against(const Picture& reference, const FilmView& film)
{
  ImageView rendered = film_layer(film, Aov::kBeauty);
  ImageView expected = picture_layer(reference, "");
  rendered.channels.resize(3);
  expected.channels.resize(3);
  expected.width = rendered.width;
  expected.height = rendered.height;
  for (ChannelView& channel : expected.channels) {
    channel.first +=
        (film.crop_x - reference.crop_x) * channel.pixel_stride + (film.crop_y - reference.crop_y) * channel.row_stride;
  }
  return image_errors(rendered, expected);
}

/// Writes a frame's files, the OpenEXR last: its fingerprint says that all of them are there and whole. It is written even
/// if another file cannot be, since it is worth the most; then without the fingerprint.
/// @param fingerprint  empty: the render was interrupted
/// @error OutputError of the first file that could not be written
void write_frame(const RenderArguments& arguments,
                 const FramePaths& paths,
                 const std::string& command,
                 std::string fingerprint,
                 const PngOptions& png,
                 const FilmView& film,
                 const Statistics& stats,
                 ProgressPrinter& progress)
{
  std::exception_ptr failure;
  try {
    if (!paths.png.empty()) png_write(paths.png, film, png);
    if (!paths.stats.empty()) atomic_write(paths.stats, stats_json(stats));
  } catch (...) {
    failure = std::current_exception();
    fingerprint.clear();
  }
  Attributes attributes = exr_attributes(stats, command);
  if (!fingerprint.empty()) attributes["relief:fingerprint"] = fingerprint;
  exr_write(paths.exr, film, attributes, {compression_of(arguments), arguments.float_color});
  if (!failure) return;
  progress.note(fmt::format("{}: saved, but not all files of its frame could be", paths.exr.string()));
  std::rethrow_exception(failure);
}

/// Tells people and programs how a frame came out.
void report_frame(ProgressPrinter& progress,
                  const FramePaths& paths,
                  const Statistics& stats,
                  const std::optional<ImageErrors>& errors)
{
  const std::string estimate =
      std::isfinite(stats.error_rmse) ? fmt::format("estimated RMSE {:.3g}", stats.error_rmse) : "error unknown";
  progress.note(fmt::format("{}: {}x{}, {:.6g} samples a pixel in {:.2f} s, {}{}{}", paths.exr.string(), stats.width,
                            stats.height, stats.samples_per_pixel, stats.render_seconds, estimate,
                            stats.view.empty() ? "" : ", " + stats.view,
                            stats.stop_reason == "interrupted" ? " (interrupted)" : ""));
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
  progress.event(done);
  if (errors && !progress.is_json()) {
    std::fputs(fmt::format("against {}: RMSE {:.6g}, relMSE {:.6g} after {:.2f} s\n", paths.reference.string(),
                           errors->rmse, errors->relmse, stats.render_seconds)
                   .c_str(),
               stdout);
  }
}

/// One frame, from loading to files.
/// @return false if it was interrupted
bool render_frame(const RenderArguments& arguments,
                  const std::string& command,
                  std::optional<int> frame,
                  ProgressPrinter& progress)
{
  const FramePaths paths = paths_of_frame(arguments, frame);
  for (const auto* path : {&paths.exr, &paths.png, &paths.stats}) check_writable(*path);
  const auto load_start = std::chrono::steady_clock::now();
  LoadOptions load;
  load.has_frame = frame.has_value();
  load.frame = frame.value_or(0);
  load.texture_budget_bytes = static_cast<std::size_t>(arguments.texture_memory_gib * (1u << 30));
  Scene scene = scene_load(arguments.scene, load);

  Statistics stats;
  stats.load_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - load_start).count();
  stats.scene = arguments.scene;
  stats.version = RELIEF_VERSION;
  stats.frame = frame.value_or(0);
  stats.warnings = scene.warnings;
  for (std::string& text : warnings_about(arguments, scene)) stats.warnings.push_back(std::move(text));
  progress.warnings(stats.warnings);
  if (arguments.strict) refuse_warnings(arguments.scene, stats.warnings);

  const RenderOptions options = options_for(scene, arguments);
  const PngOptions png{options.settings.view, options.settings.exposure};
  std::string storage = fmt::format("{} {}", arguments.compression, arguments.float_color);
  if (!paths.png.empty()) {
    stats.view = ColorView(png.view).description();
    storage += fmt::format(" {} {}", stats.view, png.exposure);
  }
  const std::string fingerprint = render_fingerprint(scene, options, storage);
  const auto is_there = [](const std::filesystem::path& path) { return path.empty() || std::filesystem::exists(path); };
  if (arguments.resume && is_there(paths.png) && is_there(paths.stats) && is_whole_render(paths.exr, fingerprint)) {
    progress.note(fmt::format("{}: already rendered", paths.exr.string()));
    progress.event({{"event", "skipped"}, {"frame", stats.frame}, {"output", paths.exr.string()}});
    return true;
  }
  const std::optional<Picture> reference = reference_load(paths.reference, options);

  const std::string title = frame ? fmt::format("frame {} ", *frame) : std::string();
  const RenderedImage image = render(scene, options, interrupt_flag(), progress.callback(stats.frame, title), stats);
  stats.peak_memory_bytes = peak_memory_bytes();
  scene = {};  // Pictures are written in the memory of what they were made from.
  const bool is_whole = stats.stop_reason != "interrupted";
  if (!is_whole && stats.samples_per_pixel <= 0) {
    progress.note(fmt::format("{}: interrupted before the first sample, not written", paths.exr.string()));
    return false;
  }
  progress.warnings(stats.warnings);
  write_frame(arguments, paths, command, is_whole ? fingerprint : std::string(), png, image.view, stats, progress);
  std::optional<ImageErrors> errors;
  if (reference) errors = errors_against(*reference, image.view);
  report_frame(progress, paths, stats, errors);
  if (arguments.strict) refuse_warnings(arguments.scene, stats.warnings);
  return is_whole;
}

int render_all(const RenderArguments& arguments, const std::string& command)
{
  check_files_differ(arguments);
  std::vector<std::optional<int>> frames(arguments.frames.begin(), arguments.frames.end());
  if (frames.empty()) frames.emplace_back();

  interrupt_watch();
  const int threads = arguments.threads > 0 ? arguments.threads : tbb::info::default_concurrency();
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
  exr_use_threads(threads > 1 ? threads : 0);
  tbb::task_arena arena(threads);
  ProgressPrinter progress(arguments.progress);
  for (const std::optional<int> frame : frames) {
    bool is_whole = false;
    arena.execute([&] { is_whole = render_frame(arguments, command, frame, progress); });
    if (!is_whole || interrupt_flag()) return kInterrupted;
  }
  return 0;
}

/// A text option that is parsed into `value` while the command line is read.
template <class Value, class Parse>
CLI::Option* add_parsed(CLI::App& command, const char* name, Value& value, Parse parse, const char* description)
{
  return command.add_option_function<std::string>(
      name, [&value, parse](const std::string& text) { value = parse(text); }, description);
}

}  // namespace

void cmd_render_register(CLI::App& app, Run& run, const std::string& command_line)
{
  constexpr const char* kDefaultAovs = "beauty,samples,variance,half";
  auto arguments = std::make_shared<RenderArguments>();
  RenderArguments& a = *arguments;
  a.aov_mask = parse_aovs(kDefaultAovs);
  CLI::App* command = app.add_subcommand("render", "Renders a scene to OpenEXR and PNG");
  const auto output = [](const char* option, const char* suffix) {
    return [=](const std::string& text) { return parse_output(option, text, suffix); };
  };
  command->add_option("scene", a.scene, "Scene file (.gltf, .glb)")->required();
  add_parsed(*command, "-o,--output", a.output, output("--output", ".exr"),
             "OpenEXR to write; with --frames, #### stands for the number")
      ->required();
  add_parsed(*command, "--png", a.png, output("--png", ".png"), "PNG to write, through a colour view");
  command->add_option("--stats", a.stats, "JSON file of statistics to write");
  add_parsed(*command, "--resolution", a.resolution, parse_resolution, "WIDTHxHEIGHT in pixels (default: the scene's)");
  command->add_option("--spp", a.samples, "Samples a pixel (default: the scene's)")->check(whole_number(1, 1 << 24));
  command->add_option("--time-limit", a.time_limit, "Stop sampling a frame after this many seconds")
      ->check(number(0.001, 1e9));
  command
      ->add_option("--noise-threshold", a.noise_threshold,
                   "Stop a tile at this estimated error relative to its mean (0: off)")
      ->check(number(0, 1e6));
  add_parsed(*command, "--seed", a.seed, parse_seed, "Seed of the random numbers (default: the scene's)");
  command->add_option("--threads", a.threads, "Threads (default: all processors)")->check(whole_number(1, 4096));
  add_parsed(*command, "--frames", a.frames, parse_frames, "Frames, such as 1-10,20,30-60x2 (default: the rest pose)");
  command->add_flag("--resume", a.resume, "Skip frames whose files are whole and of the same scene and settings");
  command->add_flag("--strict", a.strict, "Turn warnings into errors");
  command->add_option("--camera", a.camera, "Name of the camera (default: the first)");
  add_parsed(*command, "--crop", a.crop, parse_crop, "X0,Y0,X1,Y1: render this window of the image only");
  command->add_option("--max-bounces", a.max_bounces, "Scattering events after the first hit")
      ->check(whole_number(0, 200));
  add_displacement_method(*command, a.displacement);
  add_displacement_memory(*command, a.displacement);
  add_displacement_lod(*command, a.displacement);
  add_caustics_mode(*command, a.caustics);
  command->add_option("--filter", a.filter, "Pixel filter: box (1 px) or blackman-harris (1.5 px)")
      ->check(one_of({"box", "blackman-harris"}));
  command->add_option("--view", a.view, "OpenColorIO view of the PNG");
  command->add_option("--exposure", a.exposure, "Exposure of the PNG in stops")->check(number(-100, 100));
  add_parsed(*command, "--aov", a.aov_mask, parse_aovs, "Layers to keep: names separated by commas, or all")
      ->default_str(kDefaultAovs);
  command->add_option("--compression", a.compression, "Of the OpenEXR")
      ->check(one_of({kExrCompressionNames.begin(), kExrCompressionNames.end()}))
      ->capture_default_str();
  command->add_flag("--float", a.float_color, "Store colours as 32-bit floats instead of halves");
  command->add_option("--reference", a.reference, "OpenEXR to measure the error against; #### as for --output");
  command->add_option("--progress", a.progress, "bar (on a terminal), json (on standard output) or none")
      ->check(one_of({"bar", "json", "none"}))
      ->capture_default_str();
  command
      ->add_option("--texture-memory", a.texture_memory_gib,
                   "GiB of textures to keep in memory; more are read through a tile cache")
      ->check(number(0, 1e6))
      ->capture_default_str();
  command->callback([&run, command_line, arguments] {
    run = [command_line, arguments] { return render_all(*arguments, command_line); };
  });
}

}  // namespace relief
