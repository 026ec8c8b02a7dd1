// `relief farm`: a shot on many machines, by a scheduler that is there already.
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <sys/wait.h>
#include <unistd.h>

#include <fmt/format.h>

#include "cli/arguments.h"
#include "cli/commands.h"
#include "cli/run_files.h"
#include "cli/scene_setup.h"
#include "cli/slurm_script.h"
#include "cli/standard_streams.h"
#include "cli/value_hint.h"
#include "exporters/atomic_file.h"
#include "exporters/errors.h"

namespace relief {

namespace {

struct FarmArguments {
  std::string scene, output, script = "farm.slurm.sh";
  FrameList frames;
  int parts = 1, retries = 2;
  int tasks = 1000;  ///< what Slurm allows if nobody has changed its MaxArraySize
  bool submit = false;
  std::vector<std::string> sbatch_options, render_options;
};

/// Whether a program can be found where a shell would look for it.
bool is_in_path(const std::string& program)
{
  const char* path = std::getenv("PATH");
  std::string_view rest = path != nullptr ? path : "";
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find(':'), rest.size());
    if (::access((std::filesystem::path(rest.substr(0, end)) / program).c_str(), X_OK) == 0) return true;
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  return false;
}

/// Reads the options after "--" as `render` will, so that mistakes are found here and not on the farm.
/// @return whether the number of threads is among them
/// @error CLI::ParseError; also for options that every part of a frame would use for the same file, and for more parts than
///        there are samples for; SceneError if that has to be read and cannot
bool check_render_options(const FarmArguments& arguments)
{
  CLI::App app;
  Run unused;
  cmd_render_register(app, unused, "");
  std::vector<std::string> words = arguments.render_options;
  words.insert(words.begin(), {"render", arguments.scene, "--output", arguments.output});
  std::reverse(words.begin(), words.end());
  try {
    app.parse(words);
  } catch (const CLI::Success&) {
    throw CLI::ValidationError("farm", "expected options of a render after --, found --help");
  }
  CLI::App& render = *app.get_subcommand("render");
  const auto refuse = [&](const char* option, const char* why) {
    if (render.get_option(option)->count() == 0) return;
    throw CLI::ValidationError("farm", fmt::format("expected no {} after --: {}", option, why));
  };
  refuse("--frames", "it stands before");
  refuse("--part", "--split makes parts");
  refuse("--progress", "nobody watches a task");
  if (arguments.parts > 1) {
    for (const char* option : {"--png", "--stats", "--preview", "--report", "--reference"}) {
      refuse(option, "with --split, no task has the whole picture");
    }
    const CLI::Option& samples = *render.get_option("--spp");
    part_samples({1, arguments.parts},
                 samples.count() > 0 ? samples.as<int>() : scene_settings(arguments.scene).samples);
  }
  return render.get_option("--threads")->count() > 0;
}

/// Frames in as many pieces as there may be, as even as can be.
std::vector<std::vector<int>> chunks_of(const FarmArguments& arguments)
{
  const std::vector<int> frames = frames_of(arguments.frames, arguments.scene);
  if (frames.empty()) return {{}};
  const std::size_t count =
      std::clamp<std::size_t>(static_cast<std::size_t>(arguments.tasks / arguments.parts), 1, frames.size());
  std::vector<std::vector<int>> chunks;
  for (std::size_t i = 0; i < count; ++i) {
    const auto at = [&](std::size_t index) {
      return frames.begin() + static_cast<std::ptrdiff_t>(index * frames.size() / count);
    };
    chunks.emplace_back(at(i), at(i + 1));
  }
  return chunks;
}

/// What the tasks of a job read and write.
RunFiles files_of(const SlurmJob& job)
{
  std::vector<int> frames;
  for (const std::vector<int>& chunk : job.chunks) frames.insert(frames.end(), chunk.begin(), chunk.end());
  std::vector<std::string> words = {"render", job.scene, "--output", job.output};
  words.insert(words.end(), job.render_options.begin(), job.render_options.end());
  RunFiles files = render_files(words, frames);
  if (job.parts == 1) return files;
  const std::vector<int> numbers = frames.empty() ? std::vector<int>{0} : frames;
  for (int part = 1; part <= job.parts; ++part) {
    const std::filesystem::path pattern = slurm_part_output(job, part);
    for (const int frame : numbers) files.add_output("--split", frames.empty() ? pattern : frame_path(pattern, frame));
  }
  return files;
}

/// Runs the script, which submits itself and prints the numbers of its jobs.
/// @error std::runtime_error: it failed, and has said why
void submit(const std::filesystem::path& script)
{
  standard_output_flush();
  const pid_t child = ::fork();
  if (child == 0) {
    ::execl("/bin/sh", "sh", script.c_str(), "submit", nullptr);
    std::_Exit(127);
  }
  int status = 0;
  if (child < 0 || ::waitpid(child, &status, 0) < 0 || status != 0) {
    throw std::runtime_error(script.string() + ": could not be submitted");
  }
}

int farm(const FarmArguments& arguments)
{
  if (arguments.submit && !is_in_path("sbatch")) {
    throw std::runtime_error("--submit: expected Slurm's sbatch in one of the folders of PATH, found none");
  }
  if (!std::filesystem::exists(arguments.scene)) throw InputError(arguments.scene, "expected a scene, found no file");
  SlurmJob job;
  job.sets_threads = !check_render_options(arguments);
  job.program = std::filesystem::read_symlink("/proc/self/exe").string();
  job.folder = std::filesystem::current_path().string();
  job.scene = arguments.scene;
  job.chunks = chunks_of(arguments);
  job.parts = arguments.parts;
  job.retries = arguments.retries;
  job.render_options = arguments.render_options;
  job.sbatch_options = arguments.sbatch_options;
  const std::filesystem::path output(arguments.output);
  const bool has_number = output.filename().string().find('#') != std::string::npos;
  job.output = job.chunks.front().empty() || has_number
                   ? arguments.output
                   : (output.parent_path() / output.stem()).string() + ".####" + output.extension().string();
  RunFiles files = files_of(job);
  files.add_output("--script", arguments.script);
  check_writable(arguments.script);
  atomic_write(arguments.script, slurm_script(job));
  std::error_code no_matter;
  using std::filesystem::perms;
  std::filesystem::permissions(arguments.script, perms::owner_exec, std::filesystem::perm_options::add, no_matter);
  const std::size_t num_tasks = job.chunks.size() * static_cast<std::size_t>(job.parts);
  print_line(fmt::format("{}: {} task{}{}", arguments.script, num_tasks, num_tasks == 1 ? "" : "s",
                         arguments.submit ? "" : "; run it to submit it"));
  if (arguments.submit) submit(std::filesystem::absolute(arguments.script));
  return 0;
}

CLI::Validator one_line()
{
  const auto check = [](const std::string& text) -> std::string {
    return text.find('\n') == std::string::npos ? "" : "expected one line, found several";
  };
  return {check, ""};
}

}  // namespace

void cmd_farm_register(CLI::App& app, Run& run)
{
  CLI::App* farm_command = app.add_subcommand("farm", "Renders a shot on many machines, through their scheduler");
  farm_command->require_subcommand(1);
  CLI::App* command =
      farm_command->add_subcommand("slurm", "Writes the job script that renders a shot on a Slurm cluster");
  const auto arguments = std::make_shared<FarmArguments>();
  FarmArguments& a = *arguments;
  names_file(command->add_option("scene", a.scene, "Scene to render, in a folder that all machines share"),
             kSceneSuffixes)
      ->required();
  command->add_option("render-options", a.render_options, "Options of relief render, after --");
  const auto exr = [](const std::string& text) { return parse_output("--output", text, ".exr"); };
  names_file(
      add_parsed(*command, "-o,--output", a.output, exr, "OpenEXR to write; with --frames, #### stands for the number"),
      {".exr"})
      ->required();
  add_parsed(*command, "--frames", a.frames, parse_frames,
             "Frames, such as 1-10,20,30-60x2, or all of the scene (default: the rest pose)");
  command->add_option("--split", a.parts, "Tasks that share the samples of each frame, joined by relief merge")
      ->check(whole_number(1, 1000))
      ->capture_default_str();
  command->add_option("--tasks", a.tasks, "Most tasks of the array; each gets as many frames as are needed for that")
      ->check(whole_number(1, 4'000'000))
      ->capture_default_str();
  command->add_option("--retries", a.retries, "How often a task that fails is queued again")
      ->check(whole_number(0, 1000))
      ->capture_default_str();
  command
      ->add_option("--sbatch", a.sbatch_options,
                   "Option of sbatch, such as --sbatch=--cpus-per-task=8; may be repeated")
      // One word each: otherwise it would take the "--" for the end of its words.
      ->allow_extra_args(false)
      ->check(one_line());
  names_file(command->add_option("--script", a.script, "Script to write"), {".sh"})->capture_default_str();
  command->add_flag("--submit", a.submit, "Submit it at once, and print the numbers of the jobs");
  command->callback([&run, arguments] { run = [arguments] { return farm(*arguments); }; });
}

}  // namespace relief
