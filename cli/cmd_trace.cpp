#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "cli/arguments.h"
#include "cli/commands.h"
#include "cli/memory_option.h"
#include "cli/picture_options.h"
#include "cli/ray_file.h"
#include "cli/run_files.h"
#include "cli/scene_setup.h"
#include "cli/standard_streams.h"
#include "cli/value_hint.h"
#include "exporters/atomic_file.h"
#include "exporters/errors.h"
#include "integrator/scene_context.h"
#include "integrator/scene_displacement.h"
#include "integrator/trace.h"
#include "scene/diagnostics.h"
#include "scene/load.h"
#include "scene/memory.h"

namespace relief {

namespace {

struct TraceArguments {
  std::string scene, rays, output = "-";
  std::optional<PixelSample> pixel;
  PictureOptions picture;
  std::optional<int> frame;
  int explain = -1;  ///< ray to explain, −1: none
  SceneSetup setup;
};

void write_text(const std::string& output, const std::string& text)
{
  if (output == "-") {
    fmt::print("{}", text);
  } else {
    atomic_write(output, text);
  }
}

std::string hits_csv(const std::vector<TraceHit>& hits)
{
  std::string csv = "hit,t,px,py,pz,nx,ny,nz,u,v,mesh,triangle,steps\n";
  for (const TraceHit& h : hits) {
    if (!h.hit) {
      csv += "0,,,,,,,,,,,,\n";
      continue;
    }
    csv += fmt::format("1,{},{},{},{},{},{},{},{},{},{},{},{}\n", h.t, h.P.x, h.P.y, h.P.z, h.Ng.x, h.Ng.y, h.Ng.z, h.u,
                       h.v, h.mesh_index, h.triangle_index, h.steps ? std::to_string(*h.steps) : "");
  }
  return csv;
}

/// What one prism did to a ray, several lines.
/// @param t_unit  as for prism_explain
std::string visit_text(const Scene& scene, const PrismVisit& visit, double t_unit)
{
  const Instance& instance = scene.instances[visit.instance];
  const PrismExplanation e = prism_explain(visit, t_unit);
  std::string text =
      fmt::format("mesh {} triangle {} (node '{}'): ", instance.mesh_index, e.triangle, printable_text(instance.name));
  if (e.num_stretches == 0) return text + "in its box, beside its prism\n";
  text += fmt::format("prism{}, searched from t {} to {}\n", e.folded ? " (folded)" : "", e.t_min, e.t_max);
  text += fmt::format("  object space: origin {} {} {}, direction {} {} {}\n", e.ray.O.x, e.ray.O.y, e.ray.O.z,
                      e.ray.D.x, e.ray.D.y, e.ray.D.z);
  for (int k = 0; k < e.num_stretches; ++k) {
    const PrismStretch& s = e.stretches[k];
    text += fmt::format("  inside: t {} to {}, s {} to {}\n", s.t0, s.t1, s.s0, s.s1);
  }
  text += fmt::format("  tested: {} bounds, {} texels, {} inversions\n", visit.counters.bounds, visit.counters.texels,
                      visit.counters.inversions);
  if (!visit.found) return text + "  no hit\n";
  text += fmt::format("  hit: t {}, b {} {} {}, ", e.t, 1.0 - e.b1 - e.b2, e.b1, e.b2);
  if (e.has_map) text += fmt::format("uv {} {}, ", e.u, e.v);
  return text + fmt::format("cell {} {}, height {}, displacement {} m\n", e.i, e.j, e.h, e.d);
}

/// The traversal of one ray, for people to read.
std::string explanation_text(const Scene& scene, const SceneContext& context, const TraceRay& ray)
{
  const TraceExplanation explained = trace_explain(context, ray);
  std::string text = fmt::format("ray: origin {} {} {}, direction {} {} {}, t {} to {}\n", ray.O.x, ray.O.y, ray.O.z,
                                 ray.D.x, ray.D.y, ray.D.z, ray.t_min, ray.t_max);
  TraversalCounters total;
  for (const PrismVisit& visit : explained.visits) {
    text += visit_text(scene, visit, explained.t_unit);
    total.prisms += visit.counters.prisms;
    total.bounds += visit.counters.bounds;
    total.texels += visit.counters.texels;
    total.inversions += visit.counters.inversions;
  }
  text += fmt::format("in all: {} boxes, {} prisms, {} bounds, {} texels, {} inversions\n", explained.visits.size(),
                      total.prisms, total.bounds, total.texels, total.inversions);
  const TraceHit& h = explained.hit;
  if (!h.hit) return text + "nearest: nothing\n";
  return text + fmt::format("nearest: t {}, mesh {} triangle {}, P {} {} {}, Ng {} {} {}\n", h.t, h.mesh_index,
                            h.triangle_index, h.P.x, h.P.y, h.P.z, h.Ng.x, h.Ng.y, h.Ng.z);
}

/// The path of --pixel as a render follows it.
PathReplay replay(const TraceArguments& arguments, const Scene& scene, const std::vector<SceneCamera>& cameras)
{
  const RenderOptions options = render_options(scene, arguments.picture, cameras);
  const PixelSample& at = *arguments.pixel;
  const FilmWindow window = render_window(options);
  const int x1 = window.x0 + window.width, y1 = window.y0 + window.height;
  if (at.x < window.x0 || at.x >= x1 || at.y < window.y0 || at.y >= y1) {
    throw CLI::ValidationError(
        "--pixel", fmt::format("expected a pixel of {},{},{},{} (X1 and Y1 excluded), found '{},{}'", window.x0,
                               window.y0, x1, y1, at.x, at.y));
  }
  if (at.sample_index >= static_cast<std::uint32_t>(options.settings.samples)) {
    throw CLI::ValidationError("--pixel", fmt::format("expected one of {} samples (--spp), counted from 0, found '{}'",
                                                      options.settings.samples, at.sample_index));
  }
  return trace_path(scene, options, at);
}

/// What a path brings, and its rays in lines that --rays takes back.
std::string replay_text(const PathReplay& path)
{
  std::string text = fmt::format("# radiance {} {} {}\n", path.radiance.x, path.radiance.y, path.radiance.z);
  text += "# kind ox oy oz dx dy dz tmin tmax: rays of the path in order\n";
  for (const RecordedRay& r : path.rays) {
    text += fmt::format("{} {} {} {} {} {} {} {} {}\n", r.shadow ? kShadowRay : kPathRay, r.O.x, r.O.y, r.O.z, r.D.x,
                        r.D.y, r.D.z, r.t_min, r.t_max);
  }
  return text;
}

int trace(const TraceArguments& arguments)
{
  RunFiles files;
  const std::string output = arguments.output == "-" ? "" : arguments.output;
  files.add_output("--output", output);
  files.add_input("the scene", arguments.scene);
  files.add_input("the environment", arguments.setup.environment_file());
  files.add_input("the rays", arguments.rays);
  check_writable(output);
  // Rays first: their mistakes are found before a large scene is loaded.
  std::vector<TraceRay> rays;
  if (!arguments.pixel) rays = read_rays(arguments.rays);
  if (arguments.explain >= static_cast<int>(rays.size())) {
    throw CLI::ValidationError("--explain", fmt::format("expected one of {} rays, counted from 0, found '{}'",
                                                        rays.size(), arguments.explain));
  }
  LoadOptions load = arguments.setup.load_options(arguments.frame);
  load.camera = camera_choice(arguments.picture);
  const Scene scene = scene_load(arguments.scene, load);
  files.add_inputs("a file of the scene", scene.files);
  for (const std::string& text : scene.warnings) print_warning(text);
  for (const std::string& text : displacement_warnings(scene, arguments.picture.displacement)) print_warning(text);
  if (arguments.pixel) {
    const PictureCameras cameras = picture_cameras(scene, arguments.picture, arguments.frame);
    files.add_inputs("a file of the camera", cameras.files);
    const PathReplay path = replay(arguments, scene, cameras.cameras);
    for (const std::string& text : path.warnings) print_warning(text);
    files.check_output("--output", output);
    write_text(arguments.output, replay_text(path));
    return 0;
  }
  const SceneContext context(scene, arguments.picture.displacement);
  for (const std::string& text : context.displacements.warnings()) print_warning(text);
  const std::string text = arguments.explain >= 0
                               ? explanation_text(scene, context, rays[static_cast<std::size_t>(arguments.explain)])
                               : hits_csv(trace_rays(context, rays));
  files.check_output("--output", output);
  write_text(arguments.output, text);
  return 0;
}

}  // namespace

void cmd_trace_register(CLI::App& app, Run& run)
{
  auto arguments = std::make_shared<TraceArguments>();
  TraceArguments& a = *arguments;
  CLI::App* command = app.add_subcommand("trace", "Traces single rays, or shows the rays of one pixel's path");
  names_file(command->add_option("scene", a.scene, "Scene that is met"), kSceneSuffixes)->required();
  CLI::Option* rays =
      names_file(command->add_option("--rays", a.rays, "File of rays, one 'ox oy oz dx dy dz [tmin tmax]' a line"), {});
  CLI::Option* pixel = command->add_option_function<std::string>(
      "--pixel", [&a](const std::string& text) { a.pixel = parse_pixel(text); },
      "X,Y[,SAMPLE]: print the rays of that path instead");
  rays->excludes(pixel);
  names_file(command->add_option("-o,--output", a.output,
                                 "CSV of hits, the explanation, or the path's rays; - is standard output"),
             {})
      ->capture_default_str();
  command->add_option("--frame", a.frame, "Frame of the animation (default: the rest pose)")
      ->check(whole_number(0, 1'000'000));
  add_light_options(*command, a.setup);
  add_ray_options(*command, a.picture);
  for (CLI::Option* option : add_picture_options(*command, a.picture)) option->needs(pixel);
  add_continue_without_textures(*command, a.setup);
  add_max_memory(*command);
  command->add_option("--explain", a.explain, "Tell what this ray did in displaced meshes instead, counted from 0")
      ->check(whole_number(0, std::numeric_limits<int>::max()))
      ->needs(rays);
  command->callback([&run, arguments, rays, pixel] {
    if (rays->count() + pixel->count() == 0) throw CLI::RequiredError("--rays or --pixel");
    run = [arguments] { return trace(*arguments); };
  });
}

}  // namespace relief
