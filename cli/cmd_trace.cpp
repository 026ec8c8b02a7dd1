#include <charconv>
#include <cmath>
#include <fstream>
#include <memory>
#include <string>

#include <fmt/format.h>

#include "cli/arguments.h"
#include "cli/commands.h"
#include "cli/scene_setup.h"
#include "exporters/atomic_file.h"
#include "exporters/errors.h"
#include "integrator/trace.h"
#include "scene/load.h"

namespace relief {

namespace {

struct TraceArguments {
  std::string scene, rays, output = "-", pixel, camera, resolution;
  std::uint64_t seed = 0;
};

/// Numbers of a line separated by blanks; empty if anything else stands in it.
std::vector<float> parse_numbers(const std::string& line)
{
  std::vector<float> numbers;
  const char* at = line.data();
  const char* end = at + line.size();
  while (true) {
    while (at != end && (*at == ' ' || *at == '\t' || *at == '\r')) ++at;
    if (at == end) return numbers;
    float value = 0;
    const auto result = std::from_chars(at, end, value);
    if (result.ec != std::errc()) return {};
    numbers.push_back(value);
    at = result.ptr;
  }
}

std::vector<TraceRay> read_rays(const std::string& file)
{
  std::ifstream in(file);
  if (!in) throw InputError(file, "expected a readable file of rays, found none");
  std::vector<TraceRay> rays;
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    if (line.find_first_not_of(" \t\r") == std::string::npos || line[0] == '#') continue;
    const std::vector<float> v = parse_numbers(line);
    if (v.size() != 6 && v.size() != 8) {
      throw InputError(file,
                       fmt::format("line {}: expected 'ox oy oz dx dy dz [tmin tmax]', found '{}'", number, line));
    }
    TraceRay ray{{v[0], v[1], v[2]}, {v[3], v[4], v[5]}, 0.0f, kInfinity};
    if (v.size() == 8) {
      ray.t_min = v[6];
      ray.t_max = v[7];
    }
    if (!is_finite(ray.O) || !is_finite(ray.D) || is_zero(ray.D) || !(ray.t_min >= 0.0f)) {
      throw InputError(file,
                       fmt::format("line {}: expected finite numbers, a direction that is not zero and tmin >= 0, "
                                   "found '{}'",
                                   number, line));
    }
    rays.push_back(ray);
  }
  return rays;
}

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
    csv += fmt::format("1,{},{},{},{},{},{},{},{},{},{},{},\n", h.t, h.P.x, h.P.y, h.P.z, h.Ng.x, h.Ng.y, h.Ng.z, h.u,
                       h.v, h.mesh_index, h.triangle_index);
  }
  return csv;
}

int trace(const TraceArguments& arguments)
{
  const Scene scene = scene_load(arguments.scene);
  for (const std::string& warning : scene.warnings) fmt::print(stderr, "relief: warning: {}\n", warning);
  if (arguments.pixel.empty()) {
    const std::vector<TraceRay> rays = read_rays(arguments.rays);
    const SceneContext context(scene);
    write_text(arguments.output, hits_csv(trace_rays(context, rays)));
    return 0;
  }
  RenderOptions options;
  options.settings = scene.render;
  options.settings.seed = arguments.seed;
  if (!arguments.resolution.empty()) {
    parse_resolution(arguments.resolution, &options.settings.width, &options.settings.height);
  }
  options.camera = camera_for_image(scene, arguments.camera, options.settings.width, options.settings.height);
  const PixelSample at = parse_pixel(arguments.pixel, options.settings.width, options.settings.height);
  const SceneContext context(scene);
  std::string text = "# kind ox oy oz dx dy dz tmin tmax: rays of the path in order; strip the first word for --rays\n";
  for (const RecordedRay& r : trace_path(context, options, at.x, at.y, at.sample_index)) {
    text += fmt::format("{} {} {} {} {} {} {} {} {}\n", r.shadow ? "shadow" : "path", r.O.x, r.O.y, r.O.z, r.D.x, r.D.y,
                        r.D.z, r.t_min, r.t_max);
  }
  write_text(arguments.output, text);
  return 0;
}

}  // namespace

void cmd_trace_register(CLI::App& app, Run& run)
{
  auto arguments = std::make_shared<TraceArguments>();
  CLI::App* command = app.add_subcommand("trace", "Traces single rays, or shows the rays of one pixel's path");
  command->add_option("scene", arguments->scene, "Scene file (.gltf, .glb)")->required();
  CLI::Option* rays =
      command->add_option("--rays", arguments->rays, "File of rays, one 'ox oy oz dx dy dz [tmin tmax]' a line");
  CLI::Option* pixel =
      command->add_option("--pixel", arguments->pixel, "X,Y[,SAMPLE]: print the rays of that path instead");
  rays->excludes(pixel);
  command->add_option("-o,--output", arguments->output, "CSV of hits, or the path's rays; - is standard output")
      ->capture_default_str();
  command->add_option("--camera", arguments->camera, "Camera of --pixel (default: the first)");
  command->add_option("--resolution", arguments->resolution, "Image size of --pixel (default: the scene's)");
  command->add_option("--seed", arguments->seed, "Seed of --pixel")->capture_default_str();
  command->callback([&run, arguments, rays, pixel] {
    if (rays->count() + pixel->count() == 0) throw CLI::RequiredError("--rays or --pixel");
    run = [arguments] { return trace(*arguments); };
  });
}

}  // namespace relief
