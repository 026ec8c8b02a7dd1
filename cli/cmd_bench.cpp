#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <unistd.h>

#include <fmt/format.h>
#include <tbb/global_control.h>

#include "benchmarks/displacement/report.h"
#include "benchmarks/heightfield/study.h"
#include "benchmarks/procedural/study.h"
#include "cli/arguments.h"
#include "cli/bench_error.h"
#include "cli/commands.h"
#include "cli/figure_files.h"
#include "cli/ray_file.h"
#include "cli/run_files.h"
#include "cli/value_hint.h"
#include "exporters/atomic_file.h"
#include "exporters/errors.h"
#include "scene/diagnostics.h"
#include "scene/load.h"

namespace relief {

namespace {

struct BenchArguments {
  std::vector<std::string> scenes, parts;
  OwnSceneFiles own;  ///< of a name: in place of the scenes
  std::string rays;
  std::string json, html, csv, figures;
  double map_scale = 1, memory_gib = 0;
  int threads = 0, rounds = 3;
  bool quick = false;
};

std::vector<std::string> scene_names()
{
  std::vector<std::string> names;
  for (const BenchSceneSpec& spec : bench_scene_specs()) names.emplace_back(spec.name);
  return names;
}

BenchParts parts_of(const std::vector<std::string>& names)
{
  if (names.empty()) return {};
  const auto has = [&](const char* name) { return std::find(names.begin(), names.end(), name) != names.end(); };
  return {has("table"),        has("marching"), has("sweeps"), has("inversion"),
          has("tessellation"), has("costs"),    has("frames"), has("vector")};
}

std::uint64_t half_of_memory()
{
  return static_cast<std::uint64_t>(sysconf(_SC_PHYS_PAGES)) * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE)) / 2;
}

/// Rays of a file as the benchmark traces them: from tmin on, to what they hit first wherever tmax is.
std::vector<BenchRay> bench_rays(const std::string& file)
{
  std::vector<BenchRay> rays;
  for (const TraceRay& ray : read_rays(file)) rays.push_back({ray.O + ray.t_min * ray.D, normalize(ray.D)});
  if (rays.empty()) throw InputError(file, "expected rays, found none");
  return rays;
}

int bench_displacement(const BenchArguments& arguments)
{
  RunFiles files;
  const std::vector<std::pair<const char*, std::string>> outputs = {
      {"--json", arguments.json}, {"--html", arguments.html}, {"--csv", arguments.csv}};
  for (const auto& [option, output] : outputs) files.add_output(option, output);
  files.add_input("the mesh", arguments.own.mesh);
  if (!arguments.own.mesh.empty() && !OwnScene::is_obj(arguments.own.mesh)) {
    files.add_inputs("a file of the mesh", scene_files(arguments.own.mesh));
  }
  files.add_input("the height map", arguments.own.map);
  files.add_input("the rays", arguments.rays);
  for (const auto& [option, output] : outputs) check_writable(output);
  if (!arguments.figures.empty()) figures_folder_make(arguments.figures);
  std::optional<tbb::global_control> limit;
  if (arguments.threads > 0) {
    limit.emplace(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(arguments.threads));
  }
  BenchOptions options;
  options.scenes = arguments.scenes;
  options.parts = parts_of(arguments.parts);
  options.map_scale = arguments.map_scale;
  options.rounds = arguments.rounds;
  std::optional<OwnScene> own;
  if (!arguments.own.mesh.empty()) {
    own.emplace(arguments.own);
    options.own = &*own;
  }
  if (!arguments.rays.empty()) options.rays = bench_rays(arguments.rays);
  options.tessellation_bytes =
      arguments.memory_gib > 0 ? static_cast<std::uint64_t>(arguments.memory_gib * (1 << 30)) : half_of_memory();
  if (arguments.quick) {
    options.map_scale *= 1.0 / 16;
    options.vector_shrink = 16;
    options.resolution = {96, 54};
    options.rounds = 1;
    options.tessellation_bytes = std::min<std::uint64_t>(options.tessellation_bytes, 30 << 20);
  }
  if (isatty(STDERR_FILENO) != 0) {
    options.progress = [](const std::string& line) { std::fputs((printable_text(line) + "\n").c_str(), stderr); };
  }
  const BenchResults results = bench_displacement_run(options);
  fmt::print("{}", bench_markdown(results));
  for (const auto& [option, output] : outputs) files.check_output(option, output);
  if (!arguments.json.empty()) atomic_write(arguments.json, bench_json(results));
  if (!arguments.csv.empty()) atomic_write(arguments.csv, bench_csv(results));
  if (!arguments.html.empty() || !arguments.figures.empty()) {
    const std::string page = bench_html(results);
    if (!arguments.html.empty()) atomic_write(arguments.html, page);
    if (!arguments.figures.empty()) figures_write(files, arguments.figures, page);
  }
  return 0;
}

/// What benches of one study have in common.
struct StudyArguments {
  std::string json, html, figures;
  std::vector<std::string> inputs;  ///< files that are read
  bool are_scenes = false;          ///< they name files that are read, too
  int rounds = 3;
  bool quick = false;
};

/// Runs a study and writes what it found.
template <class Options, class Results>
int bench_study(const StudyArguments& arguments,
                Options options,
                Results (*study)(const Options&),
                std::string (*markdown_of)(const Results&),
                std::string (*json_of)(const Results&),
                std::string (*html_of)(const Results&))
{
  RunFiles files;
  files.add_output("--json", arguments.json);
  files.add_output("--html", arguments.html);
  for (const std::string& input : arguments.inputs) {
    files.add_input("an input", input);
    if (arguments.are_scenes) files.add_inputs("a file of the scene", scene_files(input));
  }
  for (const std::string& output : {arguments.json, arguments.html}) check_writable(output);
  if (!arguments.figures.empty()) figures_folder_make(arguments.figures);
  options.rounds = arguments.quick ? 1 : arguments.rounds;
  if (isatty(STDERR_FILENO) != 0) {
    options.progress = [](const std::string& line) { std::fputs((printable_text(line) + "\n").c_str(), stderr); };
  }
  const Results results = study(options);
  fmt::print("{}", markdown_of(results));
  files.check_output("--json", arguments.json);
  files.check_output("--html", arguments.html);
  if (!arguments.json.empty()) atomic_write(arguments.json, json_of(results));
  if (!arguments.html.empty() || !arguments.figures.empty()) {
    const std::string page = html_of(results);
    if (!arguments.html.empty()) atomic_write(arguments.html, page);
    if (!arguments.figures.empty()) figures_write(files, arguments.figures, page);
  }
  return 0;
}

void add_report(CLI::App& command, const char* option, std::string& value, const char* suffix, const char* description)
{
  const auto parse = [=](const std::string& text) { return parse_output(option, text, suffix); };
  names_file(add_parsed(command, option, value, parse, description), {suffix});
}

void add_reports(CLI::App& command, std::string& json, std::string& html, std::string& figures)
{
  add_report(command, "--json", json, ".json", "Figures, as JSON");
  add_report(command, "--html", html, ".html", "One page with tables, plots and pictures");
  names_file(command.add_option("--figures", figures, "Folder that gets each plot, as SVG and PNG"), {})
      ->type_name("FOLDER");
}

void add_study_options(CLI::App& command, StudyArguments& a)
{
  command.add_option("--rounds", a.rounds, "Times that all rays are traced; the fastest counts")
      ->check(whole_number(1, 1000))
      ->capture_default_str();
  add_reports(command, a.json, a.html, a.figures);
  command.add_flag("--quick", a.quick, "Small, one round: whether it works, not how fast");
}

void heightfield_register(CLI::App& bench, Run& run)
{
  CLI::App* command =
      bench.add_subcommand("heightfield", "Cone maps as published, over a plane: speed, and how many rays are wrong");
  struct Arguments : StudyArguments {
    int size = 128;
    std::vector<std::string> cones;
  };
  auto arguments = std::make_shared<Arguments>();
  command->add_option("--size", arguments->size, "Texels along a side of the height maps")
      ->check(one_of({"16", "32", "64", "128", "256", "512"}))
      ->capture_default_str();
  names_file(command->add_option("--map", arguments->inputs,
                                 "Image of heights that is studied too; may be given several times"),
             kImageSuffixes);
  command
      ->add_option("--cones", arguments->cones,
                   "Cone maps, separated by commas: conservative, quick, approximate-relaxed, relaxed, quick-relaxed "
                   "(default: all)")
      ->delimiter(',')
      ->check(one_of(bench_heightfield_cones()));
  add_study_options(*command, *arguments);
  command->callback([&run, arguments] {
    run = [arguments] {
      HeightfieldOptions options;
      options.size = arguments->size;
      options.maps = arguments->inputs;
      options.cones = arguments->cones;
      if (arguments->quick) {
        options.size = 16;
        options.width = 64;
        options.height = 36;
      }
      return bench_study(*arguments, options, bench_heightfield_run, bench_heightfield_markdown, bench_heightfield_json,
                         bench_heightfield_html);
    };
  });
}

void procedural_register(CLI::App& bench, Run& run)
{
  CLI::App* command = bench.add_subcommand(
      "procedural", "Heights that are computed: microtriangle marching as published, and heights on demand");
  struct Arguments : StudyArguments {
    std::vector<std::string> parts;
  };
  auto arguments = std::make_shared<Arguments>();
  arguments->are_scenes = true;
  command
      ->add_option("--parts", arguments->parts,
                   "Parts, separated by commas: marching, lattice, smoothing, pot, terrain, planet (default: all)")
      ->delimiter(',')
      ->check(one_of(bench_procedural_parts()));
  names_file(command->add_option("--mesh", arguments->inputs,
                                 "Scene whose meshes are smoothed beside the icosahedron; may be given several times"),
             kSceneSuffixes);
  add_study_options(*command, *arguments);
  command->callback([&run, arguments] {
    run = [arguments] {
      ProceduralOptions options;
      options.parts = arguments->parts;
      options.meshes = arguments->inputs;
      if (arguments->quick) {
        options.num_rays = 500;
        options.world_shrink = 16;
        options.world_mesh_divisor = 8;
      }
      return bench_study(*arguments, options, bench_procedural_run, bench_procedural_markdown, bench_procedural_json,
                         bench_procedural_html);
    };
  });
}

}  // namespace

void cmd_bench_register(CLI::App& app, Run& run)
{
  CLI::App* bench = app.add_subcommand("bench", "Measures methods side by side and reproduces a paper's tables");
  bench->require_subcommand(1);
  CLI::App* command =
      bench->add_subcommand("displacement", "Ways to trace displaced triangles: speed, memory, agreement");
  auto arguments = std::make_shared<BenchArguments>();
  BenchArguments& a = *arguments;
  CLI::Option* scenes = command->add_option("--scenes", a.scenes, "Scenes, separated by commas (default: all)")
                            ->delimiter(',')
                            ->check(one_of(scene_names()));
  command
      ->add_option(
          "--parts", a.parts,
          "Parts, separated by commas: table, marching, sweeps, inversion, tessellation, costs, frames, vector "
          "(default: all)")
      ->delimiter(',')
      ->check(one_of({"table", "marching", "sweeps", "inversion", "tessellation", "costs", "frames", "vector"}));
  CLI::Option* map_scale = command->add_option("--map-scale", a.map_scale, "Factor of the height maps' sides")
                               ->check(number(0.01, 8))
                               ->capture_default_str();
  CLI::Option* mesh = names_file(
      command->add_option("--mesh", a.own.mesh, "Mesh of your own in place of the scenes, with --map and --scale"),
      {".obj", ".gltf", ".glb"});
  CLI::Option* map = names_file(command->add_option("--map", a.own.map, "Its height map"), kImageSuffixes);
  CLI::Option* scale =
      command->add_option("--scale", a.own.scale, "How far it is displaced by heights from 0 to 1, in the mesh's units")
          ->check(number(-1e6, 1e6));
  command->add_option("--midlevel", a.own.midlevel, "Height that stays where it is")
      ->check(number(-1e6, 1e6))
      ->capture_default_str()
      ->needs(mesh);
  command->add_option("--tiles", a.own.tiles, "Factor of its texture coordinates")
      ->check(number(1e-3, 1e4))
      ->capture_default_str()
      ->needs(mesh);
  names_file(command->add_option("--rays", a.rays,
                                 "File of rays in place of a camera's, one 'ox oy oz dx dy dz [tmin tmax]' a line"),
             {})
      ->needs(mesh);
  mesh->needs(map)->needs(scale)->excludes(scenes)->excludes(map_scale);
  map->needs(mesh);
  scale->needs(mesh);
  command->add_option("--rounds", a.rounds, "Times that each chunk of rays is traced; the fastest counts")
      ->check(whole_number(1, 1000))
      ->capture_default_str();
  command->add_option("--memory", a.memory_gib, "GiB for the tessellations of a scene (default: half of the machine's)")
      ->check(number(0.001, 1e6));
  command->add_option("--threads", a.threads, "Threads for preparation; rays are traced by one (default: all)")
      ->check(whole_number(1, 1024));
  add_reports(*command, a.json, a.html, a.figures);
  add_report(*command, "--csv", a.csv, ".csv", "Figures of the table, as CSV");
  command->add_flag("--quick", a.quick, "Small maps, few rays, one round: whether it works, not how fast");
  command->callback([&run, arguments] {
    const BenchArguments& given = *arguments;
    const bool has_scenes = !given.scenes.empty() || !given.own.mesh.empty();
    if (has_scenes && !given.parts.empty() && parts_of(given.parts).vectors)
      throw CLI::ValidationError("--parts", "expected no vector with --scenes or --mesh: it has scenes of its own");
    run = [arguments] { return bench_displacement(*arguments); };
  });
  heightfield_register(*bench, run);
  procedural_register(*bench, run);
  bench_error_register(*bench, run);
}

}  // namespace relief
