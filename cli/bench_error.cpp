#include "cli/bench_error.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/task_arena.h>
#include <nlohmann/json.hpp>

#include "benchmarks/error/study.h"
#include "cli/arguments.h"
#include "cli/figure_files.h"
#include "cli/interrupt.h"
#include "cli/picture_options.h"
#include "cli/run_files.h"
#include "cli/standard_streams.h"
#include "cli/value_hint.h"
#include "exporters/atomic_file.h"
#include "exporters/exr.h"
#include "scene/diagnostics.h"
#include "scene/load.h"

namespace relief {

namespace {

struct ErrorArguments {
  std::vector<std::string> scenes, methods, levels = {"0", "auto"}, caustics = {"on", "off"}, lights = {"mis"}, beside;
  std::vector<double> times = {1, 4, 16};
  double reference_seconds = 0;
  PictureOptions picture;
  std::string reference, json, html, figures;
  int threads = 0;
  bool quick = false;
};

/// A folder of its own, removed with all that is in it.
class ScratchFolder {
 public:
  ScratchFolder()
  {
    std::string name = (std::filesystem::temp_directory_path() / "relief-bench-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error(name + ": cannot be made");
    path_ = name;
  }
  ~ScratchFolder()
  {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

/// The command that is running, and its process group; 0: none is.
std::atomic<pid_t> g_command{0};

/// Runs a command of a shell, in a process group of its own. @return what it printed; @error std::runtime_error if it failed
std::string output_of(const std::string& command)
{
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) throw std::system_error(errno, std::generic_category(), command);
  const pid_t child = ::fork();
  if (child == 0) {
    ::setpgid(0, 0);
    std::signal(SIGPIPE, SIG_DFL);
    ::dup2(ends[1], STDOUT_FILENO);
    ::execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
    std::_Exit(127);
  }
  ::close(ends[1]);
  if (child > 0) {
    // Here, too: whichever of the two processes comes first.
    ::setpgid(child, child);
    g_command = child;
  }
  std::string text;
  std::array<char, 4096> block;
  for (ssize_t size = 0; child > 0 && (size = ::read(ends[0], block.data(), block.size())) != 0;) {
    if (size < 0 && errno == EINTR) continue;
    if (size < 0) break;
    text.append(block.data(), static_cast<std::size_t>(size));
  }
  ::close(ends[0]);
  int status = 0;
  if (child < 0 || ::waitpid(child, &status, 0) < 0 || status != 0) status = -1;
  g_command = 0;
  if (status != 0) throw std::runtime_error(command + ": failed");
  return text;
}

/// A renderer that takes what benchmarks/cycles/render_cycles.py takes, and prints JSON as it does.
/// @param text  NAME=COMMAND
OtherRenderer other_renderer(const std::string& text, int threads)
{
  const std::size_t sign = text.find('=');
  if (sign == 0 || sign == std::string::npos || sign + 1 == text.size()) {
    throw CLI::ValidationError("--beside", fmt::format("expected NAME=COMMAND, found '{}'", text));
  }
  OtherRenderer other;
  other.name = text.substr(0, sign);
  other.render = [command = text.substr(sign + 1), threads](const std::string& scene, int width, int height,
                                                            int samples, const std::string& output) {
    const std::string line = fmt::format("{} {} {} --spp {} --seed 1 --resolution {}x{} --threads {}", command,
                                         shell_quoted(scene), shell_quoted(output), samples, width, height, threads);
    const nlohmann::json printed = nlohmann::json::parse(output_of(line), nullptr, false);
    const auto number = [&](const char* key) {
      const nlohmann::json::json_pointer place("/runs/0/" + std::string(key));
      if (printed.is_discarded() || !printed.contains(place) || !printed.at(place).is_number()) {
        throw std::runtime_error(
            fmt::format("{}: expected JSON with {}, found something else", line, place.to_string()));
      }
      return printed.at(place).get<double>();
    };
    return OtherRenderer::Seconds{number("render_seconds"), number("preparation_seconds")};
  };
  return other;
}

/// Index of a word among labels. @pre it is one of them
template <class Labels>
std::size_t index_of(const std::string& word, const Labels& labels)
{
  return static_cast<std::size_t>(std::find(std::begin(labels), std::end(labels), word) - std::begin(labels));
}

ErrorStudyOptions study_options(const ErrorArguments& arguments, int threads)
{
  ErrorStudyOptions study;
  study.scenes = arguments.scenes;
  for (const std::string& name : arguments.methods) {
    study.methods.push_back(static_cast<DisplacementMethod>(index_of(name, kDisplacementMethodLabels)));
  }
  for (const std::string& level : arguments.levels) study.levels.push_back(parse_lod(level));
  for (const std::string& mode : arguments.caustics) {
    study.caustics.push_back(static_cast<CausticsMode>(index_of(mode, kCausticsModeLabels)));
  }
  for (const std::string& light : arguments.lights) {
    study.lights.push_back(static_cast<LightTechnique>(index_of(light, kLightTechniqueLabels)));
  }
  for (const std::string& other : arguments.beside) study.others.push_back(other_renderer(other, threads));
  study.times = arguments.times;
  std::sort(study.times.begin(), study.times.end());
  PictureOptions picture = arguments.picture;
  // The same filter as that of other renderers, and no wider than a pixel, which would hide noise.
  picture.filter = PixelFilter::kBox;
  if (arguments.quick) {
    study.times = {0.02, 0.1};
    if (picture.resolution.width == 0) picture.resolution = {48, 32};
  }
  study.reference_seconds = arguments.reference_seconds > 0 ? arguments.reference_seconds : 8 * study.times.back();
  study.render_options = [picture](const Scene& scene) { return render_options(scene, picture, scene.cameras); };
  if (isatty(STDERR_FILENO) != 0) {
    study.progress = [](const std::string& line) { std::fputs((printable_text(line) + "\n").c_str(), stderr); };
  }
  return study;
}

/// Prints the tables and writes the files. @return whether all that was asked for is there
bool write_results(const ErrorArguments& arguments, const RunFiles& files, const ErrorStudyResults& results)
{
  fmt::print("{}", error_study_markdown(results));
  files.check_output("--json", arguments.json);
  files.check_output("--html", arguments.html);
  if (!arguments.json.empty()) atomic_write(arguments.json, error_study_json(results));
  if (!arguments.html.empty() || !arguments.figures.empty()) {
    const std::string page = error_study_html(results);
    if (!arguments.html.empty()) atomic_write(arguments.html, page);
    if (!arguments.figures.empty()) figures_write(files, arguments.figures, page);
  }
  bool is_whole = true;
  for (const ErrorSceneResult& scene : results.scenes) {
    for (const std::string& failure : scene.failures) print_warning(scene.scene + ": " + failure);
    is_whole = is_whole && scene.failures.empty();
  }
  return is_whole;
}

int bench_error(const ErrorArguments& arguments)
{
  if (!arguments.reference.empty() && arguments.scenes.size() > 1) {
    throw CLI::ValidationError("--reference", fmt::format("expected one scene, found {}", arguments.scenes.size()));
  }
  RunFiles files;
  files.add_output("--json", arguments.json);
  files.add_output("--html", arguments.html);
  for (const std::string& scene : arguments.scenes) {
    files.add_input("a scene", scene);
    files.add_inputs("a file of the scene", scene_files(scene));
  }
  files.add_input("the reference", arguments.reference);
  for (const std::string& output : {arguments.json, arguments.html}) check_writable(output);
  if (!arguments.figures.empty()) figures_folder_make(arguments.figures);
  broken_pipes_ignore();
  const int threads = arguments.threads > 0 ? arguments.threads : tbb::info::default_concurrency();
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
  ErrorStudyOptions study = study_options(arguments, threads);
  if (!arguments.reference.empty()) study.reference = exr_load(arguments.reference);
  std::optional<ScratchFolder> scratch;
  if (!study.others.empty()) study.scratch = scratch.emplace().path();
  std::mutex mutex;
  ErrorStudyResults so_far;
  study.measured = [&](const ErrorStudyResults& results) {
    const std::lock_guard lock(mutex);
    so_far = results;
  };
  ErrorStudyResults results;
  {
    const Farewell farewell([&] {
      if (const pid_t command = g_command; command > 0) ::kill(-command, SIGKILL);
      scratch.reset();
      const std::lock_guard lock(mutex);
      if (so_far.scenes.empty()) return;
      write_results(arguments, files, so_far);
      standard_output_flush();
    });
    tbb::task_arena(threads).execute([&] { results = error_study_run(study); });
  }
  const KeepsForSaving writing;
  return write_results(arguments, files, results) ? kDone : kFailed;
}

std::vector<std::string> words(std::span<const std::string_view> labels) { return {labels.begin(), labels.end()}; }

}  // namespace

void bench_error_register(CLI::App& bench, Run& run)
{
  CLI::App* command =
      bench.add_subcommand("error", "Speed against error: scenes rendered in all ways, one reference each");
  const auto arguments = std::make_shared<ErrorArguments>();
  ErrorArguments& a = *arguments;
  const auto list = [&](const char* name, std::vector<std::string>& values, const char* help) {
    return command->add_option(name, values, help)->delimiter(',');
  };
  command->add_option("scenes", a.scenes, "Scene files (.gltf, .glb)")->required();
  command->add_option("--times", a.times, "Seconds of sampling at which errors are told, separated by commas")
      ->delimiter(',')
      ->check(number(0.001, 1e6))
      ->capture_default_str();
  list("--methods", a.methods, "Of tracing displaced meshes (default: the scene's)")
      ->check(one_of(words(kDisplacementMethodLabels)));
  list("--levels", a.levels, "Of height maps: auto, or numbers")
      ->check([](const std::string& text) {
        parse_lod(text);
        return std::string();
      })
      ->capture_default_str();
  list("--caustics", a.caustics, "on, off, auto")->check(one_of(words(kCausticsModeLabels)))->capture_default_str();
  list("--lights", a.lights, "Ways to sample lights: mis, lights, surfaces")
      ->check(one_of(words(kLightTechniqueLabels)))
      ->capture_default_str();
  add_parsed(*command, "--resolution", a.picture.resolution, parse_resolution,
             "WIDTHxHEIGHT in pixels (default: the scenes')");
  add_parsed(*command, "--seed", a.picture.seed, parse_seed, "Seed of the random numbers (default: the scenes')");
  command->add_option("--reference", a.reference, "OpenEXR to judge the one scene by (default: rendered)");
  command
      ->add_option("--reference-time", a.reference_seconds,
                   "Seconds for each reference (default: 8 times the last time)")
      ->check(number(0.001, 1e6));
  command
      ->add_option("--beside", a.beside,
                   "NAME=COMMAND: another renderer, such as Cycles=benchmarks/cycles/render_cycles.py; may be repeated")
      ->type_name("NAME=COMMAND");
  command->add_option("--threads", a.threads, "Threads (default: all processors)")->check(whole_number(1, 4096));
  add_parsed(
      *command, "--json", a.json, [](const std::string& text) { return parse_output("--json", text, ".json"); },
      "Figures, as JSON");
  add_parsed(
      *command, "--html", a.html, [](const std::string& text) { return parse_output("--html", text, ".html"); },
      "One page with tables and plots");
  names_file(command->add_option("--figures", a.figures, "Folder that gets each plot, as SVG and PNG"), {})
      ->type_name("FOLDER");
  command->add_flag("--quick", a.quick, "Small pictures, a tenth of a second: whether it works, not how fast");
  command->callback([&run, arguments] { run = [arguments] { return bench_error(*arguments); }; });
}

}  // namespace relief
